"""Volumes and surfaces read and written without tunica: nibabel for NIfTI, by hand for the rest."""
import gzip
import pathlib
import zlib

import nibabel
import numpy

LPS = numpy.diag([-1.0, -1.0, 1.0, 1.0])  # RAS to LPS and back


class Ply:
    """The binary PLY of the contract, parsed by its header: vertices (n, 3) double, triangles (m, 3) int."""

    def __init__(self, path):
        data = pathlib.Path(path).read_bytes()
        end = data.index(b"end_header\n") + len(b"end_header\n")
        lines = data[:end].decode().splitlines()
        assert lines[:2] == ["ply", "format binary_little_endian 1.0"], lines[:2]
        self.comments = [line[len("comment "):] for line in lines if line.startswith("comment ")]
        vertices = int(next(line for line in lines if line.startswith("element vertex")).split()[2])
        faces = int(next(line for line in lines if line.startswith("element face")).split()[2])
        properties = [line.split()[1:] for line in lines if line.startswith("property")]
        assert properties[:3] == [["double", "x"], ["double", "y"], ["double", "z"]], properties
        assert properties[3][0] == "list" and properties[3][1] == "uchar" and properties[3][2] in ("int", "uint")
        assert len(properties) == 4
        self.vertices = numpy.frombuffer(data, "<f8", 3 * vertices, end).reshape(-1, 3)
        faces = numpy.frombuffer(data, [("n", "u1"), ("v", "<i4", 3)], faces, end + 24 * vertices)
        assert (faces["n"] == 3).all()
        assert len(data) == end + 24 * vertices + 13 * len(faces)
        self.triangles = faces["v"].astype(numpy.int64)

    def edges(self):
        t = self.triangles
        return numpy.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])

    def is_closed_oriented_manifold(self):
        """Every directed edge once, and its reverse once; the triangles around each vertex are one fan."""
        edges = self.edges()
        n = len(self.vertices)
        codes = edges[:, 0] * n + edges[:, 1]
        reverse = edges[:, 1] * n + edges[:, 0]
        unique = numpy.unique(codes)
        if len(unique) != len(codes) or not numpy.array_equal(unique, numpy.unique(reverse)):
            return False
        # Corners of triangles, joined across edges, form one class per vertex.
        corners = numpy.arange(3 * len(self.triangles))
        at = self.triangles.reshape(-1)
        order = numpy.argsort(codes)
        m = len(self.triangles)
        partner = order[numpy.searchsorted(codes[order], reverse)]
        triangle, side = numpy.arange(3 * m) % m, numpy.arange(3 * m) // m
        start = 3 * triangle + side
        # Edge e runs from corner `side` to the next; its partner's end is at the same vertex.
        other = 3 * (partner % m) + (partner // m + 1) % 3
        assert (at[start] == at[other]).all()
        return count_classes(3 * m, start, other) == len(numpy.unique(at)) and corners.size == 3 * m

    def euler(self):
        return len(numpy.unique(self.triangles)) - len(self.edges()) // 2 + len(self.triangles)

    def components(self):
        edges = self.edges()
        return count_classes(len(self.vertices), edges[:, 0], edges[:, 1]) - (
            len(self.vertices) - len(numpy.unique(self.triangles)))

    def corners(self):
        return (self.vertices[self.triangles[:, i]] for i in range(3))

    def volume(self):
        origin = self.vertices.mean(axis=0)
        a, b, c = (corner - origin for corner in self.corners())
        return numpy.einsum("ij,ij->", a, numpy.cross(b, c)) / 6

    def smallest_area(self):
        a, b, c = self.corners()
        return numpy.linalg.norm(numpy.cross(b - a, c - a), axis=1).min() / 2

    def area(self):
        a, b, c = self.corners()
        return numpy.linalg.norm(numpy.cross(b - a, c - a), axis=1).sum() / 2


def count_classes(size, a, b):
    """Connected components of a graph, by label propagation with pointer jumping."""
    label = numpy.arange(size)
    while True:
        low = numpy.minimum(label[a], label[b])
        numpy.minimum.at(label, label[a], low)
        numpy.minimum.at(label, label[b], low)
        while not numpy.array_equal(label, label[label]):
            label = label[label]
        if numpy.array_equal(label[a], label[b]):
            return len(numpy.unique(label))


def expected_vertices(mask):
    """Twice the index coordinates of marching cubes' vertices: half-way between an inside and an outside voxel."""
    padded = numpy.pad(mask, 1).astype(numpy.int8)
    points = []
    for axis in range(3):
        cut = numpy.argwhere(numpy.diff(padded, axis=axis) != 0)
        doubled = 2 * (cut - 1)
        doubled[:, axis] += 1
        points.append(doubled)
    return numpy.unique(numpy.concatenate(points), axis=0)


def read_volume(path, layer=None):
    """Array indexed [i, j, k] and affine to LPS."""
    name = str(path)
    if name.endswith((".nii", ".nii.gz")):
        image = nibabel.load(name)
        return numpy.asanyarray(image.dataobj), LPS @ image.affine
    data = pathlib.Path(name).read_bytes()
    if name.endswith(".nrrd"):
        end = data.index(b"\n\n") + 2
        fields = dict(line.split(": ", 1) for line in data[:end].decode().splitlines() if ": " in line and ":=" not in line)
        sizes = [int(word) for word in fields["sizes"].split()]
        directions = [word for word in fields["space directions"].split() if word != "none"]
        assert fields["space"] == "left-posterior-superior" and fields["encoding"] == "gzip"
        affine = numpy.eye(4)
        for axis, word in enumerate(directions):
            affine[:3, axis] = [float(x) for x in word.strip("()").split(",")]
        affine[:3, 3] = [float(x) for x in fields["space origin"].strip("()").split(",")]
        array = numpy.frombuffer(gzip.decompress(data[end:]), numpy.uint8).reshape(sizes, order="F")
        return (array if layer is None else array[layer]), affine
    end = data.index(b"ElementDataFile = LOCAL\n") + len(b"ElementDataFile = LOCAL\n")
    fields = dict(line.split(" = ", 1) for line in data[:end].decode().splitlines())
    sizes = [int(word) for word in fields["DimSize"].split()]
    kind = {"MET_FLOAT": "<f4", "MET_SHORT": "<i2"}[fields["ElementType"]]
    affine = numpy.eye(4)
    matrix = numpy.array([float(x) for x in fields["TransformMatrix"].split()]).reshape(3, 3).T
    affine[:3, :3] = matrix * [float(x) for x in fields["ElementSpacing"].split()]
    affine[:3, 3] = [float(x) for x in fields["Offset"].split()]
    return numpy.frombuffer(zlib.decompress(data[end:]), kind).reshape(sizes, order="F"), affine


def read_stl(path):
    """Corners of the triangles of a binary STL, (n, 3, 3)."""
    data = pathlib.Path(path).read_bytes()
    record = numpy.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    return numpy.frombuffer(data, record, offset=84)["corners"].astype(float)


def write_nrrd(path, array, affine, extra="", encoding="gzip"):
    data = array.tobytes(order="F")
    vectors = " ".join("({},{},{})".format(*map(repr, map(float, affine[:3, axis]))) for axis in range(3))
    header = (f"NRRD0004\ntype: {array.dtype.name}\ndimension: 3\nspace: left-posterior-superior\n"
              f"sizes: {' '.join(map(str, array.shape))}\nspace directions: {vectors}\nkinds: domain domain domain\n"
              f"endian: little\nencoding: {encoding}\nspace origin: ({','.join(repr(float(x)) for x in affine[:3, 3])})\n"
              f"{extra}\n")
    pathlib.Path(path).write_bytes(header.encode() + (gzip.compress(data) if encoding == "gzip" else data))


def write_mha(path, array, affine):
    spacing = numpy.linalg.norm(affine[:3, :3], axis=0)
    words = lambda values: " ".join(repr(float(v)) for v in values)
    kind = {"uint8": "MET_UCHAR", "int16": "MET_SHORT", "float32": "MET_FLOAT", "float64": "MET_DOUBLE"}[array.dtype.name]
    packed = zlib.compress(array.tobytes(order="F"))
    header = (f"ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = True\n"
              f"CompressedDataSize = {len(packed)}\nTransformMatrix = {words((affine[:3, :3] / spacing).T.reshape(-1))}\n"
              f"Offset = {words(affine[:3, 3])}\nElementSpacing = {words(spacing)}\n"
              f"DimSize = {' '.join(map(str, array.shape))}\nElementType = {kind}\nElementDataFile = LOCAL\n")
    pathlib.Path(path).write_bytes(header.encode() + packed)
