"""The curved patches of a shell mesh, evaluated from nothing but what the PLY file holds: an independent reading of the contract.

point = flat point + w n, n the facet's unit normal, w the 9-term cubic c1 + c2 x + c3 y + c4 x^2 + c5 xy + c6 y^2 +
c7 x^3 + c8 x y^2 + c9 y^3 with w = 0 and slope -(N.e)/(N.n) at the corners, averaged over the three choices of the
first vertex (x axis along the edge from it to the next).

watertight: a cubic Bezier triangle. An edge's control point next to a corner lies from it along the edge's part in the
tangent plane, by 2 |edge| / (3 (1 + cos)), cos that between the two; the centre makes the terms x^2 y of every
coordinate vanish, averaged over the first vertex like w. Where the normals A and B of the two triangles at an edge's end
differ, the edge also loses its part along A - B, by a share: all of it where they are 20 degrees apart or more, none where
they agree or the edge lies along A - B.
"""
import numpy as np


def monomials(x, y):
    return np.array([np.ones_like(x), x, y, x * x, x * y, y * y, x**3, x * y * y, y**3])


def deflection(corners, normals, barycentric):
    """w at the points, for the first corner as it is given."""
    p1, p2, p3 = corners
    n = np.cross(p2 - p1, p3 - p1)
    n /= np.linalg.norm(n)
    ex = (p2 - p1) / np.linalg.norm(p2 - p1)
    ey = np.cross(n, ex)
    rows, values = [], []
    for p, normal in zip(corners, normals):
        x, y = (p - p1) @ ex, (p - p1) @ ey
        rows += [[1, x, y, x * x, x * y, y * y, x**3, x * y * y, y**3],
                 [0, 1, 0, 2 * x, y, 0, 3 * x * x, y * y, 0],
                 [0, 0, 1, 0, x, 2 * y, 0, 2 * x * y, 3 * y * y]]
        values += [0, -(normal @ ex) / (normal @ n), -(normal @ ey) / (normal @ n)]
    c = np.linalg.solve(np.array(rows, float), np.array(values))
    flat = barycentric @ corners
    return c @ monomials((flat - p1) @ ex, (flat - p1) @ ey)


def patch_points(corners, normals, barycentric):
    """Points of the patch at rows (b1, b2, b3)."""
    n = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    n /= np.linalg.norm(n)
    w = sum(deflection(np.roll(corners, -k, 0), np.roll(normals, -k, 0), np.roll(barycentric, -k, 1))
            for k in range(3)) / 3
    return barycentric @ corners + np.outer(w, n)


def normals_across(triangles, corner_normals):
    """#T x 3 x 3 x 3: at corner i of a triangle, what the triangle across the edge to corner j has there (its own where
    there is none, and for i = j)."""
    at = {}
    for t, nodes in enumerate(triangles):
        for i in range(3):
            for j in ((i + 1) % 3, (i + 2) % 3):
                at.setdefault((nodes[i], nodes[j]), []).append((t, corner_normals[t][i]))
    out = np.repeat(np.asarray(corner_normals)[:, :, None], 3, axis=2)
    for t, nodes in enumerate(triangles):
        for i in range(3):
            for j in ((i + 1) % 3, (i + 2) % 3):
                for other, normal in at[nodes[i], nodes[j]]:
                    if other != t:
                        out[t, i, j] = normal
    return out


def watertight_points(corners, normals, barycentric, across=None):
    """Points of the watertight patch at rows (b1, b2, b3). across: normals_across() of it, where edges are creases."""
    def beside(i, j):
        edge = corners[j] - corners[i]
        other = normals[i] if across is None else across[i, j]
        mean = (normals[i] + other) / np.linalg.norm(normals[i] + other)
        along = edge - mean * (mean @ edge)
        apart = normals[i] - other
        if apart @ apart > 0:
            turned = (apart @ edge) ** 2 / (apart @ apart * (edge @ edge))
            share = min(1, apart @ apart / (2 * np.sin(np.radians(10))) ** 2) * np.clip(2 - 4 * turned, 0, 1)
            along = along - share * apart * (apart @ edge) / (apart @ apart)
        cosine = np.linalg.norm(along) / np.linalg.norm(edge)
        return corners[i] + along / np.linalg.norm(along) * np.linalg.norm(edge) * 2 / (3 * (1 + cosine))

    control = {}
    for i in range(3):
        for j in range(3):
            power = [0, 0, 0]
            power[i] += 2
            power[j] += 1
            control[tuple(power)] = corners[i] if i == j else beside(i, j)
    centre = np.zeros(3)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3

        def at(a, b, c):
            power = [0, 0, 0]
            power[i], power[j], power[k] = a, b, c
            return control[tuple(power)]

        edge = corners[j] - corners[i]
        foot = (corners[k] - corners[i]) @ edge / (edge @ edge)
        centre += (at(2, 0, 1) + at(0, 2, 1) - (1 - foot) * (at(3, 0, 0) - 2 * at(2, 1, 0) + at(1, 2, 0))
                   - foot * (at(2, 1, 0) - 2 * at(1, 2, 0) + at(0, 3, 0))) / 2
    control[1, 1, 1] = centre / 3
    weight = {3: 1, 2: 3, 1: 6}
    return sum(np.outer(weight[max(power)] * np.prod(barycentric ** np.array(power), axis=1), p)
               for power, p in control.items())
