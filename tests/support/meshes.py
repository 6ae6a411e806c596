"""Small meshes of known shapes, and mesh files written and read without tunica."""
import functools
import math
import pathlib

import numpy as np

GOLDEN = (1 + math.sqrt(5)) / 2
ICOSAHEDRON = (np.array([(-1, GOLDEN, 0), (1, GOLDEN, 0), (-1, -GOLDEN, 0), (1, -GOLDEN, 0), (0, -1, GOLDEN), (0, 1, GOLDEN),
                         (0, -1, -GOLDEN), (0, 1, -GOLDEN), (GOLDEN, 0, -1), (GOLDEN, 0, 1), (-GOLDEN, 0, -1), (-GOLDEN, 0, 1)]),
               [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6),
                (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7),
                (9, 8, 1)])
OCTAHEDRON = (np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]),
              [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)])


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


class Ply:
    """A binary PLY of triangles, by its header: `vertices` (n, 3), `triangles` (m, 3), `comments`, all properties of a vertex
    in `fields` and those of a face in `faces`, structured arrays; what can be counted on the triangles."""

    TYPES = {"double": "<f8", "float": "<f4", "int": "<i4", "uint": "<u4", "uchar": "u1"}

    def __init__(self, path):
        data = pathlib.Path(path).read_bytes()
        end = data.index(b"end_header\n") + len(b"end_header\n")
        lines = data[:end].decode().splitlines()
        assert lines[:2] == ["ply", "format binary_little_endian 1.0"], lines[:2]
        self.comments = [line[len("comment "):] for line in lines if line.startswith("comment ")]
        counts, kinds, element = {}, {"vertex": [], "face": []}, None
        for word, *words in map(str.split, lines):
            if word == "element":
                element = words[0]
                counts[element] = int(words[1])
            elif word == "property" and words[0] == "list":
                length = 9 if words[3] == "corner_normals" else 3
                kinds[element] += [("n_" + words[3], self.TYPES[words[1]]), (words[3], self.TYPES[words[2]], length)]
            elif word == "property":
                kinds[element].append((words[1], self.TYPES[words[0]]))
        assert kinds["vertex"][:3] == [("x", "<f8"), ("y", "<f8"), ("z", "<f8")], kinds
        self.fields = np.frombuffer(data, kinds["vertex"], counts["vertex"], end)
        self.faces = np.frombuffer(data, kinds["face"], counts["face"], end + self.fields.nbytes)
        assert len(data) == end + self.fields.nbytes + self.faces.nbytes
        assert (self.faces["n_vertex_indices"] == 3).all()
        self.vertices = self.columns("x", "y", "z")
        self.triangles = self.faces["vertex_indices"].astype(np.int64)

    def columns(self, *names):
        return np.stack([self.fields[name] for name in names], axis=1)

    def normals(self):
        return self.columns("nx", "ny", "nz")

    def corner_normals(self):
        """m x 3 x 3, the nodes' normals where the file has none per corner."""
        if "corner_normals" in self.faces.dtype.names:
            return self.faces["corner_normals"].reshape(-1, 3, 3)
        return self.normals()[self.triangles]

    def edges(self):
        """Of every triangle, in its direction."""
        return np.concatenate([self.triangles[:, [0, 1]], self.triangles[:, [1, 2]], self.triangles[:, [2, 0]]])

    def rim(self):
        """The edges of one triangle only."""
        edges, n = self.edges(), len(self.vertices)
        return edges[~np.isin(edges @ [n, 1], edges @ [1, n])]

    def is_closed_oriented_manifold(self):
        """Every directed edge once, and its reverse once; the triangles around each vertex are one fan."""
        edges = self.edges()
        n = len(self.vertices)
        codes = edges[:, 0] * n + edges[:, 1]
        reverse = edges[:, 1] * n + edges[:, 0]
        unique = np.unique(codes)
        if len(unique) != len(codes) or not np.array_equal(unique, np.unique(reverse)):
            return False
        # Corners of triangles, joined across edges, form one class per vertex.
        corners = np.arange(3 * len(self.triangles))
        at = self.triangles.reshape(-1)
        order = np.argsort(codes)
        m = len(self.triangles)
        partner = order[np.searchsorted(codes[order], reverse)]
        triangle, side = np.arange(3 * m) % m, np.arange(3 * m) // m
        start = 3 * triangle + side
        # Edge e runs from corner `side` to the next; its partner's end is at the same vertex.
        other = 3 * (partner % m) + (partner // m + 1) % 3
        assert (at[start] == at[other]).all()
        return count_classes(3 * m, start, other) == len(np.unique(at)) and corners.size == 3 * m

    def euler(self):
        edges = np.unique(np.sort(self.edges(), axis=1), axis=0)
        return len(np.unique(self.triangles)) - len(edges) + len(self.triangles)

    def components(self):
        edges = self.edges()
        return count_classes(len(self.vertices), edges[:, 0], edges[:, 1]) - (
            len(self.vertices) - len(np.unique(self.triangles)))

    def corners(self):
        return (self.vertices[self.triangles[:, i]] for i in range(3))

    def volume(self):
        origin = self.vertices.mean(axis=0)
        a, b, c = (corner - origin for corner in self.corners())
        return np.einsum("ij,ij->", a, np.cross(b, c)) / 6

    def smallest_area(self):
        a, b, c = self.corners()
        return np.linalg.norm(np.cross(b - a, c - a), axis=1).min() / 2

    def area(self):
        a, b, c = self.corners()
        return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def count_classes(size, a, b):
    """Connected components of a graph, by label propagation with pointer jumping."""
    label = np.arange(size)
    while True:
        low = np.minimum(label[a], label[b])
        np.minimum.at(label, label[a], low)
        np.minimum.at(label, label[b], low)
        while not np.array_equal(label, label[label]):
            label = label[label]
        if np.array_equal(label[a], label[b]):
            return len(np.unique(label))


def split_in_four(polyhedron, times):
    """The polyhedron blown up to a unit sphere, its triangles split in four so many times. @return points, triangles"""
    corners, triangles = polyhedron
    points = [c / np.linalg.norm(c) for c in corners]
    for _ in range(times):
        middle_of, finer = {}, []

        def middle(a, b):
            key = (min(a, b), max(a, b))
            if key not in middle_of:
                between = points[a] + points[b]
                middle_of[key] = len(points)
                points.append(between / np.linalg.norm(between))
            return middle_of[key]

        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        triangles = finer
    return np.array(points), np.array(triangles)


def sphere(level, radius=1.0, centre=(0.0, 0.0, 0.0)):
    """8 x 4^level triangles, a vertex at each end of the axes. @return lists of tuples"""
    points, triangles = split_in_four(OCTAHEDRON, level)
    return [tuple(p) for p in (radius * points + centre).tolist()], [tuple(t) for t in triangles.tolist()]


def geodesic_sphere(splits, radius):
    """20 x 4^splits triangles. @return arrays: vertices, triangles, unit normals"""
    normals, triangles = split_in_four(ICOSAHEDRON, splits)
    return radius * normals, triangles, normals


def geodesic(frequency):
    """A unit sphere of 20 x frequency^2 triangles. @return points, triangles"""
    corners, faces = ICOSAHEDRON
    nodes, points, triangles = {}, [], []

    def node(face, i, j):
        weights = tuple(sorted((c, w) for c, w in zip(face, (frequency - i - j, i, j)) if w))
        if weights not in nodes:
            nodes[weights] = len(points)
            points.append(sum(w * corners[c] for c, w in weights))
        return nodes[weights]

    for face in faces:
        for i in range(frequency):
            for j in range(frequency - i):
                triangles.append((node(face, i, j), node(face, i + 1, j), node(face, i, j + 1)))
                if i + j + 1 < frequency:
                    triangles.append((node(face, i + 1, j), node(face, i + 1, j + 1), node(face, i, j + 1)))
    return np.array(points) / np.linalg.norm(points, axis=1)[:, None], np.array(triangles)


def rows_around(around, along, shifted=True):
    """Nodes in rows around an axis, every other row turned by half a cell. @return angles, parts of the length, triangles"""
    j, i = np.meshgrid(np.arange(along + 1), np.arange(around), indexing="ij")
    angles = 2 * np.pi * (i + 0.5 * (j % 2) * shifted) / around
    a = (j * around + i)[:-1]
    b = (j * around + (i + 1) % around)[:-1]
    c, d = a + around, b + around
    triangles = np.where(((j % 2 == 1) | (not shifted))[:-1, :, None], np.stack([a, b, d, a, d, c], axis=2),
                         np.stack([a, b, c, b, d, c], axis=2))
    return angles.ravel(), (j / along).ravel(), triangles.reshape(-1, 3)


def tube(around, along, radius=1.0, length=4.0, shifted=False):
    """Open, about the z axis. @return arrays: vertices, triangles"""
    angles, parts, triangles = rows_around(around, along, shifted)
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), length * parts], axis=1), triangles


def disc(rings, radius=1.0):
    """6 x rings^2 triangles, flat. @return arrays: points, triangles"""
    points, triangles, start = [(0.0, 0.0, 0.0)], [], [0]
    for ring in range(1, rings + 1):
        start.append(len(points))
        angles = 2 * math.pi * (np.arange(6 * ring) / (6 * ring))
        points += [(radius * ring / rings * math.cos(a), radius * ring / rings * math.sin(a), 0.0) for a in angles]
    for ring in range(1, rings + 1):
        inner, outer = start[ring - 1], start[ring]
        for k in range(6 * ring):
            side, place = divmod(k, ring)
            a, b = outer + k, outer + (k + 1) % (6 * ring)
            c = inner + (side * (ring - 1) + place) % max(1, 6 * (ring - 1))
            triangles.append((a, b, c))
            if place < ring - 1:
                triangles.append((b, inner + (side * (ring - 1) + place + 1) % max(1, 6 * (ring - 1)), c))
    return np.array(points), np.array(triangles)
