"""Small meshes, written and read by hand, for the whole-tool tests."""
import functools
import math
import struct

import numpy as np


def write_ply(path, vertices, triangles, normals=None, comments=(), **properties):
    """Binary, doubles and 32-bit indices. `properties`: further numbers per vertex."""
    rows, names = np.asarray(vertices, float), ["x", "y", "z"]
    if normals is not None:
        rows, names = np.hstack([rows, normals]), [*names, "nx", "ny", "nz"]
    for name, values in properties.items():
        rows, names = np.column_stack([rows, values]), [*names, name]
    faces = np.zeros(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, np.reshape(triangles, (-1, 3))
    header = ["ply", "format binary_little_endian 1.0", *("comment " + comment for comment in comments),
              f"element vertex {len(rows)}", *(f"property double {name}" for name in names),
              f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header\n"]
    with open(path, "wb") as file:
        file.write("\n".join(header).encode() + np.ascontiguousarray(rows, "<f8").tobytes() + faces.tobytes())


write_ply_mm = functools.partial(write_ply, comments=["units mm"])


def write_obj(path, vertices, triangles):
    with open(path, "w") as file:
        for v in vertices:
            file.write("v %.17g %.17g %.17g\n" % tuple(v))
        for t in triangles:
            file.write("f %d %d %d\n" % tuple(i + 1 for i in t))


def read_ply(path):
    """@return header lines, vertex rows (all scalar properties, doubles), triangles"""
    with open(path, "rb") as file:
        header = []
        while True:
            line = file.readline().decode().strip()
            header.append(line)
            if line == "end_header":
                break
        vertices = next(int(l.split()[2]) for l in header if l.startswith("element vertex"))
        faces = next(int(l.split()[2]) for l in header if l.startswith("element face"))
        columns = sum(l.startswith("property double") for l in header)
        rows = [struct.unpack("<%dd" % columns, file.read(8 * columns)) for _ in range(vertices)]
        triangles = [struct.unpack("<B3i", file.read(13))[1:] for _ in range(faces)]
    return header, rows, triangles


def sphere(level, radius=1.0, centre=(0.0, 0.0, 0.0)):
    """Octahedron split `level` times: 8 * 4^level triangles."""
    vertices = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    triangles = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(level):
        middles, fine = {}, []

        def middle(i, j):
            key = (min(i, j), max(i, j))
            if key not in middles:
                m = [a + b for a, b in zip(vertices[i], vertices[j])]
                length = math.sqrt(sum(x * x for x in m))
                middles[key] = len(vertices)
                vertices.append(tuple(x / length for x in m))
            return middles[key]

        for i, j, k in triangles:
            a, b, c = middle(i, j), middle(j, k), middle(k, i)
            fine += [(i, a, c), (a, j, b), (c, b, k), (a, b, c)]
        triangles = fine
    return [tuple(radius * x + c for x, c in zip(v, centre)) for v in vertices], triangles


def geodesic_sphere(splits, radius):
    """An icosahedron split `splits` times: 20 x 4^splits triangles. @return arrays: vertices, triangles, unit normals"""
    p = (1 + 5**0.5) / 2
    corners = [(-1, p, 0), (1, p, 0), (-1, -p, 0), (1, -p, 0), (0, -1, p), (0, 1, p),
               (0, -1, -p), (0, 1, -p), (p, 0, -1), (p, 0, 1), (-p, 0, -1), (-p, 0, 1)]
    triangles = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
                 (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5),
                 (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    normals = [np.array(c) / np.linalg.norm(c) for c in corners]
    for _ in range(splits):
        middle_of, finer = {}, []

        def middle(a, b):
            key = (min(a, b), max(a, b))
            if key not in middle_of:
                between = normals[a] + normals[b]
                normals.append(between / np.linalg.norm(between))
                middle_of[key] = len(normals) - 1
            return middle_of[key]

        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        triangles = finer
    normals = np.array(normals)
    return radius * normals, np.array(triangles), normals


def tube(n, m, radius=1.0, length=4.0):
    vertices = [(radius * math.cos(2 * math.pi * i / n), radius * math.sin(2 * math.pi * i / n), length * j / m)
                for j in range(m + 1) for i in range(n)]
    triangles = []
    for j in range(m):
        for i in range(n):
            a, b, c, d = j * n + i, j * n + (i + 1) % n, (j + 1) * n + (i + 1) % n, (j + 1) * n + i
            triangles += [(a, b, c), (a, c, d)]
    return vertices, triangles


def euler(triangles):
    edges = {(min(t[k], t[k - 1]), max(t[k], t[k - 1])) for t in triangles for k in range(3)}
    return len({v for t in triangles for v in t}) - len(edges) + len(triangles)


def directed_edges_are_unique(triangles):
    """True for an oriented manifold's edges: each runs at most once in each direction."""
    edges = [(t[k - 1], t[k]) for t in triangles for k in range(3)]
    return len(edges) == len(set(edges))


def boundary_edges(triangles):
    edges = {(t[k - 1], t[k]) for t in triangles for k in range(3)}
    return [(a, b) for a, b in edges if (b, a) not in edges]
