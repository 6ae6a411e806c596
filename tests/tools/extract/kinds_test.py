"""tunica-extract: volumes of the kinds that other programs write, which were read wrong without a word."""
import gzip
import struct
import unittest

import nibabel
import numpy
from volumes import ExtractTest, ball


def box(shape, first, last):
    array = numpy.zeros(shape, numpy.uint8)
    array[tuple(slice(a, b) for a, b in zip(first, last))] = 1
    return array


class Segments(ExtractTest):
    """Of 3D Slicer before 4.11: a layer per segment, and neither SegmentN_Layer nor SegmentN_LabelValue."""

    def setUp(self):
        super().setUp()
        self.organs = [box((9, 8, 7), (1, 1, 1), (3 + i, 4, 5)) for i in range(3)]
        self.names = ["bladder", "prostate", "rectum"]
        self.file = self.segmentation(numpy.stack(self.organs), self.names, "none (1,0,0) (0,1,0) (0,0,2)", "list ")

    def segmentation(self, array, names, directions, kinds, name="old.seg.nrrd"):
        keys = "".join(f"Segment{i}_ID:=Segment_{i + 1}\nSegment{i}_Name:={n}\n" for i, n in enumerate(names))
        header = (f"NRRD0004\ntype: unsigned char\ndimension: {array.ndim}\nspace: left-posterior-superior\n"
                  f"sizes: {' '.join(map(str, array.shape))}\nspace directions: {directions}\n"
                  f"kinds: {kinds}domain domain domain\nencoding: gzip\nspace origin: (5,6,7)\n{keys}\n")
        path = self.folder / name
        path.write_bytes(header.encode() + gzip.compress(array.tobytes(order="F")))
        return path

    def test_their_layer_follows_from_the_name(self):
        for organ, name in zip(self.organs, self.names):
            self.assertEqual(self.voxels(self.file, self.out, "--label", name), 2 * organ.sum(), name)
        self.assertEqual(self.voxels(self.file, self.out, "--label", "rectum", "--layer", "2"),
                         2 * self.organs[2].sum())
        self.assertEqual(self.voxels(self.file, self.out, "--label", "1", "--layer", "1"), 2 * self.organs[1].sum())

    def test_of_another_layer_are_refused(self):
        self.out.unlink(missing_ok=True)
        self.refuse(3, self.file, self.out, "--label", "rectum", "--layer", "0",
                    saying=["--layer 0 does not hold the segment 'rectum'", "in layer 2"])
        self.refuse(3, self.file, self.out, "--label", "1",
                    saying=["segments in several layers", "bladder (label 1 of layer 0)", "rectum (label 1 of layer 2)"])
        self.refuse(3, self.file, self.out, "--label", "rectm", saying="its segments are bladder")
        self.refuse(3, self.file, "--info", saying="or a segment by --label NAME: bladder")

    def test_in_a_file_of_three_dimensions(self):
        one = self.segmentation(self.organs[1], ["prostate"], "(1,0,0) (0,1,0) (0,0,2)", "", "one.seg.nrrd")
        self.assertEqual(self.voxels(one, self.out, "--label", "prostate"), 2 * self.organs[1].sum())
        two = self.segmentation(self.organs[1], ["prostate", "seed"], "(1,0,0) (0,1,0) (0,0,2)", "", "two.seg.nrrd")
        self.voxels(two, self.out, "--label", "seed")
        self.assertIn("the label 1 is called 'prostate' and 'seed'", self.done.stderr)

    def test_names_of_one_value_in_a_table_are_told(self):
        volume = self.nifti(ball().astype(numpy.uint8), name="scan.nii.gz")
        (self.folder / "scan.tsv").write_text("index\tname\n1\taorta\n1\ttrachea\n")
        for arguments in ([self.out, "--label", "aorta"], [self.out, "--label", "1"], ["--info"]):
            self.run_tool(volume, *arguments, says="scan.tsv: the label 1 is called 'aorta' and 'trachea'")
        self.assertIn("aorta / trachea", self.done.stdout)


class WholeNumbers(ExtractTest):
    def labels(self):
        labels = ball() * 3.0
        labels[6:8, 6:8, 6:8] = 6
        labels[1, 1, 1] = 9
        return labels

    def scaled(self, dtype):
        """As nibabel saves labels of floats under a header of integers."""
        header = nibabel.Nifti1Header()
        header.set_data_dtype(dtype)
        image = nibabel.Nifti1Image(self.labels(), numpy.eye(4), header)
        image.set_data_dtype(dtype)
        path = self.folder / f"{numpy.dtype(dtype).name}.nii.gz"
        image.to_filename(path)
        self.assertNotEqual(nibabel.load(path).dataobj.slope, 1)
        return path

    def check(self, path):
        labels = self.labels()
        for value in (3, 6, 9):
            volume = self.voxels(path, self.out, "--label", value)
            self.assertEqual(volume, (labels == value).sum())
            self.assertIn("not quite whole numbers", " ".join(self.done.report["notes"]))
            self.assertNotIn("warning: " + str(path), self.done.stderr)
        record = self.run_tool(path, "--info")
        self.assertEqual([label["label"] for label in record["result"]["labels"]], [3, 6, 9])
        record = self.run_tool(path, self.folder / "{label}.ply", "--all-labels")
        self.assertEqual(record["result"]["labels"]["6"]["voxel_volume_mm3"], 8)

    def test_scaled_by_nibabel(self):
        self.check(self.scaled(numpy.int16))
        self.check(self.scaled(numpy.uint8))

    def test_rounded_by_a_resampling(self):
        labels = self.labels()
        labels[labels == 3] = 3.0000457763671875
        labels[labels == 6] = 5.999999998603016
        self.check(self.nifti(labels))

    def test_a_mask_by_a_slope(self):
        mask = ball()
        path = self.nifti(numpy.where(mask, 255, 0).astype(numpy.uint8), name="mask.nii")
        raw = bytearray(path.read_bytes())
        raw[112:120] = struct.pack("<ff", 1 / 255, 0)
        path.write_bytes(raw)
        self.assertEqual(self.voxels(path, self.out, "--label", 1), mask.sum())

    def test_between_them_are_refused(self):
        def halfway(value):
            array = ball() * value
            return 0.5 * (array + numpy.roll(array, 1, axis=0))
        for array, isovalue in ((halfway(1.0).astype(numpy.float32), "--isovalue 0.5"), (halfway(5.0), "--isovalue 2.5")):
            share = (array == array.max() / 2).sum() / (array != 0).sum()
            path = self.nifti(array)
            self.out.unlink(missing_ok=True)
            label = int(array.max())
            saying = [f"{100 * share:.3g} % of its voxels that are not 0", f"such as {label / 2:g}", "interpolation"]
            self.refuse(3, path, self.out, "--label", label, saying=[*saying, isovalue])
            self.refuse(3, path, self.folder / "{label}.ply", "--all-labels", saying=saying)
            self.run_tool(path, "--info")
            self.assertIn(f"a grey volume: {saying[0]}", self.done.stdout)
            self.run_tool(path, self.out, *isovalue.split())

    def test_probabilities_from_0_to_255_are_doubted(self):
        """Labels that touch, as many and as thin as they may be, are not."""
        places = numpy.stack(numpy.meshgrid(*3 * [numpy.arange(40) - 20], indexing="ij"))
        radius = numpy.sqrt((places ** 2).sum(axis=0))
        blurred = numpy.clip(255 * (14 - radius) / 5, 0, 255).astype(numpy.uint8)
        parcels = numpy.where(radius < 18, 1 + (places // 8 + 3).transpose(1, 2, 3, 0) @ [1, 6, 36], 0).astype(numpy.uint8)
        for array, label, doubted in ((blurred, 255, True), (parcels, int(parcels[20, 20, 20]), False)):
            report = self.run_tool(self.nifti(array), self.out, "--label", label, "--force")
            self.assertEqual("looks like a grey volume" in " ".join(report["warnings"]), doubted, label)

    def test_beyond_doubles_are_refused(self):
        for label in (2 ** 53 + 1, 2 ** 63 - 1):
            path = self.folder / "v.nii.gz"
            nibabel.save(nibabel.Nifti1Image(ball() * numpy.int64(label), numpy.eye(4), dtype=numpy.int64), path)
            self.refuse(3, path, self.out, "--label", label, saying="become the same number")
            self.refuse(3, path, self.folder / "{label}.ply", "--all-labels", saying=["v.nii.gz", "become the same number"])

    def test_of_floats_beyond_2_to_53_are_no_labels(self):
        for kind, label in ((numpy.float64, 2.0 ** 53 + 2), (numpy.float32, 1e17)):
            path = self.nifti((ball() * label).astype(kind))
            self.refuse(3, path, self.folder / "{label}.ply", "--all-labels", saying=["is a grey volume"])
            self.run_tool(path, "--info")
            self.assertIn("a grey volume", self.done.stdout)
        self.run_tool(self.nifti(ball() * 2.0 ** 53), self.folder / "{label}.ply", "--all-labels")


class Headers(ExtractTest):
    def test_an_sform_of_zeros_gives_way_to_the_qform(self):
        mask = ball()
        image = nibabel.Nifti1Image(mask.astype(numpy.uint8), numpy.diag([-0.8, 0.7, 1.5, 1]))
        image.set_qform(image.affine, 1)
        image.set_sform(image.affine, 1)
        path = self.folder / "v.nii"
        image.to_filename(path)
        good = self.voxels(path, self.out, "--label", 1)
        surface = self.out.read_bytes().split(b"end_header")[1]
        raw = bytearray(path.read_bytes())
        raw[280:328] = bytes(48)
        path.write_bytes(raw)
        volume = self.voxels(path, self.out, "--label", 1)
        self.assertEqual(volume, good)
        self.assertEqual(self.out.read_bytes().split(b"end_header")[1], surface)
        self.assertIn("its sform is all zero: the qform is used instead", self.done.stderr)
        raw[252:254] = bytes(2)
        path.write_bytes(raw)
        self.out.unlink()
        self.refuse(3, path, self.out, "--label", 1, saying=["its sform is all zero", "its qform is not set"])

    def test_channels_before_space(self):
        mask = ball()
        first = self.nifti(mask.astype(numpy.uint8)[None], numpy.diag([0.5, 0.6, 0.7, 1]))
        volume = self.voxels(first, self.out, "--label", 1)
        self.assertAlmostEqual(volume, mask.sum() * 0.21, delta=1e-4)
        self.assertIn("the leading 1 is taken as a channel", " ".join(self.done.report["notes"]))
        self.out.unlink()
        one_hot = self.nifti(numpy.stack([~mask, mask]).astype(numpy.uint8))
        self.refuse(3, one_hot, self.out, "--label", 1, saying=["looks like 2 channels", "argmax"])

    def test_thick_slices_are_named(self):
        self.voxels(self.nifti(ball().astype(numpy.uint8), numpy.diag([0.7, 0.7, 5, 1])), self.out, "--label", 1)
        self.assertIn("0.7 x 0.7 x 5 mm", self.done.stderr)
        self.assertIn("half a slice, 2.5 mm", self.done.stderr)
        self.assertEqual(len(self.done.report["warnings"]), 1)

    def test_an_unnamed_unit_is_a_note(self):
        image = nibabel.Nifti1Image(ball().astype(numpy.uint8), numpy.eye(4))
        image.header.set_xyzt_units(0)
        image.to_filename(self.folder / "v.nii.gz")
        self.voxels(self.folder / "v.nii.gz", self.out, "--label", 1)
        self.assertIn("xyzt_units", " ".join(self.done.report["notes"]))
        self.assertEqual(self.done.report["warnings"], [])
        self.assertNotIn("warning", self.done.stderr)


if __name__ == "__main__":
    unittest.main()
