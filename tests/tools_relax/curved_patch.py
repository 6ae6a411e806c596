"""The curved patches of a shell mesh, evaluated from nothing but the PLY file: an independent reading of the contract.

point = flat point + w n, n the facet's unit normal, w the 9-term cubic c1 + c2 x + c3 y + c4 x^2 + c5 xy + c6 y^2 +
c7 x^3 + c8 x y^2 + c9 y^3 with w = 0 and slope -(N.e)/(N.n) at the corners, averaged over the three choices of the
first vertex (x axis along the edge from it to the next).
"""
import numpy as np


def read_ply(path):
    """Vertex properties by name, triangles, comments of a binary little-endian PLY."""
    with open(path, "rb") as file:
        data = file.read()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    types = {"double": "<f8", "float": "<f4", "int": "<i4", "uint": "<u4", "uchar": "u1"}
    comments, fields, counts, element, face = [], [], {}, None, []
    for line in data[:end].decode("ascii").splitlines():
        words = line.split()
        if words[0] == "comment":
            comments.append(line[len("comment "):])
        elif words[0] == "format":
            assert words[1] == "binary_little_endian"
        elif words[0] == "element":
            element = words[1]
            counts[element] = int(words[2])
        elif words[0] == "property" and element == "vertex":
            fields.append((words[2], types[words[1]]))
        elif words[0] == "property" and words[1] == "list":
            length = 9 if words[4] == "corner_normals" else 3
            face += [("n_" + words[4], types[words[2]]), (words[4], types[words[3]], length)]
    vertices = np.frombuffer(data, np.dtype(fields), counts["vertex"], end)
    faces = np.frombuffer(data, np.dtype(face), counts["face"], end + vertices.nbytes)
    assert (faces["n_vertex_indices"] == 3).all()
    return vertices, faces["vertex_indices"].astype(int), comments


def columns(vertices, names):
    return np.stack([vertices[name] for name in names], axis=1)


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
