"""Meshes from formulas for contact problems: discs, rings, balls, caps. Numbers: mm."""
import math

import numpy as np
from contact_scenes import octant
from published import grid


def zip_rings(inner, outer):
    """Triangles between two arcs of nodes that span the same angle."""
    triangles, i, j, m, n = [], 0, 0, len(inner) - 1, len(outer) - 1
    while i < m or j < n:
        if j == n or (i < m and (i + 1) / m < (j + 1) / n - 1e-9):
            triangles.append((inner[i], outer[j], inner[i + 1]))
            i += 1
        else:
            triangles.append((inner[i], outer[j], outer[j + 1]))
            j += 1
    return triangles


def quarter_disc(radius, segments):
    """A quarter of a flat disc. Its sides are even: steps up to a sixteenth of the radius, then in proportion.

    @return points, triangles
    """
    rings = math.ceil(math.log(16) / math.log(1 + math.pi / 2 / segments))
    radii = radius / 16 * np.concatenate([np.arange(1, segments) / segments, 16**(np.arange(rings + 1) / rings)])
    points, triangles, ring = [(0.0, 0.0, 0.0)], [], [0]
    for k, r in enumerate(radii):
        angles = np.linspace(0, math.pi / 2, min(k + 1, segments) + 1)
        following = list(range(len(points), len(points) + len(angles)))
        points += [(r * math.cos(angle), r * math.sin(angle), 0.0) for angle in angles]
        triangles += [(0, following[0], following[1])] if k == 0 else zip_rings(ring, following)
        ring = following
    points = np.array(points)
    points[abs(points) < 1e-12 * radius] = 0
    return points, np.array(triangles)


def strip(line, directions, width):
    """One row of cells over a line in the plane of x and z.

    @return points, two per point of the line, then triangles and normals towards `directions`
    """
    count = len(line) - 1

    def along(values, u):
        return np.interp(u * count, range(count + 1), values)

    points, triangles, normals = grid(
        count, 1, lambda u, v: (along(line[:, 0], u), width * v, along(line[:, 1], u)),
        lambda p, u, v: (along(directions[:, 0], u), 0 * u, along(directions[:, 1], u)))
    points[abs(points) < 1e-12 * abs(points).max()] = 0
    if (normals[:, [0, 2]] * np.repeat(directions, 2, axis=0)).sum() < 0:
        normals, triangles = -normals, triangles[:, ::-1]
    return points, triangles, normals


def arc(radius, start, end, cells, width=1.0):
    """A strip on a circle in the plane of x and z, between angles from x to z."""
    angles = np.linspace(start, end, cells + 1)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return strip(radius * directions, directions, width)


def belt(radius, angle, tail, cells, tails):
    """A strip around an angle of a circle, with straight tails; it begins at the x axis, its slack tail below.

    @return points, triangles, normals, unit tangent at the end
    """
    angles = np.concatenate([np.zeros(tails), np.linspace(0, angle, cells + 1), np.full(tails, angle)])
    straight = tail * np.arange(1, tails + 1) / tails
    ways = np.concatenate([-straight[::-1], np.zeros(cells + 1), straight])
    outward = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    tangent = np.stack([-np.sin(angles), np.cos(angles)], axis=1)
    mesh = strip(radius * outward + ways[:, None] * tangent, outward, 1.0)
    return *mesh, np.array([tangent[-1, 0], 0.0, tangent[-1, 1]])


def hoop_of_shells(count, radius, width):
    """A closed row of shells, one of them undermost. @return points, triangles, normals"""
    angles = (np.arange(count) + 0.5) * 2 * math.pi / count - math.pi / 2
    rim = np.stack([np.cos(angles), 0 * angles, np.sin(angles)], axis=1)
    points = np.concatenate([radius * rim, radius * rim + [0, width, 0]])
    k = np.arange(count)
    following = (k + 1) % count
    triangles = np.concatenate([np.stack([k, k + count, following + count], axis=1),
                                np.stack([k, following + count, following], axis=1)])
    return points, triangles, np.concatenate([rim, rim])


def mirrored(points, cells, axis):
    """A mesh and its mirror image in a plane through the origin as one. @return points, cells"""
    on = points[:, axis] == 0
    numbers = np.where(on, np.arange(len(points)), len(points) + np.cumsum(~on) - 1)
    image = points[~on].copy()
    image[:, axis] *= -1
    return np.concatenate([points, image]), np.concatenate([cells, numbers[cells]])


def whole_sphere(frequency):
    """A unit sphere: its points, also its normals, and its triangles, outward."""
    points, triangles = octant(frequency)
    for axis in range(3):
        points, triangles = mirrored(points, triangles, axis)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * a).sum(axis=1) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    return points, triangles


def volumes(points, tetrahedra):
    a, b, c, d = (points[tetrahedra[:, k]] for k in range(4))
    return (np.cross(b - a, c - a) * (d - a)).sum(axis=1) / 6


def positive(points, tetrahedra):
    """The same tetrahedra, each with a positive volume."""
    result = tetrahedra.copy()
    negative = volumes(points, tetrahedra) < 0
    result[negative] = result[negative][:, [0, 2, 1, 3]]
    return result


def extruded(triangles, layers):
    """Prisms between copies of a patch, each cut into three tetrahedra. `layers`: its points, layer by layer."""
    count, tetrahedra = len(layers[0]), []
    for k in range(len(layers) - 1):
        for a, b, c in np.sort(triangles, axis=1) + k * count:
            tetrahedra += [[a, b, c, c + count], [a, b, b + count, c + count], [a, a + count, b + count, c + count]]
    points = np.concatenate(layers)
    return points, positive(points, np.array(tetrahedra))


def lattice(shells):
    """An eighth of a ball, x >= 0, y >= 0, z <= 0, as a lattice of tetrahedra (Kuhn's of the cubes that it holds).

    @return unit direction and number of the shell of each point, from 0 at the origin, and the tetrahedra
    """
    keys = [(a, b, c) for a in range(shells + 1) for b in range(a + 1) for c in range(b + 1)]
    numbers = {key: n for n, key in enumerate(keys)}
    orders = ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0))
    tetrahedra = []
    for key in keys:
        for order in orders:
            path = [np.array(key)]
            for axis in order:
                path.append(path[-1] + np.eye(3, dtype=int)[axis])
            if all(tuple(corner) in numbers for corner in path):
                tetrahedra.append([numbers[tuple(corner)] for corner in path])
    a, b, c = np.array(keys, float).T
    parts = np.stack([a - b, b - c, -c], axis=1)
    size = np.linalg.norm(parts, axis=1)
    return parts / np.where(size > 0, size, 1)[:, None], a.astype(int), np.array(tetrahedra)


def eighth_of_a_ball(shells, spacing, radius):
    """An eighth of a ball, its middle at the origin, whose sides are even near there and grow in proportion beyond.

    @return points, tetrahedra, and which points lie on the far face
    """
    directions, shell, tetrahedra = lattice(shells)
    points = directions * (shell * spacing)[:, None]
    last = np.flatnonzero(shell == shells)
    rows = [set(t) & set(last) for t in tetrahedra.tolist()]
    place = {n: k for k, n in enumerate(last)}
    triangles = np.array(sorted({tuple(sorted(place[n] for n in row)) for row in rows if len(row) == 3}))
    near = shells * spacing
    count = math.ceil(math.log(radius / near) / math.log(1 + 1 / shells) - 1e-9)
    radii = near * (radius / near)**(np.arange(count + 1) / max(count, 1))
    if count > 0:
        outer, prisms = extruded(triangles, [directions[last] * r for r in radii])
        names = np.concatenate([last, np.arange(len(points), len(points) + len(outer) - len(last))])
        points = np.concatenate([points, outer[len(last):]])
        tetrahedra = np.concatenate([tetrahedra, names[prisms]])
    return points, positive(points, tetrahedra), np.linalg.norm(points, axis=1) > radius * (1 - 1e-9)


def whole_ball(shells, radius):
    """Tetrahedra of a ball around the origin. @return points, tetrahedra"""
    points, tetrahedra, _ = eighth_of_a_ball(shells, radius / shells, radius)
    for axis in range(3):
        points, tetrahedra = mirrored(points, tetrahedra, axis)
    return points, positive(points, tetrahedra)


def shell_masses(points, triangles, thickness, density):
    """Lumped masses of flat shells."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    masses = np.zeros(len(points))
    np.add.at(masses, triangles.ravel(), np.repeat(areas * thickness * density / 3, 3))
    return masses


def solid_masses(points, tetrahedra, density):
    """Lumped masses of tetrahedra."""
    masses = np.zeros(len(points))
    np.add.at(masses, tetrahedra.ravel(), np.repeat(abs(volumes(points, tetrahedra)) * density / 4, 4))
    return masses
