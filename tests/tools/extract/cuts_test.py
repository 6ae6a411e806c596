"""--cut: surfaces opened along planes; what --info says of where labels are; OPEN that opens nothing."""
import unittest

import nibabel
import numpy
from meshes import Ply
from running import ToolTest


class Cuts(ToolTest):
    verb = "extract"

    def setUp(self):
        super().setUp()
        # A vessel of radius 6 mm along z, from 5 to 44 mm, and a ball cut by the border; voxels of 1 mm.
        i, j, k = numpy.mgrid[:40, :30, :50]
        data = numpy.zeros((40, 30, 50), numpy.uint8)
        data[((i - 12) ** 2 + (j - 14) ** 2 <= 36) & (k >= 5) & (k < 45)] = 1
        data[(i - 38) ** 2 + (j - 15) ** 2 + (k - 25) ** 2 <= 25] = 2
        data[30, 2, 3] = 2
        nibabel.save(nibabel.Nifti1Image(data, numpy.eye(4)), self.folder / "v.nii.gz")

    def extract(self, *words, **options):
        return self.run_tool("v.nii.gz", *words, "--force", **options)

    def test_both_ends_are_cut_flat(self):
        for smooth, low, high in (("none", 10.3, 33.0), ("staircase", 12.5, 38.49), ("1mm", 9.0, 41.0)):
            result = self.extract("o.ply", "--label", "1", "--smooth", smooth, "--cut", f"above z={high}mm", "--cut",
                                  f"below z={low / 10}cm")["result"]
            self.assertEqual((result["openings"], result["euler"], result["closed"]), (2, 0, False))
            self.assertTrue(result["manifold"] and result["oriented_outward"])
            mesh = Ply(self.folder / "o.ply")
            self.assertAlmostEqual(mesh.vertices[:, 2].min(), low, 9)
            self.assertAlmostEqual(mesh.vertices[:, 2].max(), high, 9)
            z = mesh.vertices[mesh.rim(), 2]
            self.assertLess(numpy.minimum(abs(z - low), abs(z - high)).max(), 1e-9)
            corners = mesh.vertices[mesh.triangles]
            areas = numpy.linalg.norm(numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
            self.assertGreater(areas.min(), 0.002)
            self.assertAlmostEqual(areas.sum() / (2 * numpy.pi * 6 * (high - low)), 1.1, delta=0.15)
            self.assertAlmostEqual(result["voxel_volume_mm3"] / (numpy.pi * 36 * (high - low)), 1, delta=0.05)

    def test_planes_are_of_the_space_asked_for(self):
        for space, kept in (("lps", lambda x: x.max() == -12), ("ras", lambda x: x.max() == 12)):
            words = "above x=-12mm" if space == "lps" else "above x=12mm"
            self.extract("o.ply", "--label", "1", "--space", space, "--cut", words)
            self.assertTrue(kept(Ply(self.folder / "o.ply").vertices[:, 0]))

    def test_of_the_border_that_is_said_which_planes_leave(self):
        """Of a ball that the border cuts through, and of one that it shaves."""
        i, j, k = numpy.mgrid[:40, :30, :50]
        data = ((i - 38) ** 2 + (j - 15) ** 2 + (k - 25) ** 2 <= 25).astype(numpy.uint8)
        data[(i - 8) ** 2 + (j - 14) ** 2 + (k - 25) ** 2 <= 81] = 2
        nibabel.save(nibabel.Nifti1Image(data, numpy.eye(4)), self.folder / "v.nii.gz")
        for label, words, cut in (("1", (), "below x=-36mm"), ("2", (), "above x=-4mm"), ("2", ("--open-border",), "above x=-4mm")):
            for more, said in (((), True), (("--cut", "above z=30mm"), True), (("--cut", cut), False)):
                warnings = " ".join(self.extract("o.ply", "--label", label, *words, *more)["warnings"])
                self.assertEqual("border cuts" in warnings, said, (label, words, more, warnings))

    def test_what_cannot_be_cut_is_said(self):
        for cut, code, says in (("above z=90mm", 3, "reaches from"), ("z=40mm", 2, "write 'above z=40mm'"),
                                ("above z=40mm; below z=10mm", 2, "repeat --cut"), ("above z=40", 2, "no unit")):
            self.extract("o.ply", "--label", "1", "--cut", cut, code=code, says=says)
        self.assertFalse((self.folder / "o.ply").exists())

    def test_an_open_border_that_opens_nothing_is_said(self):
        report = self.extract("o.ply", "--label", "1", "--open-border")
        self.assertIn("0 openings found", " ".join(report["warnings"]))
        self.assertEqual(report["result"]["openings"], 0)
        report = self.extract("o.ply", "--label", "2", "--largest", "--open-border")
        self.assertNotIn("0 openings found", " ".join(report["warnings"]))
        self.assertEqual(report["result"]["openings"], 1)

    def test_info_says_where_labels_are(self):
        labels = {label["label"]: label for label in self.extract("--info")["result"]["labels"]}
        self.assertEqual(labels[1]["box_mm"], [[-18.5, -20.5, 4.5], [-5.5, -7.5, 44.5]])
        self.assertEqual((labels[1]["pieces"], labels[1]["openings"]), (1, 0))
        self.assertEqual((labels[2]["pieces"], labels[2]["openings"]), (2, 1))


if __name__ == "__main__":
    unittest.main()
