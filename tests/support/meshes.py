"""Small meshes, written and read by hand, for the whole-tool tests."""
import math
import struct


def write_ply(path, vertices, triangles, normals=None, comments=()):
    with open(path, "wb") as file:
        lines = ["ply", "format binary_little_endian 1.0", *("comment " + c for c in comments),
                 "element vertex %d" % len(vertices)]
        lines += ["property double " + name for name in (["x", "y", "z"] + (["nx", "ny", "nz"] if normals else []))]
        lines += ["element face %d" % len(triangles), "property list uchar int vertex_indices", "end_header", ""]
        file.write("\n".join(lines).encode())
        for i, v in enumerate(vertices):
            file.write(struct.pack("<3d", *v) + (struct.pack("<3d", *normals[i]) if normals else b""))
        for t in triangles:
            file.write(struct.pack("<B3i", 3, *t))


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
