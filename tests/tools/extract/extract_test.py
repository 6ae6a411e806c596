"""tunica-extract as a user meets it: exit codes, messages, reports, and above all the surfaces it writes, which are
parsed here and compared with the voxels as numpy and nibabel see them."""
import json
import pathlib
import struct
import unittest
import zlib

import nibabel
import numpy
from meshes import Ply
from running import SHARED
from volumes import LPS, ExtractTest, ball, read_stl, read_volume, write_mha, write_nrrd

KEYS = ["vertices", "triangles", "components", "euler", "closed", "manifold", "oriented_outward", "volume_mm3",
        "voxel_volume_mm3", "area_mm2", "diagonal_mm"]


class Formats(ExtractTest):
    AFFINES = {
        "plain": numpy.diag([1.0, 1.0, 1.0, 1.0]),
        "mirrored": numpy.array([[-0.5, 0, 0, 3], [0, 2, 0, -7], [0, 0, 1.5, 11], [0, 0, 0, 1]]),
        "sheared": numpy.array([[1, 0.3, -0.2, 3], [0.1, 2, 0.4, -7], [0, 0.2, 1.5, 1100], [0, 0, 0, 1]]),
        "permuted": numpy.array([[0, 0, 2.0, 5], [-1, 0, 0, 6], [0, -1.5, 0, 7], [0, 0, 0, 1]]),
    }

    def test_nifti_of_every_type_by_nibabel(self):
        mask = ball()
        for name, affine in self.AFFINES.items():
            for kind in ["u1", "i1", "<u2", ">u2", "<i2", ">i4", "<u4", "<f4", ">f4", "<f8", ">i8", "<u8"]:
                for writer in [nibabel.Nifti1Image, nibabel.Nifti2Image]:
                    if name != "sheared" and kind not in ("u1", ">f4"):
                        continue
                    header = writer.header_class(endianness=">" if kind[0] == ">" else "<")
                    header.set_data_dtype(numpy.dtype(kind))
                    image = writer((mask * 3).astype(kind), affine, header)
                    image.header.set_xyzt_units("mm")
                    path = self.folder / "v.nii"
                    image.to_filename(path)
                    affine_read = LPS @ nibabel.load(path).affine
                    self.extract_and_check(path, mask, affine_read, "--label", 3, tag=f"{name} {kind}")

    def test_scaled_labels_are_found_by_their_scaled_values(self):
        mask = ball()
        path = self.nifti((mask * 6).astype(numpy.int16), name="v.nii")
        data = bytearray(path.read_bytes())
        data[112:120] = numpy.array([0.5, 1], "<f4").tobytes()  # scl_slope, scl_inter
        path.write_bytes(data)
        array, affine = read_volume(path)
        self.assertEqual((array.min(), array.max()), (1, 4))
        self.extract_and_check(path, mask, affine, "--label", 4)

    def test_nrrd_and_metaimage(self):
        mask = ball()
        for name, affine in self.AFFINES.items():
            affine = LPS @ affine
            write_nrrd(self.folder / "v.nrrd", (mask * 3).astype(numpy.int16), affine)
            self.extract_and_check(self.folder / "v.nrrd", mask, affine, "--label", 3, tag=name)
            write_nrrd(self.folder / "v.nrrd", (mask * 3).astype(numpy.uint8), affine, encoding="raw")
            self.extract_and_check(self.folder / "v.nrrd", mask, affine, "--label", 3, tag=name)
            write_mha(self.folder / "v.mha", (mask * 3).astype(numpy.int16), affine)
            self.extract_and_check(self.folder / "v.mha", mask, affine, "--label", 3, tag=name)

    def test_units_of_length(self):
        mask = ball()
        for unit, scale in [("meter", 1000.0), ("micron", 0.001)]:
            image = nibabel.Nifti1Image(mask.astype(numpy.uint8), numpy.diag([0.5, 0.25, 2, 1]))
            image.header.set_xyzt_units(unit)
            image.to_filename(self.folder / "v.nii")
            self.extract_and_check(self.folder / "v.nii", mask, LPS @ numpy.diag([0.5 * scale, 0.25 * scale, 2 * scale, 1]),
                                   "--label", 1)

    def test_sform_qform_and_none(self):
        mask = ball()
        image = nibabel.Nifti1Image(mask.astype(numpy.uint8), None)
        image.set_sform(numpy.diag([1.0, 2, 3, 1]), code=2)
        qform = numpy.array([[0, -2.0, 0, 5], [1, 0, 0, 6], [0, 0, 3, 7], [0, 0, 0, 1]])
        image.set_qform(qform, code=1)
        image.header.set_xyzt_units("mm")
        path = self.folder / "v.nii"
        image.to_filename(path)
        self.extract_and_check(path, mask, LPS @ numpy.diag([1.0, 2, 3, 1]), "--label", 1)
        self.run_tool(path, self.out, "--label", 1, says="sform [1 0 0 0] [0 2 0 0] [0 0 3 0] and qform")
        self.extract_and_check(path, mask, LPS @ qform, "--label", 1, "--prefer-qform")
        image.set_sform(numpy.eye(4), code=0)
        image.to_filename(path)
        self.extract_and_check(path, mask, LPS @ qform, "--label", 1)
        image.set_qform(qform, code=0)
        image.to_filename(path)
        self.run_tool(path, self.out, "--label", 1, says="neither sform nor qform")
        self.assertEqual(Ply(self.out).vertices[:, 0].min(), -9 - 2.5)


class Choices(ExtractTest):
    def two_labels(self):
        array = numpy.zeros((20, 12, 12), numpy.uint8)
        array[3:9, 3:9, 3:9] = 1
        array[5:7, 5:7, 5:7] = 0          # a cavity
        array[12:14, 3:5, 3:5] = 1        # a second piece
        array[16:18, 4:8, 4:8] = 7
        return array

    def test_wrong_usage_is_2(self):
        path = self.nifti(self.two_labels())
        for arguments, saying in [
            ([], "pass --label N, --all-labels or --isovalue V; its labels are 1, 7"),
            (["--label", 1, "--isovalue", 2], "contradict"),
            (["--all-labels", "--label", 1], "contradict"),
            (["--inside", "below", "--label", 1], "--isovalue"),
            (["--inside", "left", "--isovalue", 1], "--inside"),
            (["--isovalue", "high"], "not a number"),
            (["--smooth", "2", "--label", 1], "2mm"),
            (["--smooth", "-1mm", "--label", 1], "above 0"),
            (["--smooth", "rough", "--label", 1], "--smooth"),
            (["--space", "xyz", "--label", 1], "--space"),
            (["--all-labels"], "{label}"),
            (["--spacing", "1,1,1", "--label", 1], "--spacing"),
            (["--spacing", "1,1", "--label", 1], "X,Y,Z"),
            (["--frame", "-1", "--label", 1], "--frame"),
            (["--nonsense"], "--nonsense"),
        ]:
            with self.subTest(arguments):
                self.refuse(2, path, self.out, *arguments, saying=saying)
        self.run_tool(path, "--label", 1, code=2)
        self.run_tool(path, self.folder / "out.xyz", "--label", 1, code=2)

    def test_labels_that_are_not_there(self):
        path = self.nifti(self.two_labels())
        self.refuse(3, path, self.out, "--label", 3, saying="has no voxel with label 3; its labels are 1, 7")
        self.refuse(3, path, self.out, "--label", "liver", saying="its labels are 1, 7")
        self.refuse(3, path, self.out, "--isovalue", 9, saying="no voxel is above 9; its values are 0 to 7")
        empty = self.nifti(numpy.zeros((4, 5, 6), numpy.uint8), name="empty.nii")
        self.refuse(3, empty, self.out, "--label", 1, saying="every voxel is 0")
        self.refuse(3, empty, self.out, saying="every voxel is 0")
        grey = self.nifti(numpy.linspace(-1, 1, 4 * 5 * 6).reshape(4, 5, 6).astype(numpy.float32), name="grey.nii")
        self.refuse(2, grey, self.out, saying="grey volume with values from -1 to 1: pass --isovalue V")
        self.refuse(3, grey, self.folder / "{label}.ply", "--all-labels", saying="grey volume")

    def test_existing_output_is_kept(self):
        path = self.nifti(self.two_labels())
        self.out.write_text("precious")
        self.run_tool(path, self.out, "--label", 1, code=5, force=False, says="--force")
        self.assertEqual(self.out.read_text(), "precious")

    def test_one_of_several_frames_has_to_be_chosen(self):
        frames = numpy.stack([self.two_labels(), self.two_labels() * 0, (self.two_labels() == 7) * 5], axis=3)
        path = self.nifti(frames.astype(numpy.uint8))
        self.refuse(3, path, self.out, "--label", 1, saying="has 3 frames: choose one with --frame 0..2")
        self.refuse(3, path, self.out, "--label", 1, "--frame", 3, saying="--frame 3 does not exist")
        self.extract_and_check(path, self.two_labels() == 7, LPS, "--label", 5, "--frame", 2)

    def test_pieces_and_cavities(self):
        array = self.two_labels()
        path = self.nifti(array)
        _, record = self.extract_and_check(path, array == 1, LPS, "--label", 1)
        self.assertEqual((record["result"]["components"], record["result"]["euler"]), (3, 6))
        whole = record["result"]["voxel_volume_mm3"]
        largest = (array == 1) & (numpy.indices(array.shape)[0] < 10)
        filled = largest.copy()
        filled[5:7, 5:7, 5:7] = True
        for flags, mask in [(["--largest"], largest), (["--largest", "--fill-cavities"], filled)]:
            record = self.run_tool(path, self.out, "--label", 1, *flags)
            result = dict(record["result"], voxel_volume_mm3=float(mask.sum()))
            self.check_surface(Ply(self.out), result, mask, LPS)
            self.assertEqual(record["result"]["voxel_volume_mm3"], whole)
            share = 1 - largest.sum() / (array == 1).sum()
            self.assertIn(f"only its largest piece is taken: {100 * share:.3g} % of its voxels", " ".join(record["warnings"]))

    def test_all_labels_are_a_surface_each(self):
        array = self.two_labels()
        path = self.nifti(array)
        record = self.run_tool(path, self.folder / "organ-{label}.ply", "--all-labels")
        self.assertEqual([entry["path"] for entry in record["outputs"]],
                         [str(self.folder / "organ-1.ply"), str(self.folder / "organ-7.ply")])
        for label in (1, 7):
            self.check_surface(Ply(self.folder / f"organ-{label}.ply"), record["result"]["labels"][str(label)],
                               array == label, LPS)
        for key in ("vertices", "triangles", "components", "euler", "area_mm2", "volume_mm3", "voxel_volume_mm3"):
            self.assertAlmostEqual(record["result"][key],
                                   sum(record["result"]["labels"][label][key] for label in ("1", "7")), places=6)
        self.assertIs(record["result"]["closed"], True)
        self.assertIsNone(record["result"]["diagonal_mm"])

    def test_an_open_border_cuts_the_surface_there(self):
        array = numpy.zeros((8, 9, 10), numpy.uint8)
        array[2:6, 2:6, 0:7] = 1
        path = self.nifti(array)
        _, closed = self.extract_and_check(path, array == 1, LPS, "--label", 1)
        self.assertIn("the image's border cuts it (16 voxels)", closed["warnings"][-1])
        record = self.run_tool(path, self.out, "--label", 1, "--open-border")
        self.assertNotIn("border", " ".join(record["warnings"]))
        ply = Ply(self.out)
        self.assertIs(record["result"]["closed"], False)
        self.assertIs(record["result"]["manifold"], True)
        self.assertIs(record["result"]["oriented_outward"], True)
        self.assertIsNone(record["result"]["volume_mm3"])
        self.assertGreater(len(ply.rim()), 0)
        self.assertTrue((ply.vertices[ply.rim(), 2] == -0.5).all())
        array[2:6, 2:6, 0] = 0
        array[2:4, 2, 0] = 1
        record = self.run_tool(self.nifti(array, name="tip.nii"), self.out, "--label", 1, "--open-border", "--force")
        self.assertIn("1 of its 1 opening(s) are only a few voxels wide, at (-2.5, -2.0, -0.5) mm", record["warnings"][-1])
        self.refuse_full_image()

    def test_the_outside_of_a_level_set_is_told(self):
        x = numpy.arange(12) - 5.5
        level = numpy.sqrt(x[:, None, None]**2 + x[:, None]**2 + x**2).astype(numpy.float32) - 4
        path = self.nifti(level)
        record = self.run_tool(path, self.out, "--isovalue", 0)
        self.assertIn("may be the other side (--inside below)", " ".join(record["warnings"]))
        record = self.run_tool(path, self.out, "--isovalue", 0, "--inside", "below", "--force")
        self.assertNotIn("other side", " ".join(record["warnings"]))

    def refuse_full_image(self):
        self.out.unlink()
        path = self.nifti(numpy.ones((3, 4, 5), numpy.uint8), name="full.nii")
        self.refuse(3, path, self.out, "--label", 1, "--open-border", saying="--open-border")
        self.extract_and_check(path, numpy.ones((3, 4, 5), bool), LPS, "--label", 1)

    def test_a_surface_in_ras_is_turned_about_the_axis(self):
        array = self.two_labels()
        path = self.nifti(array, numpy.diag([1.0, 2, 3, 1]))
        self.run_tool(path, self.out, "--label", 1)
        lps = Ply(self.out)
        self.run_tool(path, self.out, "--label", 1, "--space", "ras")
        ras = Ply(self.out)
        self.assertIn("SPACE=LPS", lps.comments)
        self.assertIn("SPACE=RAS", ras.comments)
        self.assertIn("units mm", ras.comments)
        self.assertTrue(numpy.array_equal(lps.vertices * [-1, -1, 1], ras.vertices))
        self.assertTrue(numpy.array_equal(lps.triangles, ras.triangles))
        self.assertGreater(ras.volume(), 0)

    def test_an_isovalue_encloses_what_is_above_or_below(self):
        index = numpy.indices((16, 17, 18)).astype(float)
        distance = numpy.sqrt(((index - 8.1) ** 2).sum(axis=0)) - 5
        path = self.nifti(distance.astype(numpy.float32))
        record = self.run_tool(path, self.out, "--isovalue", 0, "--inside", "below")
        below = Ply(self.out)
        self.assertTrue(below.is_closed_oriented_manifold())
        radius = numpy.linalg.norm(below.vertices * [-1, -1, 1] - 8.1, axis=1)
        self.assertLess(numpy.abs(radius - 5).max(), 0.03)
        self.assertEqual(record["result"]["voxel_volume_mm3"], (distance.astype(numpy.float32) < 0).sum())
        self.assertAlmostEqual(below.volume(), 4 / 3 * numpy.pi * 125, delta=15)
        path = self.nifti((-distance).astype(numpy.float32))
        self.run_tool(path, self.out, "--isovalue", 0)
        self.assertAlmostEqual(Ply(self.out).volume(), below.volume(), places=6)

    def test_voxels_that_are_no_finite_numbers_are_counted_and_warned_of(self):
        index = numpy.indices((16, 17, 18)).astype(float)
        values = (5 - numpy.sqrt(((index - 8.1) ** 2).sum(axis=0))).astype(numpy.float32)
        values[8, 8, 3], values[0, 0, 0], values[1, 1, 1] = numpy.nan, numpy.inf, -numpy.inf
        path = self.nifti(values)
        for selection in (["--isovalue", 0], ["--isovalue", 0, "--slab", 4], ["--isovalue", 0, "--smooth", "1mm"],
                          ["--label", repr(float(values[2, 2, 2]))]):
            record = self.run_tool(path, self.out, *selection, says="3 of 4896 voxels are no finite numbers")
            self.assertEqual(len([w for w in record["result"]["warnings"] if "no finite numbers" in w]), 1)
            self.assertTrue(numpy.isfinite(Ply(self.out).vertices).all())
        self.run_tool(path, "--info", says="3 of 4896 voxels are no finite numbers")

    def test_isovalue_that_equals_samples_gives_no_degenerate_triangle(self):
        index = numpy.indices((12, 12, 12)).astype(numpy.int16)
        distance = numpy.abs(index - 6).sum(axis=0)
        path = self.nifti(distance.astype(numpy.int16))
        for inside in ("below", "above"):
            self.run_tool(path, self.out, "--isovalue", 4, "--inside", inside)
            ply = Ply(self.out)
            self.assertTrue(ply.is_closed_oriented_manifold())
            self.assertGreater(ply.smallest_area(), 1e-9)

    def test_same_bytes_whatever_the_threads(self):
        noise = numpy.random.default_rng(5).random((60, 50, 40)) < 0.3
        path = self.nifti(noise.astype(numpy.uint8))
        for flags in ([], ["--smooth", "1.5mm"], ["--smooth", "staircase"]):
            files = []
            for threads in (1, 2):
                self.run_tool(path, self.out, "--label", 1, "--threads", threads, *flags)
                files.append(self.out.read_bytes())
            self.assertEqual(*files)

    def test_same_bytes_slab_by_slab(self):
        rng = numpy.random.default_rng(8)
        grey = numpy.round(20 * rng.random((19, 21, 23)) + 9 * ball((19, 21, 23), 8)).astype(numpy.int16)
        labels = self.two_labels()
        for path, selection in ((self.nifti(grey, name="grey.nii.gz"), ["--isovalue", 17]),
                                (self.nifti(grey, name="grey.nii.gz"), ["--isovalue", 15, "--largest", "--open-border"]),
                                (self.nifti(labels, name="labels.nii.gz"), ["--label", 7]),
                                (self.nifti(labels, name="labels.nii.gz"), ["--label", 1, "--smooth", "staircase"]),
                                (self.nifti(labels, name="labels.nii.gz"), ["--all-labels", "--fill-cavities"])):
            out = self.folder / "organ-{label}.ply"
            whole = self.run_tool(path, out, *selection)
            written = [pathlib.Path(output["path"]).read_bytes() for output in whole["outputs"]]
            self.assertGreaterEqual(len(written), 1)
            for slices in (1, 3, 1000):
                record = self.run_tool(path, out, *selection, "--slab", slices)
                self.assertEqual([pathlib.Path(output["path"]).read_bytes() for output in record["outputs"]], written)
                self.assertEqual(record["result"], whole["result"])
        self.refuse(2, path, self.out, "--label", 1, "--slab", 0, saying="--slab")

    def test_memory_is_the_output_and_an_eighth_of_the_voxels(self):
        shape = (64, 640, 640)
        organ = numpy.zeros(shape[::-1], numpy.int16)
        organ[200:400, 150:450, 10:50] = 3
        voxels_mib = organ.nbytes / 2 ** 20
        path = self.nifti(organ)
        bits_mib = organ.size / 8 / 2 ** 20
        for selection, input_mib in ((["--label", 3, "--slab", 4], 0), (["--all-labels", "--slab", 4], 0),
                                     (["--isovalue", 1, "--slab", 4], 0), (["--isovalue", 1], voxels_mib)):
            # Of the program, without a volume.
            own_mib = self.run_tool(self.nifti(organ[::40, ::40], name="small.nii.gz"), self.folder / "o-{label}.ply",
                                    *selection)["peak_mib"]
            record = self.run_tool(path, self.folder / "o-{label}.ply", *selection, "--threads", 1)
            # The mesh, and what is measured on it for the report.
            mesh_mib = 4 * (24 * record["result"]["vertices"] + 12 * record["result"]["triangles"]) / 2 ** 20
            self.assertLess(record["peak_mib"], own_mib + input_mib + 2 * bits_mib + mesh_mib + 16, selection)

    def test_an_atlas_of_300_labels_takes_one_pass(self):
        blocks = numpy.arange(343).reshape(7, 7, 7)
        atlas = numpy.kron(numpy.where(blocks < 300, blocks + 1, 0), numpy.ones((20, 20, 20), int)).astype(numpy.uint16)
        path = self.nifti(atlas)
        record = self.run_tool(path, self.folder / "a-{label}.ply", "--all-labels", "--threads", 1)
        self.assertEqual(len(record["result"]["labels"]), 300)
        for label in (1, 57, 300):
            self.run_tool(path, self.out, "--label", label, "--threads", 1)
            self.assertEqual((self.folder / f"a-{label}.ply").read_bytes().partition(b"end_header")[2],
                             self.out.read_bytes().partition(b"end_header")[2])
            self.out.unlink()

    def test_noise_is_a_closed_manifold(self):
        generator = numpy.random.default_rng(7)
        for density in (0.05, 0.3, 0.5, 0.7, 0.95):
            mask = generator.random((24, 25, 26)) < density
            self.extract_and_check(self.nifti(mask.astype(numpy.uint8)), mask, LPS, "--label", 1, tag=str(density))

    def test_gaussian_keeps_the_volume(self):
        mask = ball((40, 41, 42), 12.0)
        path = self.nifti(mask.astype(numpy.uint8))
        record = self.run_tool(path, self.out, "--label", 1, "--smooth", "1.5mm")
        ply = Ply(self.out)
        self.assertTrue(ply.is_closed_oriented_manifold())
        self.assertAlmostEqual(ply.volume(), mask.sum(), delta=1e-3 * mask.sum())
        radius = numpy.linalg.norm(ply.vertices - ply.vertices.mean(axis=0), axis=1)
        self.assertLess(radius.std(), 0.1)
        self.assertIsNotNone(record["seconds"]["smooth"])
        self.assertEqual(record["result"]["voxel_volume_mm3"], mask.sum())
        self.assertNotIn("smoothing", " ".join(record["warnings"]))

    def test_a_gaussian_that_changes_the_shape_is_warned_of(self):
        plate = numpy.zeros((40, 40, 16), numpy.uint8)
        plate[4:36, 4:36, 6:10] = 1
        record = self.run_tool(self.nifti(plate), self.out, "--label", 1, "--smooth", "4mm")
        self.assertIn("smoothing changes the shape", " ".join(record["warnings"]))

    def test_staircase_stays_within_half_a_voxel(self):
        mask = ball((40, 41, 42), 12.0)
        affine = numpy.array([[-0.5, 0, 0, 3], [0, 1, 0, -7], [0, 0, 2, 11], [0, 0, 0, 1.0]])
        path = self.nifti(mask.astype(numpy.uint8), affine)
        self.run_tool(path, self.out, "--label", 1)
        before = Ply(self.out)
        record = self.run_tool(path, self.out, "--label", 1, "--smooth", "staircase")
        ply = Ply(self.out)
        self.assertTrue(ply.is_closed_oriented_manifold())
        self.assertTrue(numpy.array_equal(ply.triangles, before.triangles))
        moved = numpy.abs(ply.vertices - before.vertices) / [0.5, 1, 2]
        self.assertLess(moved.max(), 0.5)
        self.assertGreater(moved.max(), 0.1)
        self.assertAlmostEqual(ply.volume(), before.volume(), delta=1e-3 * before.volume())
        self.assertLess(ply.area(), 0.95 * before.area())
        self.assertIsNotNone(record["seconds"]["smooth"])

    def test_report_and_provenance(self):
        path = self.nifti(self.two_labels())
        record = self.run_tool(path, self.out, "--label", 1)
        self.assertEqual([key for key in KEYS if key not in record["result"]], [])
        self.assertEqual([key for key in ("total", "read", "smooth", "extract", "write") if key not in record["seconds"]],
                         [])
        self.assertEqual(record["inputs"][0]["path"], str(path))
        self.assertEqual([entry["path"] for entry in record["outputs"]], [str(self.out)])
        comments = Ply(self.out).comments
        self.assertIn("source v.nii.gz", comments)
        self.assertIn("label 1", comments)
        self.assertTrue(any(comment.startswith("tunica-extract ") for comment in comments))

    def test_info_says_what_the_volume_holds(self):
        path = self.nifti(self.two_labels(), numpy.array([[-1.5, 0, 0, 0], [0, 2, 0, 0], [0, 0, 3.0, 0], [0, 0, 0, 1]]))
        record = self.run_tool(path, "--info")
        for text in ("20 x 12 x 12", "1.5 x 2 x 3 mm", "LAS", "from sform", "216 voxels", "1944.0 mm3", "288.0 mm3"):
            self.assertIn(text, self.done.stdout)
        self.assertEqual([label["label"] for label in record["result"]["labels"]], [1, 7])
        self.assertEqual(record["result"]["dims"], [20, 12, 12])
        self.assertEqual(list(self.folder.glob("*.ply")), [])

    def test_segments_are_found_by_their_names(self):
        segments = "Segment0_LabelValue:=1\nSegment0_Name:=aorta\nSegment1_LabelValue:=7\nSegment1_Name:=left atrium\n"
        write_nrrd(self.folder / "v.seg.nrrd", self.two_labels(), numpy.eye(4), segments)
        self.run_tool(self.folder / "v.seg.nrrd", "--info")
        self.assertIn("left atrium", self.done.stdout)
        self.extract_and_check(self.folder / "v.seg.nrrd", self.two_labels() == 7, numpy.eye(4), "--label", "left atrium")
        self.out.unlink()
        self.refuse(3, self.folder / "v.seg.nrrd", self.out, "--label", 3, saying="1 (aorta), 7 (left atrium)")


class Damage(ExtractTest):
    def test_what_is_no_volume(self):
        self.refuse(3, self.folder / "missing.nii", self.out, "--label", 1, saying="no such file")
        (self.folder / "empty.nii").write_bytes(b"")
        self.refuse(3, self.folder / "empty.nii", self.out, "--label", 1, saying="is empty")
        (self.folder / "mesh.nii").write_bytes(b"ply\nformat ascii 1.0\n")
        self.refuse(3, self.folder / "mesh.nii", self.out, "--label", 1, saying="surface mesh")
        self.refuse(3, self.folder, self.out, "--label", 1, "--spacing", "1,1,1", saying="no .png")

    def test_truncated_files_are_named(self):
        noise = (numpy.random.default_rng(3).random((30, 30, 30)) * 255).astype(numpy.uint8)
        for name in ("v.nii", "v.nii.gz"):
            whole = self.nifti(noise, name=name).read_bytes()
            for fraction in (0.001, 0.1, 0.5, 0.9, 0.999):
                (self.folder / name).write_bytes(whole[:int(len(whole) * fraction)])
                self.refuse(3, self.folder / name, self.out, "--label", 1, saying=f"{name}: ")
        path = self.nifti(noise, name="v.nii")
        path.write_bytes(path.read_bytes()[:-1000])
        self.refuse(3, path, self.out, "--label", 1, saying="1000 of the 27000 bytes")

    def test_a_header_that_claims_a_terabyte_takes_no_memory(self):
        image = nibabel.Nifti2Image(numpy.zeros((2, 2, 2), numpy.uint8), numpy.eye(4))
        path = self.folder / "v.nii"
        image.to_filename(path)
        data = bytearray(path.read_bytes())
        data[24:48] = numpy.array([10000, 10000, 10000], "<i8").tobytes()
        path.write_bytes(data)
        record = self.run_tool(path, self.out, "--label", 1, code=3, says="truncated")
        self.assertLess(record["peak_mib"], 200)

    def test_a_damaged_strip_is_no_black_one(self):
        noise = (numpy.random.default_rng(5).random((40, 50)) > 0.5).astype(numpy.uint8).tobytes()
        for damaged in (True, False):
            packed = bytearray(zlib.compress(noise))
            if damaged:
                packed[2] |= 6  # a block of the kind that deflate reserves
            path = self.folder / "v.tif"
            path.write_bytes(deflated_tiff(50, 40, bytes(packed), pages=3))
            words = (path, self.out, "--label", 1, "--spacing", "1,1,1")
            if damaged:
                self.refuse(3, *words, saying="strip 0 is truncated or corrupt; get the file again")
            else:
                self.run_tool(*words)


def deflated_tiff(width, height, packed, pages):
    """Pages of bytes that are one strip each, the same one."""
    data = b"II*\0" + struct.pack("<I", 8 + len(packed)) + packed
    for page in range(pages):
        tags = [(256, width), (257, height), (258, 8), (259, 8), (262, 1), (273, 8), (277, 1), (278, height),
                (279, len(packed))]
        directory = struct.pack("<H", len(tags)) + b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags)
        following = len(data) + len(directory) + 4 if page + 1 < pages else 0
        data += directory + struct.pack("<I", following)
    return data


@unittest.skipUnless((SHARED / "volumes").is_dir(), f"the shared volumes are absent ({SHARED})")
class SharedVolumes(ExtractTest):
    """The real volumes by the facts that were found out about them independently."""

    @classmethod
    def setUpClass(cls):
        cls.facts = json.loads((SHARED / "facts.json").read_text())

    def check_volume(self, name, labels=None, *flags, layer=None):
        path = SHARED / "volumes" / name
        array, affine = read_volume(path, layer)
        facts = self.facts[f"volumes/{name}"]["labels"]
        for label, fact in facts.items():
            if not label.isdigit() or (labels is not None and int(label) not in labels):
                continue
            mask = array == int(label)
            self.assertEqual(mask.sum(), fact["voxels"])
            ply, record = self.extract_and_check(path, mask, affine, "--label", label, *flags, tag=f"{name} {label}")
            result = record["result"]
            self.assertAlmostEqual(result["voxel_volume_mm3"], fact["volume_mm3"], delta=1e-4 * fact["volume_mm3"])
            self.assertEqual(ply.components(), fact["n6"] + fact["cavities_bg26"] if fact["ambiguous_faces"] == 0
                             else ply.components())
            if fact["ambiguous_faces"] == 0 and fact["ambiguous_corners"] == 0:
                self.assertEqual(ply.euler(), 2 * fact["chi26"], f"{name} {label}")
            self.assertGreaterEqual(ply.components(), fact["n26"], f"{name} {label}")

    def test_aorta_dissection(self):
        self.check_volume("ts_aorta_dissection.nii.gz")

    def test_abdomen(self):
        # A voxel, an organ, several pieces, voxels that meet along edges and at corners, few and many of them.
        self.check_volume("ts_abdomen_multilabel.nii.gz", {5, 7, 8, 13, 18, 20, 101, 114, 117})

    def test_torso(self):
        self.check_volume("nv_torso_5mm.nii.gz", {4, 11})

    def test_oblique_lesion(self):
        self.check_volume("nv_lesion_oblique.nii.gz")

    def test_thorax_segmentation(self):
        self.check_volume("sio_thorax_10mm.seg.nrrd", {1, 5})

    def test_overlapping_segments(self):
        path = SHARED / "volumes" / "sio_thorax_overlapping_4d.seg.nrrd"
        self.refuse(3, path, self.out, "--label", 1, saying="pass --label NAME, or --layer too")
        for layer in (0, 1):
            array, affine = read_volume(path, layer)
            for label in numpy.unique(array)[1:3]:
                self.extract_and_check(path, array == label, affine, "--label", label, "--layer", layer)

    def test_threshold_mask_full_of_noise(self):
        self.check_volume("vmtk_aorta_threshold.mha")

    def test_empty(self):
        path = SHARED / "volumes" / "ts_empty_iliac.nii.gz"
        self.refuse(3, path, self.out, "--label", 1, saying="every voxel is 0")
        self.refuse(3, path, self.out, "--isovalue", 0.5, saying="no voxel is above 0.5")

    def test_bone_by_isovalue(self):
        path = SHARED / "volumes" / "nvd_ct_pitch_oblique.nii.gz"
        array, affine = read_volume(path)
        record = self.run_tool(path, self.out, "--isovalue", 200)
        ply = Ply(self.out)
        self.assertTrue(ply.is_closed_oriented_manifold())
        self.assertEqual(record["result"]["voxel_volume_mm3"] / abs(numpy.linalg.det(affine[:3, :3])) // 1,
                         (array > 200).sum())
        self.assertAlmostEqual(record["result"]["volume_mm3"], ply.volume(), delta=1e-6 * ply.volume())
        self.assertGreater(ply.smallest_area(), 0)
        self.refuse_grey(path)

    def refuse_grey(self, path):
        self.out.unlink()
        self.refuse(2, path, self.out, saying="pass --isovalue V")

    def test_gold_surface(self):
        path = SHARED / "volumes" / "vmtk_aorta_levelset.mha"
        record = self.run_tool(path, self.out, "--isovalue", 0, "--inside", "below")
        ply = Ply(self.out)
        gold = read_stl(SHARED / "meshes" / "vmtk_aorta_gold.stl").reshape(-1, 3) * [-1, -1, 1]
        gold = numpy.unique(gold, axis=0)
        self.assertEqual((len(ply.vertices), len(ply.triangles)), (6468, 12932))
        self.assertEqual(len(gold), 6468)
        self.assertTrue(ply.is_closed_oriented_manifold())
        self.assertEqual((ply.euler(), ply.components()), (2, 1))
        self.assertAlmostEqual(ply.volume(), 13184.2667, delta=0.001 * 13184)  # cells may be cut by other diagonals
        # Both ways, nearest vertex: sort by a coarse grid of x would do; the sets are small enough for blocks.
        for a, b in ((ply.vertices, gold), (gold, ply.vertices)):
            worst = max(numpy.sqrt(((block[:, None, :] - b[None, :, :]) ** 2).sum(axis=2)).min(axis=1).max()
                        for block in numpy.array_split(a, 40))
            self.assertLess(worst, 2e-5)
        self.assertAlmostEqual(record["result"]["voxel_volume_mm3"], 13430.3, delta=0.1)
        self.out.unlink()
        self.refuse(2, path, self.out, saying="--inside below")


if __name__ == "__main__":
    unittest.main()
