"""tunica-compare as its users run it: analytic distances, maps, curved shells, each exit code."""
import math
import os
import struct
import unittest

import meshes
from running import ToolTest


def interval_holds(interval, truth, slack=0.0):
    return interval["lower"] <= truth + slack and truth <= interval["upper"] + slack


class Compare(ToolTest):
    verb = "compare"

    def setUp(self):
        super().setUp()
        plane = [(0, 0, 0), (4, 0, 0), (4, 3, 0), (0, 3, 0)]
        meshes.write_ply(self.path("plane.ply"), plane, [(0, 1, 2), (0, 2, 3)])
        meshes.write_ply(self.path("offset.ply"), [(x, y, 0.25) for x, y, _ in plane], [(0, 1, 3), (1, 2, 3)])
        meshes.write_ply(self.path("longer.ply"), [(2 * x, y, z) for x, y, z in plane], [(0, 1, 2), (0, 2, 3)])
        vertices, triangles = meshes.sphere(2, 10.0)
        self.normals = [tuple(x / 10 for x in v) for v in vertices]
        meshes.write_ply(self.path("shell.ply"), vertices, triangles, self.normals, ["SPACE=LPS", "surface=comas"])
        meshes.write_ply(self.path("sphere.ply"), *meshes.sphere(6, 10.0))

    def test_planes_apart_are_at_their_distance(self):
        report = self.run_tool("plane.ply", "offset.ply")
        result = report["result"]
        self.assertEqual(result["diagonal_mm"], 5)
        self.assertTrue(interval_holds(result["hausdorff_mm"], 0.25))
        self.assertTrue(interval_holds(result["hausdorff_percent"], 5))
        width = result["hausdorff_percent"]["upper"] - result["hausdorff_percent"]["lower"]
        self.assertLessEqual(width, 0.01)
        self.assertAlmostEqual(result["mean_percent"], 5, places=6)
        self.assertAlmostEqual(result["rms_percent"], 5, places=6)
        self.assertEqual(list(report["seconds"]), ["total", "read", "compare"])
        self.assertEqual(len(report["inputs"]), 2)

    def test_sides_and_diagonal_of_b(self):
        result = self.run_tool("plane.ply", "longer.ply", "--tolerance", "0.0001%")["result"]
        diagonal = math.hypot(8, 3)
        self.assertAlmostEqual(result["diagonal_mm"], diagonal)
        self.assertTrue(interval_holds(result["one_sided_percent"]["b_to_a"], 400 / diagonal))
        self.assertLessEqual(result["one_sided_percent"]["a_to_b"]["upper"], 0.0002)
        self.assertLessEqual(result["hausdorff_percent"]["upper"] - result["hausdorff_percent"]["lower"], 0.0001)

    def test_a_surface_is_at_no_distance_from_itself(self):
        result = self.run_tool("sphere.ply", "sphere.ply")["result"]
        self.assertEqual(result["hausdorff_mm"]["lower"], 0)
        self.assertLess(result["hausdorff_percent"]["upper"], 0.01)
        self.assertLess(result["mean_percent"], 1e-9)

    def test_curved_shells_are_closer_than_flat_facets(self):
        flat = self.run_tool("shell.ply", "sphere.ply")["result"]
        curved = self.run_tool("shell.ply", "sphere.ply", "--shell", "--curved", "curved.ply")["result"]
        self.assertLess(curved["hausdorff_percent"]["upper"], 0.5 * flat["hausdorff_percent"]["lower"])
        width = curved["hausdorff_percent"]["upper"] - curved["hausdorff_percent"]["lower"]
        self.assertLessEqual(width, 0.01)
        fine = self.run_tool("curved.ply", "sphere.ply")["result"]
        self.assertLess(abs(fine["hausdorff_percent"]["upper"] - curved["hausdorff_percent"]["upper"]), 0.02)
        self.assertIsNone(curved["boundary_percent"])
        self.assertNotIn("boundary_percent", flat)

    def test_surfaces_in_different_spaces_are_refused(self):
        meshes.write_ply(self.path("ras.ply"), *meshes.sphere(2, 10.0), comments=["SPACE=RAS"])
        meshes.write_ply(self.path("lps.ply"), *meshes.sphere(2, 10.0), comments=["SPACE=LPS"])
        self.run_tool("ras.ply", "lps.ply", code=3, says="SPACE=LPS")
        self.run_tool("lps.ply", "ras.ply", code=3, says="SPACE=RAS")
        self.run_tool("ras.ply", "sphere.ply", "--map", "map.ply")  # the sphere names none
        self.assertIn("SPACE=RAS", meshes.Ply(self.path("map.ply")).comments)

    def test_shells_that_are_read_flat_are_said(self):
        for files, flags, kinds in [(["shell.ply", "sphere.ply"], [], 1), (["shell.ply", "sphere.ply"], ["--shell"], 0),
                                    (["sphere.ply", "shell.ply"], [], 1), (["sphere.ply", "sphere.ply"], [], 0)]:
            report = self.run_tool(*files, *flags)
            self.assertEqual(report["warning_kinds"], kinds * ["shell read flat"])
            self.assertTrue(all("--shell" in text for text in report["warnings"]))

    def test_spaces_are_read_in_every_format(self):
        vertices, triangles = meshes.sphere(3, 10.0, (30, 20, 5))
        turned = [(-x, -y, z) for x, y, z in vertices]
        meshes.write_ply(self.path("lps.ply"), vertices, triangles, comments=["made by a program. SPACE=LPS"])
        meshes.write_ply(self.path("ras.ply"), turned, triangles, comments=["made by a program. SPACE=RAS"])
        meshes.write_obj(self.path("plain.obj"), turned, triangles)
        with open(self.path("plain.obj")) as file, open(self.path("ras.obj"), "w") as to:
            to.write("# made by a program. SPACE=RAS\n" + file.read())
        with open(self.path("ras.stl"), "wb") as file:
            file.write(b"made by a program. SPACE=RAS".ljust(80) + struct.pack("<I", len(triangles)))
            for t in triangles:
                file.write(struct.pack("<12fH", 0, 0, 0, *(x for i in t for x in turned[i]), 0))
        for name in "ras.ply", "ras.obj", "ras.stl":
            self.run_tool(name, "lps.ply", "--mesh-unit", "mm", code=3, says="SPACE=RAS")
            self.run_tool("lps.ply", name, "--mesh-unit", "mm", code=3, says="SPACE=RAS")
        self.run_tool("ras.stl", "ras.obj", "--max", "0.01%")

    def test_own_files_say_their_space(self):
        vertices, triangles = meshes.sphere(2, 10.0)
        meshes.write_ply(self.path("ras.ply"), vertices, triangles, self.normals, ["SPACE=RAS", "surface=comas"])
        meshes.write_ply(self.path("lps.ply"), *meshes.sphere(4, 10.0), comments=["SPACE=LPS"])
        meshes.write_ply(self.path("fine.ply"), *meshes.sphere(4, 10.0), comments=["SPACE=RAS"])
        for ending in "stl", "obj", "glb":
            self.run_tool("ras.ply", "fine.ply", "--shell", "--curved", "curved." + ending)
            unit = [] if ending == "glb" else ["--mesh-unit", "mm"]
            self.run_tool("curved." + ending, "fine.ply", *unit)
            self.run_tool("curved." + ending, "lps.ply", *unit, code=3, says="SPACE=RAS")

    def test_open_seams_are_said(self):
        vertices, triangles = meshes.sphere(3, 10.0)
        count = len(vertices)
        glued = [tuple(i + count * (sum(vertices[j][2] for j in t) < 0) for i in t) for t in triangles]
        meshes.write_ply(self.path("glued.ply"), vertices + vertices, glued)
        report = self.run_tool("glued.ply", "sphere.ply")
        self.assertEqual(report["warning_kinds"], ["open seam"])
        self.assertIn("64 of its 64 boundary edges", report["warnings"][0])

    def test_threads_change_nothing(self):
        one = self.run_tool("shell.ply", "sphere.ply", "--shell", "--threads", 1)["result"]
        self.assertEqual(one, self.run_tool("shell.ply", "sphere.ply", "--shell", "--threads", 4)["result"])

    def test_map_and_picture(self):
        for flags in [[], ["--shell"]]:
            result = self.run_tool("shell.ply", "sphere.ply", *flags, "--map", "map.ply", "--picture", "map.png",
                                   "--force")["result"]
            ply = meshes.Ply(self.path("map.ply"))
            self.assertGreater(len(ply.triangles), 2000)
            largest = ply.fields["quality"].max()
            upper = result["one_sided_percent"]["a_to_b"]["upper"] * result["diagonal_mm"] / 100
            self.assertLessEqual(largest, upper)
            self.assertGreater(largest, 0.8 * upper)
            with open(self.path("map.png"), "rb") as file:
                self.assertEqual(file.read(8), b"\x89PNG\r\n\x1a\n")

    def test_a_picture_range_changes_the_colours_and_belongs_to_a_picture(self):
        pictures = []
        for range_of_colours in ([], ["--picture-range", "50%"], ["--picture-range", "0.01%"]):
            self.run_tool("plane.ply", "offset.ply", "--picture", "map.png", *range_of_colours, "--force")
            with open(self.path("map.png"), "rb") as file:
                pictures.append(file.read())
        self.assertEqual(len(set(pictures)), 3)
        self.run_tool("plane.ply", "offset.ply", "--picture-range", "1%", code=2, says="belongs to --picture")
        self.run_tool("plane.ply", "offset.ply", "--picture", "a.png", "--picture-range", "1", code=2, says="--picture-range")
        self.run_tool("plane.ply", "offset.ply", "--picture", "a.png", "--picture-range", "0%", code=2, says="--picture-range")

    def test_a_distance_beyond_max_is_4_and_certain(self):
        self.run_tool("plane.ply", "offset.ply", "--max", "0.26mm")
        self.run_tool("plane.ply", "offset.ply", "--max", "5.0001%")
        report = self.run_tool("plane.ply", "offset.ply", "--max", "0.2mm", code=4, says="at least")
        self.assertTrue(interval_holds(report["result"]["hausdorff_mm"], 0.25))
        # Undecided at the first width: narrowed until the answer is certain, either way.
        self.run_tool("plane.ply", "offset.ply", "--tolerance", "50%", "--max", "0.251mm")
        self.run_tool("plane.ply", "offset.ply", "--tolerance", "50%", "--max", "0.249mm", code=4)
        self.run_tool("plane.ply", "offset.ply", "--tolerance", "50%", "--max", "0.25mm", code=4, says="certainly")

    def test_wrong_usage_is_2(self):
        for arguments in [["--tolerance", "0.01"], ["--tolerance", "0%"], ["--max", "1"], ["--nonsense"],
                          ["--mesh-unit", "inch"]]:
            self.run_tool("plane.ply", "offset.ply", *arguments, code=2)
        self.run_tool("plane.ply", "offset.ply", "--curved", "c.ply", code=2, says="--shell")
        self.run_tool("plane.ply", code=2)
        meshes.write_obj(self.path("plane.obj"), *meshes.sphere(1))
        self.run_tool("plane.obj", "offset.ply", "--map", "m.ply", code=2, says="--mesh-unit")
        self.run_tool("plane.obj", "offset.ply", "--map", "m.ply", "--mesh-unit", "cm")

    def test_unfit_inputs_are_3(self):
        self.run_tool("absent.ply", "plane.ply", code=3, says="absent.ply")
        self.run_tool("plane.ply", "absent.ply", code=3, says="absent.ply")
        self.run_tool("plane.ply", "offset.ply", "--shell", code=3, says="normals")
        meshes.write_ply(self.path("point.ply"), [(1, 1, 1)] * 3, [(0, 1, 2)])
        self.run_tool("plane.ply", "point.ply", code=3, says="one point")
        vertices, triangles = meshes.sphere(2, 10.0)
        flat = [(-n[1], n[0], n[2]) for n in self.normals]
        meshes.write_ply(self.path("wild.ply"), vertices, triangles, flat, ["surface=comas"])
        self.run_tool("wild.ply", "sphere.ply", "--shell", code=3, says="wild.ply")

    def test_a_wrong_unit_is_told_at_once(self):
        vertices, triangles = meshes.sphere(3, 10.0)
        for factor, says in ((1000, "the numbers of other.ply are probably um, not mm, or those of sphere.ply m, not mm"),
                             (0.001, "the numbers of other.ply are probably m, not mm, or those of sphere.ply um"),
                             (10, "the numbers of sphere.ply are probably cm, not mm"),
                             (0.1, "the numbers of other.ply are probably cm, not mm")):
            meshes.write_ply(self.path("other.ply"), [[factor * x for x in v] for v in vertices], triangles)
            report = self.run_tool("other.ply", "sphere.ply", code=3, says=says)
            self.assertTrue(report["error"].startswith("other.ply: is "), report["error"])
            self.assertIsNone(report["seconds"]["compare"])
        # What the file states or the user said is what is doubted.
        meshes.write_obj(self.path("other.obj"), [[0.1 * x for x in v] for v in vertices], triangles)
        meshes.write_ply(self.path("stated.ply"), vertices, triangles, comments=["units mm"])
        self.run_tool("other.obj", "stated.ply", "--mesh-unit", "m", code=3, says="probably cm, not m")
        self.run_tool("other.obj", "stated.ply", "--mesh-unit", "cm")

    def test_sizes_that_no_unit_explains_are_compared(self):
        vertices, triangles = meshes.sphere(3, 10.0)
        for scale in ((3, 3, 3), (10, 1, 1), (30, 30, 30)):
            meshes.write_ply(self.path("other.ply"), [[s * x for s, x in zip(scale, v)] for v in vertices], triangles)
            result = self.run_tool("other.ply", "sphere.ply")["result"]
            self.assertTrue(interval_holds(result["hausdorff_mm"], 10 * max(scale) - 10, slack=1.5))

    def test_surfaces_far_apart_are_compared(self):
        vertices, triangles = meshes.sphere(2, 10.0)
        away = [(x + 30000, y, z) for x, y, z in vertices]
        meshes.write_ply(self.path("away.ply"), away, triangles, self.normals, ["SPACE=LPS", "surface=comas"])
        for flags in ([], ["--shell"]):
            report = self.run_tool("away.ply", "sphere.ply", *flags)
            self.assertTrue(interval_holds(report["result"]["hausdorff_mm"], 30000, slack=1.5))
            width = report["result"]["hausdorff_percent"]["upper"] - report["result"]["hausdorff_percent"]["lower"]
            self.assertLessEqual(width, 0.01)
            self.assertLess(report["peak_mib"], 500)

    def test_an_existing_output_is_5_and_kept(self):
        with open(self.path("map.ply"), "w") as file:
            file.write("mine")
        self.run_tool("plane.ply", "offset.ply", "--map", "map.ply", code=5, says="map.ply")
        with open(self.path("map.ply")) as file:
            self.assertEqual(file.read(), "mine")


    def test_nothing_that_looks_finished_is_left_when_a_later_output_fails(self):
        os.mkdir(self.path("map.png.part"))  # where the picture would be written
        self.run_tool("plane.ply", "offset.ply", "--map", "map.ply", "--picture", "map.png", code=5, says="map.png")
        self.assertFalse(self.exists("map.ply"))


if __name__ == "__main__":
    unittest.main()
