"""tunica-extract: labels that are walls, cavities, cuts through a side, several labels as one, organs that touch."""
import pathlib
import unittest

import numpy
from meshes import Ply
from volumes import ExtractTest

MM = numpy.diag([0.8, 0.8, 0.8, 1])  # RAS: x and y are turned round in LPS


def grid(shape=(40, 40, 48)):
    return numpy.indices(shape).astype(float)


def rims(ply):
    """The planes z in which boundary edges lie, and whether all lie in such."""
    z = ply.vertices[ply.rim(), 2]
    assert numpy.abs(z[:, 0] - z[:, 1]).max(initial=0) < 1e-9
    return set(numpy.round(z[:, 0], 4))


class Warnings(ExtractTest):
    def warned(self, *arguments, of=None, saying=()):
        """@return the report, whose only warning of weight is of this kind and says that"""
        report = self.run_tool(*arguments)
        self.assertEqual(report["warning_kinds"], [of] if of else [], report["warnings"])
        for text in saying:
            self.assertIn(text, report["warnings"][0])
        return report


class Walls(Warnings):
    def tube(self, outer=14.0, shape=(40, 40, 48)):
        i, j, _ = grid(shape)
        r = numpy.hypot(i - 19.5, j - 19.5)
        return self.nifti(((r < outer) & (r >= 12)).astype(numpy.uint8), MM, "tube.nii.gz")

    def ball(self):
        r = numpy.sqrt(((grid() - numpy.array([19.5, 19.5, 23.5]).reshape(3, 1, 1, 1)) ** 2).sum(axis=0))
        return self.nifti(numpy.where(r < 13, 1, numpy.where(r < 15, 2, 0)).astype(numpy.uint8), MM, "ball.nii.gz")

    def test_with_two_faces_are_said_open_or_closed(self):
        for outer in (14.0, 13.2):
            volume = self.tube(outer)
            for flags in ([], ["--open-border"], ["--open-border", "--smooth", "staircase", "--largest"]):
                report = self.run_tool(volume, self.out, "--label", 1, *flags)
                self.assertEqual(report["warning_kinds"][0], "wall with two faces", flags)
                self.assertIn("(-15.6, -15.6, 18.8) mm", report["warnings"][0])
                self.assertIn("--face inner", report["warnings"][0])

    def test_give_one_face_that_faces_outward_and_the_thickness(self):
        other = self.folder / "other.ply"
        for face, radius, behind in (("inner", 9.6, 11.2), ("outer", 11.2, 9.6)):
            report = self.warned(self.tube(), self.out, "--label", 1, "--open-border", "--smooth", "staircase", "--face",
                                 face, "--other-face", other)
            result = report["result"]
            self.assertEqual(result["face"], face)
            self.assertIn(f"comment face {face}\n".encode(), self.out.read_bytes())
            self.assertAlmostEqual(result["wall_thickness_mm"]["mean"], 1.6, delta=0.1)
            self.assertEqual((result["components"], result["oriented_outward"]), (1, True))
            self.assertEqual([pathlib.Path(entry["path"]).name for entry in report["outputs"]], ["out.ply", "other.ply"])
            for path, r in ((self.out, radius), (other, behind)):
                ply = Ply(path)
                middle = ply.vertices - [-15.6, -15.6, 0]
                self.assertAlmostEqual(numpy.hypot(middle[:, 0], middle[:, 1]).mean(), r, delta=0.1)
                a, b, c = ply.corners()
                outward = numpy.cross(b - a, c - a)[:, :2] * ((a + b + c) / 3 - [-15.6, -15.6, 0])[:, :2]
                self.assertGreater(outward.sum(axis=1).min(), 0)
                self.assertEqual(rims(ply), {-0.4, 38.0})

    def test_of_one_voxel_give_whole_faces(self):
        r = numpy.sqrt(((grid((35, 35, 35)) - 17) ** 2).sum(axis=0))
        volume = self.nifti((numpy.abs(r - 14) < 0.5).astype(numpy.uint8))
        self.warned(volume, self.out, "--label", 1, "--smooth", "none", "--face", "inner")
        ply = Ply(self.out)
        self.assertTrue(ply.is_closed_oriented_manifold())
        self.assertEqual(ply.euler(), 2)
        self.assertAlmostEqual(ply.volume(), 4 / 3 * numpy.pi * 13.5 ** 3, delta=500)

    def test_in_grey_volumes_have_faces_too(self):
        r = numpy.sqrt(((grid((35, 35, 35)) - 17) ** 2).sum(axis=0))
        volume = self.nifti((3 - numpy.abs(r - 12)).astype(numpy.float32))
        for flags in ([], ["--slab", 7], ["--smooth", "1mm"]):
            for face, radius in (("inner", 10), ("outer", 14)):
                report = self.run_tool(volume, self.out, "--isovalue", 1, "--face", face, *flags)
                ply = Ply(self.out)
                self.assertTrue(ply.is_closed_oriented_manifold(), (flags, face))
                self.assertAlmostEqual(ply.volume(), 4 / 3 * numpy.pi * radius ** 3, delta=0.08 * ply.volume())
                self.assertAlmostEqual(report["result"]["wall_thickness_mm"]["mean"], 4, delta=0.3)

    def test_whose_cavity_is_filled_say_how_much(self):
        self.warned(self.ball(), self.out, "--label", 2, "--fill-cavities", of="wall with two faces",
                    saying=["cavities are filled", "65.1 %", "--face inner", "--label A+B"])
        self.warned(self.ball(), self.out, "--label", 2, of="wall with two faces", saying=["65.1 %"])
        report = self.warned(self.ball(), self.out, "--label", 2, "--fill-cavities", "--face", "inner")
        self.assertGreater(report["result"]["volume_mm3"], 0)
        self.assertLess(report["result"]["volume_mm3"], 4 / 3 * numpy.pi * 10.4 ** 3 * 1.02)

    def test_that_are_open_within_the_image_are_said(self):
        i, j, k = grid()
        r = numpy.hypot(i - 19.5, j - 19.5)
        volume = self.nifti(((r < 14) & (r >= 12) & (k > 5) & (k < 40)).astype(numpy.uint8))
        self.warned(volume, self.out, "--label", 1, of="wall with two faces", saying=["it may be a wall", "at an end", "(-19.5, -19.5, "])
        self.out.unlink()
        self.refuse(3, volume, self.out, "--label", 1, "--face", "inner", saying=["no wall around a hollow", "crop"])

    def test_that_are_open_along_a_slit_are_said_until_it_is_closed(self):
        i, j, _ = grid()
        r = numpy.hypot(i - 19.5, j - 19.5)
        tube = (r < 15) & (r >= 12)
        for slit in (1, 3, 10):
            volume = self.nifti((tube & ~((numpy.abs(j - 19.5) < slit) & (i > 19))).astype(numpy.uint8))
            for flags in ([], ["--largest", "--open-border", "--smooth", "staircase"]):
                report = self.run_tool(volume, self.out, "--label", 1, *flags)
                self.assertEqual(report["warning_kinds"][0], "wall with two faces", (slit, flags))
                self.assertIn("may be a wall with two faces that is open along a slit", report["warnings"][0])
            self.out.unlink()
            self.refuse(3, volume, self.out, "--label", 1, "--face", "inner", saying=["no wall around a hollow", "slit"])
        self.warned(self.nifti(tube.astype(numpy.uint8)), self.out, "--label", 1, "--open-border", "--face", "inner")

    def test_wrong_usage_is_2(self):
        volume = self.tube()
        for flags, saying in ((["--all-labels", "--face", "inner"], "--face is of one wall"),
                              (["--label", 1, "--other-face", "o.ply"], "needs --face"),
                              (["--label", 1, "--face", "both"], "--face"),
                              (["--label", 1, "--face", "inner", "--other-face", self.out], "out.ply")):
            self.refuse(2, volume, self.folder / "out.ply" if "--all-labels" not in flags else self.folder / "{label}.ply",
                        *flags, saying=saying)


    def test_of_which_a_side_is_cut_have_their_thickness_without_the_lids(self):
        i, j, _ = grid()
        r = numpy.hypot(i, j - 19.5)
        volume = self.nifti(((r < 14) & (r >= 12)).astype(numpy.uint8), MM)
        for border in ([], ["--open-border"]):
            report = self.run_tool(volume, self.out, "--label", 1, "--face", "inner", "--smooth", "staircase", *border)
            thickness = report["result"]["wall_thickness_mm"]
            self.assertAlmostEqual(thickness["mean"], 1.6, delta=0.1)
            self.assertGreater(thickness["p5"], 1)
            self.assertLess(thickness["p95"], 2)


class Cavities(Warnings):
    def test_that_stay_or_are_filled_are_said(self):
        r = numpy.sqrt(((grid((35, 35, 35)) - 17) ** 2).sum(axis=0))
        for radius, kept, filled in ((6, "nested surfaces", "cavities filled"), (3, "nested surfaces", None)):
            volume = self.nifti(((r < 15) & (r >= radius)).astype(numpy.uint8))
            report = self.warned(volume, self.out, "--label", 1, of=kept, saying=["--fill-cavities", "(-17.0, -17.0, 17.0) mm"])
            self.assertEqual(report["result"]["components"], 2)
            report = self.warned(volume, self.out, "--label", 1, "--fill-cavities", of=filled)
            self.assertEqual(sum("cavities filled" in note for note in report["notes"]), 0 if filled else 1)


class Sides(Warnings):
    def test_that_the_border_cuts_are_closed_and_said(self):
        i, j, _ = grid()
        for centre, lids in (((4, 19.5), 1), ((35, 19.5), 1), ((4, 4), 2)):
            volume = self.nifti((numpy.hypot(i - centre[0], j - centre[1]) < 12).astype(numpy.uint8), MM)
            for smooth in ("none", "staircase", "1mm"):
                report = self.warned(volume, self.out, "--label", 1, "--open-border", "--smooth", smooth, of="side cut",
                                     saying=["no end of a vessel"])
                self.assertEqual(report["warnings"][0].split("that is")[0].count(") mm"), lids)
                self.assertEqual(rims(Ply(self.out)), {-0.4, 38.0})

    def test_of_vessels_in_the_image_are_not(self):
        i, j, _ = grid()
        volume = self.nifti((numpy.hypot(i - 19.5, j - 19.5) < 12).astype(numpy.uint8), MM)
        self.warned(volume, self.out, "--label", 1, "--open-border")

    def test_of_sheets_across_the_image_are_bent_rims(self):
        i, j, k = grid()
        volume = self.nifti((numpy.abs(k - 24 - 0.02 * ((i - 19) ** 2 + (j - 19) ** 2)) < 2).astype(numpy.uint8), MM)
        report = self.run_tool(volume, self.out, "--label", 1, "--open-border")
        self.assertTrue({"bent rim", "side cut"} & set(report["warning_kinds"]), report["warnings"])


class Unions(Warnings):
    def setUp(self):
        super().setUp()
        r = numpy.sqrt(((grid((30, 30, 30)) - 14.5) ** 2).sum(axis=0))
        organ = numpy.where(r < 7, 1, numpy.where(r < 12, 2, 0)).astype(numpy.uint8)
        organ[:2, :2, :2] = 7
        self.volume = self.nifti(organ, name="scan.nii.gz")
        (self.folder / "scan.tsv").write_text("index\tname\n1\tlumen\n2\tthrombus\n7\tlumen+wall\n9\tcalcium\n")
        self.organ = organ

    def test_are_one_organ(self):
        voxels = float((self.organ == 1).sum() + (self.organ == 2).sum())
        for text in ("1+2", "lumen+thrombus", "thrombus + 1", "2+1+2"):
            report = self.warned(self.volume, self.out, "--label", text)
            self.assertEqual(report["result"]["voxel_volume_mm3"], voxels, text)
            self.assertEqual((report["result"]["components"], report["result"]["euler"]), (1, 2))
        self.assertIn(b"labels 2 (thrombus) + 1 (lumen)", self.out.read_bytes())
        self.warned(self.volume, self.folder / "{label}.ply", "--label", "lumen+thrombus", "--slab", 5)
        self.assertTrue((self.folder / "1+2.ply").exists())

    def test_of_names_that_hold_a_plus(self):
        report = self.run_tool(self.volume, self.out, "--label", "lumen+wall")
        self.assertEqual(report["result"]["voxel_volume_mm3"], 8)
        report = self.run_tool(self.volume, self.out, "--label", "thrombus+lumen+wall")
        self.assertEqual(report["result"]["voxel_volume_mm3"], 8 + (self.organ == 2).sum())

    def test_name_the_part_that_is_not_there(self):
        for text, code, saying in (("lumen+trombus", 3, "name 'trombus': did you mean 'thrombus'?"),
                                   ("1+5", 3, "no voxel with label 5"), ("lumen+calcium", 3, "no voxel with label calcium"),
                                   ("0+1", 3, "no voxel with label 0"), ("1+", 2, "nothing beside a '+'"),
                                   ("+", 2, "nothing beside a '+'")):
            self.refuse(code, self.volume, self.out, "--label", text, saying=saying)


class Bridges(Warnings):
    def test_of_one_voxel_are_said_with_their_place(self):
        i, j, k = grid((31, 25, 40))
        vessels = (numpy.hypot(i - 8, j - 12) < 6) | (numpy.hypot(i - 22, j - 12) < 6)
        apart = self.nifti(vessels.astype(numpy.uint8), name="apart.nii.gz")
        self.warned(apart, self.out, "--label", 1, "--open-border")
        fused = vessels | ((i >= 13) & (i <= 16) & (j == 12) & (k == 17))
        report = self.warned(self.nifti(fused.astype(numpy.uint8)), self.out, "--label", 1, "--open-border",
                             of="narrow bridge", saying=["-12.0, 17.0) mm"])
        self.assertIn("1 voxel(s)", report["warnings"][0])


class Openings(Warnings):
    def test_that_are_narrow_are_named_by_place(self):
        i, j, k = grid((30, 30, 30))
        organ = (numpy.sqrt((i - 14) ** 2 + (j - 14) ** 2 + (k - 14) ** 2) < 10) | ((abs(i - 14) < 1) & (abs(j - 14) < 1))
        report = self.warned(self.nifti(organ.astype(numpy.uint8)), self.out, "--label", 1, "--open-border",
                             of="narrow opening", saying=["2 of its 2", "(-14.0, -14.0, -0.5) mm, (-14.0, -14.0, 29.5) mm"])
        self.assertFalse(report["result"]["closed"])
        report = self.run_tool(self.nifti(organ.astype(numpy.uint8)), self.out, "--label", 1, "--open-border", "--space",
                                  "ras")
        self.assertIn("(14.0, 14.0, -0.5) mm", report["warnings"][0])


if __name__ == "__main__":
    unittest.main()
