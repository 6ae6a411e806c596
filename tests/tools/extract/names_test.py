"""tunica-extract: labels by the names that the volume or a table gives them."""
import pathlib
import unittest

import nibabel
import numpy
from volumes import ExtractTest, ball

BIDS = "index\tname\n1\taorta\n7\tleft atrium\n"
ITK_SNAP = '# ITK-SnAP Label Description File\n1 255 0 0 1 1 1 "aorta"\n7 0 255 0 1 1 1 "left atrium"\n'
SLICER = "# Color table file\n0 Background 0 0 0 0\n1 aorta 128 174 128 255\n7 left atrium 241 214 145 255\n"


def label_table(labels):
    """As TotalSegmentator writes the names into a multi-label file."""
    entries = "".join(f'<Label Key="{value}" Red="0.1" Green="0.2" Blue="0.3" Alpha="1"><![CDATA[{name}]]></Label>'
                      for value, name in labels.items())
    return ('<?xml version="1.0" encoding="UTF-8"?> <CaretExtension>  <Date><![CDATA[2013-07-14T05:45:09]]></Date>   '
            f'<VolumeInformation Index="0">   <LabelTable>{entries}  </LabelTable>  <StudyMetaDataLinkSet>  '
            '</StudyMetaDataLinkSet>  <VolumeType><![CDATA[Label]]></VolumeType>   </VolumeInformation></CaretExtension>')


class Names(ExtractTest):
    def setUp(self):
        super().setUp()
        self.organs = ball() * 1 + (numpy.indices((14, 15, 16)).max(axis=0) < 3) * 7
        self.organs = self.organs.astype(numpy.uint8)
        self.volume = self.nifti(self.organs, name="scan.nii.gz")

    def totalsegmentator(self, labels):
        image = nibabel.Nifti1Image(self.organs, numpy.eye(4))
        image.header.extensions.append(nibabel.nifti1.Nifti1Extension(0, label_table(labels).encode()))
        image.to_filename(self.folder / "multi.nii.gz")
        return self.folder / "multi.nii.gz"

    def test_of_totalsegmentator(self):
        volume = self.totalsegmentator({1: "aorta", 7: "left atrium"})
        self.assertEqual(self.voxels(volume, self.out, "--label", "left atrium"), 27)
        self.assertIn(b"label 7 (left atrium)", self.out.read_bytes())
        report = self.run_tool(volume, "--info")
        self.assertEqual([label["name"] for label in report["result"]["labels"]], ["aorta", "left atrium"])
        self.assertRegex(self.done.stdout, r"7 +27 voxels .* left atrium\n")

    def test_of_a_table_beside_the_volume(self):
        for name, text in (("scan.tsv", BIDS), ("scan.txt", ITK_SNAP), ("scan.label", ITK_SNAP), ("scan.ctbl", SLICER)):
            table = self.folder / name
            table.write_text(text)
            voxels = self.voxels(self.volume, self.out, "--label", "left atrium")
            self.assertEqual(voxels, 27, name)
            self.assertEqual([pathlib.Path(entry["path"]).name for entry in self.done.report["inputs"]], ["scan.nii.gz", name])
            self.run_tool(self.volume, "--info")
            self.assertIn("left atrium", self.done.stdout)
            table.unlink()

    def test_of_a_table_that_is_named_go_before_those_in_the_volume(self):
        (self.folder / "own.tsv").write_text("index\tname\n7\taorta\n1\tvein\n")
        volume = self.totalsegmentator({1: "aorta", 7: "left atrium"})
        self.assertEqual(self.voxels(volume, self.out, "--label", "aorta", "--names", self.folder / "own.tsv"), 27)
        (self.folder / "multi.tsv").write_text("index\tname\n7\taorta\n")
        self.assertGreater(self.voxels(volume, self.out, "--label", "aorta"), 400)

    def test_that_are_misspelt_get_the_nearest(self):
        (self.folder / "scan.tsv").write_text(BIDS)
        self.refuse(3, self.volume, self.out, "--label", "aotra", saying="no label of the name 'aotra': did you mean 'aorta'?")
        self.refuse(3, self.volume, self.out, "--label", "spleen", saying=["'spleen'", "its labels are 1 (aorta), 7 (left"])

    def test_that_two_labels_have_are_refused(self):
        (self.folder / "scan.tsv").write_text("index\tname\n1\taorta\n7\taorta\n")
        self.refuse(3, self.volume, self.out, "--label", "aorta", saying="'aorta' is the name of two labels, 1 and 7")
        self.assertEqual(self.voxels(self.volume, self.out, "--label", 7), 27)

    def test_that_nothing_gives(self):
        self.refuse(3, self.volume, self.out, "--label", "aorta", saying="nothing names its labels (--names FILE)")

    def test_of_a_label_without_voxels(self):
        (self.folder / "scan.tsv").write_text(BIDS + "9\tcolon\n")
        self.refuse(3, self.volume, self.out, "--label", "colon", saying="has no voxel with label colon")

    def test_of_another_file_beside_are_left_out_with_a_warning(self):
        (self.folder / "scan.txt").write_text("A scan of the abdomen.\n")
        self.voxels(self.volume, self.out, "--label", 7)
        self.assertIn("scan.txt:1: is no line of a table of labels", self.done.report["warnings"][0])
        self.assertIn("warning", self.done.stderr)
        self.out.unlink()
        self.refuse(3, self.volume, self.out, "--label", 7, "--names", self.folder / "scan.txt", saying="scan.txt:1")
        self.refuse(3, self.volume, self.out, "--label", 7, "--names", self.folder / "none.tsv", saying="none.tsv")


if __name__ == "__main__":
    unittest.main()
