"""Meshes of known surfaces: turned at random and with their nodes shifted at random along the surface, by a seed."""
import meshes
import numpy as np

SHIFT = 0.12  # of the length of an edge, to either side


def rotation(rng):
    """A rotation, uniformly distributed."""
    q = rng.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def turned(mesh, turn):
    points, triangles, normals = mesh
    return points @ turn.T, triangles, normals @ turn.T


def mean_edge(points, triangles):
    return np.mean([np.linalg.norm(points[triangles[:, k]] - points[triangles[:, k - 1]], axis=1) for k in range(3)])


def sphere(frequency, radius, rng):
    """Geodesic, 20 x frequency^2 triangles."""
    directions, triangles = meshes.geodesic(frequency)
    shift = SHIFT * mean_edge(directions, triangles)
    directions = directions + rng.uniform(-shift, shift, directions.shape)
    directions = directions @ rotation(rng).T
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return radius * directions, triangles, directions


def disc(rings, radius, rng):
    """A flat disc of 6 x rings^2 triangles; its boundary nodes stay on the circle."""
    points, triangles = meshes.disc(rings, radius)
    inside = slice(0, 3 * rings * (rings - 1) + 1)
    points[inside, :2] += rng.uniform(-SHIFT, SHIFT, points[inside, :2].shape) * radius / rings
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return turned((points, triangles, normals), rotation(rng))


def lattice(columns, rows, rng, closed=False):
    """Cells of the unit square, each cut by a diagonal chosen at random, inner nodes shifted; `closed`: u = 0 is u = 1.
    @return u and v of the nodes, triangles"""
    across = columns if closed else columns + 1
    u, v = np.meshgrid(np.arange(across) / columns, np.arange(rows + 1) / rows, indexing="ij")
    u, v = u.ravel(), v.ravel()
    free_u = np.ones(len(u), bool) if closed else (u > 1e-9) & (u < 1 - 1e-9)
    free_v = (v > 1e-9) & (v < 1 - 1e-9)
    u = u + free_u * rng.uniform(-SHIFT, SHIFT, len(u)) / columns
    v = v + free_v * rng.uniform(-SHIFT, SHIFT, len(v)) / rows
    triangles = []
    for i in range(columns):
        for j in range(rows):
            a, b = i * (rows + 1) + j, (i + 1) % across * (rows + 1) + j
            c, d = b + 1, a + 1
            triangles += [(a, b, c), (a, c, d)] if rng.integers(2) else [(a, b, d), (b, c, d)]
    return u, v, np.array(triangles)
