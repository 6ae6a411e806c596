"""Volumes and surfaces read and written without tunica: nibabel for NIfTI, by hand for the rest; surfaces against voxels."""
import gzip
import pathlib
import zlib

import nibabel
import numpy
from meshes import Ply
from running import ToolTest

LPS = numpy.diag([-1.0, -1.0, 1.0, 1.0])  # RAS to LPS and back


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


def ball(shape=(14, 15, 16), radius=5.0):
    index = numpy.indices(shape).astype(float)
    centre = (numpy.array(shape) - 1).reshape(3, 1, 1, 1) / 2
    return ((index - centre) ** 2).sum(axis=0) < radius ** 2


class ExtractTest(ToolTest):
    verb = "extract"

    def setUp(self):
        super().setUp()
        self.out = self.folder / "out.ply"

    def run_tool(self, *words, force=True, **options):
        report = super().run_tool(*words, *(["--force"] if force else []), **options)
        self.assertEqual(list(self.folder.glob("*.part")), [])
        return report

    def voxels(self, *words):
        """@return the volume of the voxels taken"""
        return self.run_tool(*words)["result"]["voxel_volume_mm3"]

    def refuse(self, code, *arguments, saying):
        self.run_tool(*arguments, code=code, says=saying)
        self.assertFalse(self.out.exists())

    def nifti(self, array, affine=None, name="v.nii.gz"):
        path = self.folder / name
        nibabel.save(nibabel.Nifti1Image(array, numpy.eye(4) if affine is None else affine), path)
        return path

    def check_surface(self, ply, result, mask, affine, tag=""):
        """A written surface against the mask it came from: exact vertices, closed, oriented outward, the report true."""
        self.assertEqual(ply.fields.dtype.names, ("x", "y", "z"), tag)
        self.assertTrue(ply.is_closed_oriented_manifold(), tag)
        index = (numpy.linalg.inv(affine) @ numpy.c_[ply.vertices, numpy.ones(len(ply.vertices))].T).T[:, :3]
        doubled = numpy.round(2 * index)
        self.assertLess(numpy.abs(2 * index - doubled).max(), 1e-3, tag)
        self.assertTrue(numpy.array_equal(numpy.unique(doubled.astype(int), axis=0), expected_vertices(mask)), tag)
        world = (affine @ numpy.c_[expected_vertices(mask) / 2, numpy.ones(len(expected_vertices(mask)))].T).T[:, :3]
        scale = numpy.abs(world).max()
        self.assertLess(numpy.abs(ply.vertices.min(axis=0) - world.min(axis=0)).max(), 1e-6 * scale, tag)
        self.assertLess(numpy.abs(ply.vertices.max(axis=0) - world.max(axis=0)).max(), 1e-6 * scale, tag)
        self.assertGreater(ply.smallest_area(), 0, tag)
        voxel = abs(numpy.linalg.det(affine[:3, :3]))
        self.assertAlmostEqual(result["voxel_volume_mm3"], mask.sum() * voxel, delta=1e-6 * mask.sum() * voxel)
        self.assertEqual(result["vertices"], len(ply.vertices))
        self.assertEqual(result["triangles"], len(ply.triangles))
        self.assertEqual(result["euler"], ply.euler(), tag)
        self.assertEqual(result["components"], ply.components(), tag)
        self.assertIs(result["closed"], True)
        self.assertIs(result["manifold"], True)
        self.assertIs(result["oriented_outward"], True)
        self.assertGreater(ply.volume(), 0, tag)
        self.assertAlmostEqual(result["volume_mm3"], ply.volume(), delta=1e-6 * ply.volume())
        self.assertAlmostEqual(result["area_mm2"], ply.area(), delta=1e-6 * ply.area())
        box = ply.vertices.max(axis=0) - ply.vertices.min(axis=0)
        self.assertAlmostEqual(result["diagonal_mm"], numpy.linalg.norm(box), delta=1e-6)

    def extract_and_check(self, path, mask, affine, *arguments, tag=""):
        record = self.run_tool(path, self.out, *arguments)
        ply = Ply(self.out)
        self.check_surface(ply, record["result"], mask, affine, tag)
        return ply, record
