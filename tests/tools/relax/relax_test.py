#!/usr/bin/python3
"""tunica-relax from outside: the contract's keys and exit codes, the patch in the file, the paper's own targets."""
import functools
import os
import re
import signal
import unittest

import numpy as np

import meshes
from curved_patch import normals_across, patch_points, watertight_points
from meshes import Ply
from running import SHARED, ToolTest

PAPER, MESHES = SHARED / "paper", SHARED / "meshes"
write_ply = functools.partial(meshes.write_ply, comments=["units mm", "SPACE=LPS"])
RAS = {"comments": ["units mm", "SPACE=RAS"]}


def cylinder(around, along, radius=10.0, length=30.0):
    return meshes.tube(around, along, radius, length, shifted=True)


def closed_cylinder(around, radius=10.0, length=30.0):
    vertices, triangles = cylinder(around, around // 2, radius, length)
    vertices, triangles = list(vertices), list(triangles)
    rings, last = around // 8, len(vertices) - around
    for z, rim, turn in ((0.0, 0, 1), (length, last, -1)):
        outer = [rim + i for i in range(around)]
        for ring in range(rings - 1, 0, -1):
            inner = list(range(len(vertices), len(vertices) + around))
            vertices += [np.append(vertices[rim + i][:2] * ring / rings, z) for i in range(around)]
            for i in range(around):
                a, b, c, d = outer[i], outer[(i + 1) % around], inner[i], inner[(i + 1) % around]
                triangles += [(a, c, d)[::turn], (a, d, b)[::turn]]
            outer = inner
        vertices.append(np.array([0, 0, z]))
        triangles += [(outer[i], len(vertices) - 1, outer[(i + 1) % around])[::turn] for i in range(around)]
    return np.array(vertices), np.array(triangles)


def sphere(splits, radius=20.0):
    return meshes.geodesic_sphere(splits, radius)[:2]


class Case(ToolTest):
    method = []  # the default

    def relax(self, *arguments, **options):
        """Runs the tool, with the class's method when none is named; @return its report and stderr."""
        self.run_tool("relax", *arguments, *([] if "--method" in arguments else self.method), **options)
        return self.done.report, self.done.stderr


class Contract(Case):
    def setUp(self):
        super().setUp()
        self.target, self.coarse, self.out = self.path("target.ply"), self.path("coarse.ply"), self.path("shell.ply")
        write_ply(self.target, *cylinder(48, 30))
        write_ply(self.coarse, *cylinder(8, 3, radius=10.3))

    def test_shells_that_are_none_of_the_surface_are_told(self):
        write_ply(self.path("one.ply"), np.array([[10.0, 0, 20], [9, 4, 20], [9, 0, 24]]), [(0, 1, 2)])
        self.relax(self.path("one.ply"), self.target, self.out,
                   says="of the surface's diagonal apart: are COARSE and TARGET of one organ")

    def test_a_pole_given_as_a_ring_of_vertices_is_no_boundary(self):
        vertices, triangles = cylinder(24, 12)
        z = vertices[:, 2]
        turn = np.pi * (z - z.min()) / (z.max() - z.min())
        across = np.sin(turn)
        across[(z == z.min()) | (z == z.max())] = 0
        vertices = np.column_stack([vertices[:, :2] * across[:, None], -10 * np.cos(turn)])
        write_ply(self.target, vertices, triangles)
        coarse = self.path("closed.ply")
        self.run_tool("decimate", self.target, coarse, "--triangles", 60)
        for start in (coarse, self.target):
            record, said = self.relax(start, self.target, self.out, "--tolerance", "3%", "--max-iterations", 1, "--force")
            self.assertIsNone(record["result"]["boundary_percent"])
            self.assertTrue(record["result"]["reached"])
            self.assertNotIn("warning", said)
            self.assertLess(record["result"]["shells"], 60)

    def test_report_holds_every_key_and_the_intervals_are_intervals(self):
        record, _ = self.relax(self.coarse, self.target, self.out, "--map", self.path("map.ply"), "--picture",
                               self.path("map.png"), "--curved", self.path("curved.ply"))
        result = record["result"]
        self.assertEqual(list(record["seconds"]), ["total", "read", "relax", "measure", "write"])
        for key in ("shells", "hausdorff_mm", "hausdorff_percent", "one_sided_percent", "mean_percent", "rms_percent",
                    "boundary_percent", "flat_hausdorff_percent", "iterations", "min_angle_deg", "self_intersections",
                    "reached"):
            self.assertIn(key, result)
        self.assertLessEqual(result["shells"], 48)
        self.assertGreaterEqual(result["shells"], 0.9 * 48)
        self.assertIsNone(result["reached"])
        self.assertEqual(result["self_intersections"], 0)
        diagonal = np.linalg.norm([20, 20, 30])
        for side in ("lower", "upper"):
            self.assertAlmostEqual(result["hausdorff_mm"][side] / diagonal * 100, result["hausdorff_percent"][side],
                                   delta=0.01 * result["hausdorff_percent"][side])
        sides = result["one_sided_percent"]
        for interval in (result["hausdorff_percent"], result["flat_hausdorff_percent"], sides["shell_to_target"],
                         sides["target_to_shell"]):
            self.assertLessEqual(interval["lower"], interval["upper"])
            self.assertLess(interval["upper"] - interval["lower"], 0.011)
        self.assertAlmostEqual(max(s["upper"] for s in sides.values()), result["hausdorff_percent"]["upper"], delta=1e-9)
        self.assertLessEqual(result["mean_percent"], result["rms_percent"])
        self.assertLessEqual(result["rms_percent"], sides["shell_to_target"]["upper"])
        self.assertLess(result["hausdorff_percent"]["upper"], result["flat_hausdorff_percent"]["lower"] / 2)
        self.assertLessEqual(result["hausdorff_percent"]["lower"],
                             min(i["hausdorff_percent"]["upper"] for i in result["iterations"]))
        self.assertLessEqual(Ply(self.path("map.ply")).fields["quality"].max(), result["hausdorff_mm"]["upper"])
        with open(self.path("map.png"), "rb") as file:
            self.assertEqual(file.read(8), b"\x89PNG\r\n\x1a\n")
        shell = Ply(self.out)
        for comment in ("surface=watertight", "units mm", "SPACE=LPS"):
            self.assertIn(comment, shell.comments)
        self.assertLess(np.abs(np.linalg.norm(shell.normals(), axis=1) - 1).max(), 1e-12)

    def test_refine_reaches_the_tolerance_and_two_threads_give_the_same_bytes(self):
        record, _ = self.relax(self.coarse, self.target, self.out, "--tolerance", "0.1%", "--refine", "--threads", 1)
        self.assertTrue(record["result"]["reached"])
        self.assertLessEqual(record["result"]["hausdorff_percent"]["upper"], 0.1)
        other = self.path("other.ply")
        self.relax(self.coarse, self.target, other, "--tolerance", "0.1%", "--refine", "--threads", 2)
        first, second = Ply(self.out), Ply(other)
        self.assertTrue((first.fields == second.fields).all() and (first.faces == second.faces).all())

    def test_watertight_patches_are_those_of_the_file_and_meet(self):
        curved = self.path("curved.ply")
        for method in (("barycentre",), ("fit", "--max-iterations", "1"), ("fit", "--refine", "--tolerance", "2%")):
            record, _ = self.relax(self.coarse, self.target, self.out, "--surface", "watertight", "--method", *method,
                                   "--curved", curved, "--force")
            shell = Ply(self.out)
            self.assertIn("surface=watertight", shell.comments)
            if "corner_normals" in shell.faces.dtype.names:
                continue
            points, normals, triangles = shell.vertices, shell.normals(), shell.triangles
            grid = np.array([(4 - i - j, i, j) for i in range(5) for j in range(5 - i)]) / 4
            fine, fine_triangles = Ply(curved).vertices, Ply(curved).triangles
            expected = np.concatenate([watertight_points(points[t], normals[t], grid) for t in triangles])
            some = expected[::31]
            distances = np.array([np.linalg.norm(fine - p, axis=1).min() for p in some])
            longest = np.linalg.norm(fine[fine_triangles[:, 0]] - fine[fine_triangles[:, 1]], axis=1).max()
            self.assertLess(distances.max(), longest)
            # Points of an edge come from both of its triangles: each of them once only, to the last digits.
            on_edges = grid.min(axis=1) == 0
            rounded = {tuple(p) for p in np.round(expected.reshape(len(triangles), -1, 3)[:, on_edges], 9).reshape(-1, 3)}
            edges = {tuple(sorted(e)) for t in triangles for e in ((t[0], t[1]), (t[1], t[2]), (t[2], t[0]))}
            self.assertEqual(len(rounded), len(points) + 3 * len(edges))
            again = self.run_tool("compare", self.out, self.target, "--shell")["result"]["hausdorff_percent"]
            self.assertLessEqual(again["lower"], record["result"]["hausdorff_percent"]["upper"])
            self.assertGreaterEqual(again["upper"], record["result"]["hausdorff_percent"]["lower"])

    def test_a_watertight_closed_cylinder_is_closed_at_its_rims_whoever_reads_the_file(self):
        target = self.path("closed.ply")
        vertices, triangles = closed_cylinder(96)
        write_ply(target, vertices, triangles)
        record, _ = self.relax(target, target, self.out, "--surface", "watertight", "--tolerance", "0.3%")
        shell = Ply(self.out)
        points, triangles, normals = shell.vertices, shell.triangles, shell.corner_normals()
        self.assertIn("surface=watertight", shell.comments)
        self.assertLess(np.sum(normals[:, 0] * normals[:, 1], axis=1).min(), 1 - 1e-6)
        across = normals_across(triangles, normals)
        self.assertGreater((np.linalg.norm(across - normals[:, :, None], axis=3) > 0.5).sum(), 20)
        grid = np.array([(12 - i - j, i, j) for i in range(13) for j in range(13 - i)]) / 12
        patches = np.array([watertight_points(points[t], normals[i], grid, across[i]) for i, t in enumerate(triangles)])
        on_edges = grid.min(axis=1) == 0
        rounded = {tuple(p) for p in np.round(patches[:, on_edges], 9).reshape(-1, 3) + 0.0}
        self.assertEqual(len(rounded), len(points) + 11 * 3 * len(triangles) // 2)
        # The true cylinder is within the certified distance, but for the target's own facets.
        upper = record["result"]["hausdorff_mm"]["upper"] + 10 * (1 - np.cos(np.pi / 96))
        all_points = patches.reshape(-1, 3)
        beside = np.abs(np.hypot(all_points[:, 0], all_points[:, 1]) - 10)
        beyond = np.minimum(np.abs(all_points[:, 2]), np.abs(all_points[:, 2] - 30))
        self.assertLessEqual(np.minimum(beside, beyond).max(), upper)
        smooth = np.array([watertight_points(points[t], normals[i], grid) for i, t in enumerate(triangles)])
        self.assertGreater(np.abs(smooth - patches).max(), 0.01)  # creases that do something
        self.run_tool("compare", self.out, target, "--shell", "--max", "0.3%")
        solved = self.run_tool("simulate", self.out, "closed.hdf", "--static", "--pressure", "1kPa", "--young", "1MPa",
                               "--poisson", "0.45", "--thickness", "1mm", "--density", "1100kg/m3", "--fix", "rigid-motions")
        self.assertAlmostEqual(solved["result"]["volume_before_mm3"] / (np.pi * 3000), 1, delta=0.01)

    def test_tolerance_out_of_reach_is_4_and_the_best_mesh_stays(self):
        record, error = self.relax(self.coarse, self.target, self.out, "--tolerance", "0.01%", "--max-iterations", 1,
                                   "--method", "barycentre", code=4)
        self.assertIn("not reached", error)
        self.assertFalse(os.path.exists(self.out))
        self.assertEqual(len(Ply(self.out + ".part").triangles), 48)
        self.assertIs(record["result"]["reached"], False)
        self.assertEqual(record["result"]["shells"], 48)

    def test_limit_of_shells_is_kept_and_makes_4(self):
        record, _ = self.relax(self.coarse, self.target, self.out, "--tolerance", "0.01%", "--refine", "--max-shells",
                               100, code=4)
        self.assertLessEqual(record["result"]["shells"], 100)

    def test_wrong_usage_is_2(self):
        for extra in (["--tolerance", "0.5"], ["--tolerance", "-1mm"], ["--method", "nonsense"],
                      ["--surface", "smooth"], ["--max-shells", "10"], ["--kink", "20"], ["--effort", "1"],
                      ["--max-iterations", "0"], ["--mesh-unit", "parsec"], ["--unknown"]):
            self.relax(self.coarse, self.target, self.out, *extra, code=2)
        for extra in (["--min-angle", "0.5"], ["--min-angle", "31"], ["--min-angle", "nan"], ["--min-angle", "wide"], ["--min-angle", "20", "--method", "barycentre"]):
            self.relax(self.coarse, self.target, self.out, *extra, code=2)
        barycentre = ["--method", "barycentre"]
        for extra in (["--refine"], ["--max-shells", "10"], ["--shells", "100"]):
            self.relax(self.coarse, self.target, self.out, *barycentre, *extra, code=2)
        self.relax(self.coarse, self.target, code=2)

    def test_a_format_without_a_unit_needs_one(self):
        vertices, triangles = cylinder(8, 3, radius=1.03, length=3.0)
        obj = self.path("coarse.obj")
        with open(obj, "w") as file:
            file.writelines(f"v {x} {y} {z}\n" for x, y, z in vertices)
            file.writelines(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in triangles)
        self.assertIn("--mesh-unit", self.relax(obj, self.target, self.out, code=2)[1])
        record, _ = self.relax(obj, self.target, self.out, "--mesh-unit", "cm", "--max-iterations", 1)
        self.assertLess(record["result"]["hausdorff_percent"]["upper"], 1)

    def test_unfit_inputs_are_3(self):
        vertices, triangles = cylinder(8, 3)
        bad = self.path("bad.ply")
        fan = np.vstack([triangles, [[0, 1, 30]]])  # a third triangle on an edge
        write_ply(bad, vertices, fan)
        for arguments in ((bad, self.target), (self.coarse, bad)):
            record, error = self.relax(*arguments, self.out, code=3)
            self.assertIn("bad.ply", error)
            self.assertIn("near (", error)
            self.assertIn("tunica-decimate --repair", error)
        self.relax(self.path("absent.ply"), self.target, self.out, code=3)
        with open(self.target, "rb") as file:
            whole = file.read()
        with open(bad, "wb") as file:
            file.write(whole[:len(whole) // 2])
        self.relax(self.coarse, bad, self.out, code=3)
        flat = self.path("point.ply")
        write_ply(flat, np.zeros((3, 3)), [[0, 1, 2]])
        self.relax(self.coarse, flat, self.out, code=3)

    def test_a_wrong_unit_or_place_is_told_before_any_work(self):
        vertices, triangles = cylinder(8, 3, radius=10.3)
        wrong = self.path("wrong.ply")
        size = np.linalg.norm(np.ptp(vertices, axis=0))
        for moved, says in ((1000 * vertices, "about 1000 times as large"), (vertices / 1000, "about 1000 times as small"),
                            (10 * vertices, "probably cm, not mm"), (vertices + [40_000, 0, 0], "away from"),
                            (vertices + [2.5 * size, 0, 0], "away from")):
            write_ply(wrong, moved, triangles)
            record, error = self.relax(wrong, self.target, self.out, code=3)
            self.assertIn("wrong.ply: ", error)
            self.assertIn(says, error)
            self.assertIsNone(record["seconds"]["relax"])
            self.assertFalse(os.path.exists(self.out))

    def test_the_space_is_kept_and_two_spaces_are_refused(self):
        write_ply(self.target, *cylinder(48, 30), **RAS)
        _, error = self.relax(self.coarse, self.target, self.out, code=3)
        for part in ("coarse.ply", "SPACE=LPS", "target.ply", "SPACE=RAS"):
            self.assertIn(part, error)
        write_ply(self.coarse, *cylinder(8, 3, radius=10.3), **RAS)
        others = [self.path(name) for name in ("map.ply", "curved.ply")]
        self.relax(self.coarse, self.target, self.out, "--method", "barycentre", "--max-iterations", 1, "--map", others[0],
                   "--curved", others[1])
        for written in (self.out, *others):
            comments = Ply(written).comments
            self.assertIn("SPACE=RAS", comments)
            self.assertNotIn("SPACE=LPS", comments)

    def test_normals_that_point_inward_are_turned_outward(self):
        ball, faces = sphere(1)
        hollow, inner = sphere(1, 14.0)
        tube, sides = cylinder(10, 6)
        wall = np.vstack([faces, inner[:, ::-1] + len(ball)])
        for vertices, triangles in [(ball, faces), (tube, sides), (np.vstack([ball, hollow]), wall)]:
            write_ply(self.path("outward.ply"), vertices, triangles)
            write_ply(self.path("inward.ply"), vertices, triangles[:, ::-1])
            made = []
            for name, kinds in ("outward.ply", []), ("inward.ply", ["faces inward"]):
                for method in "fit", "barycentre":
                    for coarse in {"outward.ply", name}:
                        record, error = self.relax(self.path(coarse), self.path(name), self.out, "--method", method,
                                                   "--max-iterations", 1, "--force")
                        given = kinds if coarse == "outward.ply" else kinds[:1]
                        self.assertEqual([k for k in record["warning_kinds"] if "faces" in k], given, error)
                        made.append(self.flux(Ply(self.out)))
            self.assertEqual(set(made), {made[0]})

    @staticmethod
    def flux(ply):
        """Which way the facets face, in the mean, along the way from the middle."""
        a, b, c = ply.corners()
        middle = ply.vertices.mean(0)
        return np.sign(np.einsum("ij,ij->", np.cross(b - a, c - a), (a + b + c) / 3 - middle))

    def test_half_a_ball_has_no_inside(self):
        ball, faces = sphere(3)
        half = faces[ball[faces].mean(1)[:, 2] > 0]
        for name, triangles in ("half.ply", half), ("other.ply", half[:, ::-1]):
            write_ply(self.path(name), ball, triangles)
            record, error = self.relax(self.path(name), self.path(name), self.out, "--shells", 100,
                                       "--max-iterations", 1, "--force")
            self.assertNotIn("inward", error)
            self.assertEqual(self.flux(Ply(self.out)), 1 if name == "half.ply" else -1)

    def test_open_seams_are_said(self):
        ball, faces = sphere(3)
        below = (ball[faces].mean(1)[:, 2] < 0)[:, None]
        write_ply(self.path("glued.ply"), np.vstack([ball, ball + 1e-6]), faces + below * len(ball))
        record, error = self.relax(self.path("glued.ply"), self.path("glued.ply"), self.out, "--shells", 200,
                                   "--max-iterations", 1)
        self.assertIn("open seam", record["warning_kinds"])
        self.assertIn("--repair", error)

    def test_what_is_said_of_voxels_goes_on(self):
        for name in "target.ply", "coarse.ply":
            with open(self.path(name), "rb") as file:
                content = file.read()
            with open(self.path(name), "wb") as file:
                file.write(content.replace(b"comment units mm", b"comment units mm\ncomment voxel 0.5 0.5 2 mm", 1))
            self.relax(self.coarse, self.target, self.out, "--method", "barycentre", "--max-iterations", 1, "--force")
            self.assertIn("voxel 0.5 0.5 2 mm", Ply(self.out).comments)

    def test_existing_output_is_5_unless_forced(self):
        with open(self.out, "w") as file:
            file.write("kept")
        self.relax(self.coarse, self.target, self.out, code=5)
        with open(self.out) as file:
            self.assertEqual(file.read(), "kept")
        self.relax(self.coarse, self.target, self.out, "--max-iterations", 1, "--force")
        self.relax(self.coarse, self.target, self.path("no/such/folder.ply"), code=5)

    def test_picture_range_belongs_to_a_picture(self):
        self.relax(self.coarse, self.target, self.out, "--picture-range", "1%", code=2)
        picture = self.path("map.png")
        self.relax(self.coarse, self.target, self.out, "--method", "barycentre", "--max-iterations", 1, "--picture", picture,
                   "--picture-range", "1%")
        with open(picture, "rb") as file:
            self.assertEqual(file.read(8), b"\x89PNG\r\n\x1a\n")

    def test_when_a_later_output_fails_no_finished_one_stays(self):
        names = [self.path(name) for name in ("curved.ply", "map.ply", "picture.png")]
        os.mkdir(names[2] + ".part")  # nothing can be written there
        self.relax(self.coarse, self.target, self.out, "--max-iterations", 1, "--curved", names[0], "--map", names[1],
                   "--picture", names[2], code=5)
        for name in (self.out, *names):
            self.assertFalse(os.path.exists(name), name)

    def test_a_mismatch_of_boundaries_is_said(self):
        write_ply(self.coarse, *sphere(1, 12))
        self.relax(self.coarse, self.target, self.out, "--max-iterations", 1, says="boundary loop")

    def test_an_interrupt_leaves_the_best_mesh(self):
        write_ply(self.target, *sphere(4))
        write_ply(self.coarse, *sphere(0))
        run = self.start_tool("relax", self.coarse, self.target, self.out, "--tolerance", "0.00001%", "--refine", "--method",
                              "barycentre", "--verbose")
        lines = []
        while sum("shells:" in line for line in lines) < 2:
            lines.append(run.stderr.readline())
            self.assertTrue(lines[-1], "".join(lines))
        run.send_signal(signal.SIGINT)
        self.assertRegex(run.stderr.read(), r"the best mesh so far, \d+ shells, is in .*\.part")
        self.assertEqual(run.wait(60), 130)
        self.assertFalse(os.path.exists(self.out))
        self.assertGreaterEqual(len(Ply(self.out + ".part").triangles), 20)


class Fit(Case):
    """The default method."""

    def setUp(self):
        super().setUp()
        self.target, self.out = self.path("target.ply"), self.path("shell.ply")
        write_ply(self.target, *cylinder(48, 30))

    def test_tolerance_finds_its_own_count_from_the_target_alone(self):
        record, _ = self.relax(self.target, self.target, self.out, "--tolerance", "0.3%")
        result = record["result"]
        self.assertTrue(result["reached"])
        self.assertLessEqual(result["hausdorff_percent"]["upper"], 0.3)
        self.assertLess(result["shells"], 60)
        self.assertEqual(len(Ply(self.out).triangles), result["shells"])
        self.assertEqual(result["self_intersections"], 0)
        self.assertGreater(len(result["iterations"]), 0)
        # Both ends, as curves, and as whoever measures the file finds them.
        boundary = result["boundary_percent"]
        self.assertLessEqual(boundary["upper"], 0.3)
        self.assertLessEqual(boundary["lower"], boundary["upper"])
        measured = self.run_tool("compare", "--shell", self.out, self.target)["result"]["boundary_percent"]
        self.assertLessEqual(measured["lower"], boundary["upper"])
        self.assertGreaterEqual(measured["upper"], boundary["lower"])
        # A limit of shells that only a search for the fewest keeps is kept.
        fewest = result["shells"]
        record, _ = self.relax(self.target, self.target, self.out, "--tolerance", "0.3%", "--max-shells", fewest, "--force")
        self.assertTrue(record["result"]["reached"])
        self.assertLessEqual(record["result"]["shells"], fewest)

    def test_count_is_kept_and_threads_do_not_matter(self):
        record, _ = self.relax(self.target, self.target, self.out, "--shells", 60, "--max-iterations", 1, "--threads", 1)
        self.assertLessEqual(record["result"]["shells"], 60)
        self.assertIsNone(record["result"]["reached"])
        other = self.path("other.ply")
        self.relax(self.target, self.target, other, "--shells", 60, "--max-iterations", 1, "--threads", 2)
        first, second = Ply(self.out), Ply(other)
        self.assertTrue((first.fields == second.fields).all() and (first.faces == second.faces).all())

    def test_refine_keeps_coarse_and_splits_it_where_the_tolerance_asks(self):
        coarse = self.path("coarse.ply")
        write_ply(coarse, *cylinder(12, 6, radius=10.1))
        record, _ = self.relax(coarse, self.target, self.out, "--tolerance", "1%", "--refine")
        self.assertEqual(record["result"]["shells"], 144)
        self.assertLess(record["result"]["hausdorff_percent"]["upper"], 0.2)
        self.assertGreaterEqual(record["result"]["min_angle_deg"], 20)
        record, _ = self.relax(coarse, self.target, self.out, "--tolerance", "0.05%", "--refine", "--force")
        self.assertGreaterEqual(record["result"]["shells"], 144)
        self.assertLessEqual(record["result"]["hausdorff_percent"]["upper"], 0.05)

    def test_coarse_that_faces_the_other_way_is_turned_around(self):
        vertices, triangles = cylinder(12, 6, radius=10.1)
        write_ply(self.path("coarse.ply"), vertices, triangles[:, ::-1])
        record, error = self.relax(self.path("coarse.ply"), self.target, self.out, "--tolerance", "1%", "--refine")
        self.assertIn("turned around", error)
        self.assertLess(record["result"]["hausdorff_percent"]["upper"], 0.2)

    def test_fewer_shells_than_the_topology_needs_are_4(self):
        self.relax(self.target, self.target, self.out, "--shells", 3, code=4, says="pieces, holes and handles")
        self.assertLess(len(Ply(self.out + ".part").triangles), 40)

    def test_triangles_without_area_are_3(self):
        line, points = self.path("line.ply"), np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [4.0, 0, 0]])
        write_ply(line, points, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
        for rules in (["--shells", 4], ["--tolerance", "1%"], ["--refine", "--tolerance", "1%"],
                      ["--surface", "watertight", "--tolerance", "1%"]):
            _, error = self.relax(line, line, self.out, *rules, code=3)
            self.assertRegex(error, "no area|without area")
            self.assertFalse(os.path.exists(self.out))

    def test_spikes_without_area_make_no_shells(self):
        n = 14
        vertices = [(x, y, 0.1 * np.sin(0.4 * x)) for y in range(n + 1) for x in range(n + 1)]
        triangles = [t for y in range(n) for x in range(n) for a in [y * (n + 1) + x]
                     for t in [(a, a + 1, a + n + 2), (a, a + n + 2, a + n + 1)]]
        spiked = self.path("spiked.ply")
        roots = [(y * (n + 1), (y + 1) * (n + 1)) for y in range(2, n - 1, 3)]
        for _, end in roots:
            vertices[end] = (-0.5, *vertices[end][1:])
        for length, rules, code in ((0.2, ["--tolerance", "2%"], 0), (3, ["--tolerance", "2%"], 4),
                                      (3, ["--shells", 40], 0), (3, ["--refine", "--tolerance", "20%"], 0),
                                      (3, ["--method", "barycentre", "--max-iterations", 2], 0)):
            tips = []  # on the lines of boundary edges
            for start, end in roots:
                along = np.subtract(vertices[end], vertices[start])
                tips.append(np.array(vertices[end]) + length * along / np.linalg.norm(along))
            write_ply(spiked, vertices + tips, triangles + [(*root, len(vertices) + i) for i, root in enumerate(roots)])
            record, said = self.relax(spiked, spiked, self.out, *rules, "--force", code=code)
            self.assertIn("spikes without area, up to", said)
            result = record["result"]
            self.assertGreater(result["min_angle_deg"], 1)
            self.assertGreater(result["hausdorff_mm"]["upper"], 0.4 * length)
            self.assertEqual(result["reached"], {0: True if "--tolerance" in rules else None, 4: False}[code])
            if code == 4:
                self.assertIn("no shells reach the target's spikes without area", said)
                self.assertLess(len(Ply(self.out + ".part").triangles), 60)

    def test_caps_without_area_make_no_creases(self):
        ball, faces = sphere(3)
        vertices, owner, used, capped = list(ball), {}, set(), []
        for t in map(tuple, faces):
            owner.update({(t[k], t[(k + 1) % 3]): t for k in range(3)})
        for t in map(tuple, faces):
            a, b, c = t
            if len(vertices) < len(ball) + 40 and t not in used and owner[b, a] not in used:
                used |= {t, owner[b, a]}
                capped += [(a, len(vertices), c), (len(vertices), b, c), (a, b, len(vertices))]
                vertices.append((vertices[a] + vertices[b]) / 2)
            else:
                capped.append(t)
        write_ply(self.path("plain.ply"), ball, faces)
        write_ply(self.path("caps.ply"), vertices, capped)
        plain, caps = [self.relax(self.path(name), self.path(name), self.out, "--shells", 300, "--force")[0]["result"]
                       for name in ("plain.ply", "caps.ply")]
        self.assertLess(caps["hausdorff_mm"]["upper"], 1.5 * plain["hausdorff_mm"]["upper"])

    def test_angles_below_the_usual_are_told(self):
        wedge = self.path("wedge.ply")
        write_ply(wedge, [[0, 0, 0], [40, 0, 0], [40, 4, 0], [20, 6, 0]], [[0, 1, 2], [0, 2, 3]])
        record, said = self.relax(wedge, wedge, self.out, "--tolerance", "0.5%")
        self.assertLess(record["result"]["min_angle_deg"], 20)
        self.assertIn("below 20", said)

    def test_more_shells_than_the_target_has_triangles_are_the_target(self):
        record, _ = self.relax(self.target, self.target, self.out, "--shells", 100000)
        self.assertEqual(record["result"]["shells"], 2880)
        self.assertIn("fewer than asked for", record["warning_kinds"])
        self.assertIn("2880 shells instead of 100000", "".join(record["warnings"]))
        self.assertLess(record["result"]["hausdorff_percent"]["upper"], 0.1)

    def test_pieces_sheets_and_crumbs_are_kept(self):
        ball, faces = sphere(2)
        crumb = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]) + [30, 0, 0]
        sheet = np.array([[30, 10, 0], [34, 10, 0], [30, 14, 1], [34, 14, 0.0]])
        write_ply(self.path("pieces.ply"), np.vstack([ball, crumb, sheet]),
                  np.vstack([faces, np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]) + len(ball),
                             np.array([(0, 1, 2), (1, 3, 2)]) + len(ball) + 4]))
        record, _ = self.relax(self.path("pieces.ply"), self.path("pieces.ply"), self.out, "--tolerance", "0.5%")
        self.assertLessEqual(record["result"]["hausdorff_percent"]["upper"], 0.5)
        self.assertLess(record["result"]["shells"], 120)
        triangles = Ply(self.out).triangles
        self.assertEqual(len(triangles), record["result"]["shells"])

    def test_a_surface_of_another_topology_is_covered_as_far_as_it_can_be(self):
        write_ply(self.path("closed.ply"), *sphere(1, 12))
        record, error = self.relax(self.path("closed.ply"), self.target, self.out, "--tolerance", "1%", code=4)
        self.assertIn("boundary loop", error)
        self.assertIn("not reached", error)
        self.assertTrue(os.path.exists(self.out + ".part"))

    def test_tolerance_that_the_count_does_not_allow_is_4(self):
        for most in ("--shells", "--max-shells"):
            record, _ = self.relax(self.target, self.target, self.out, "--tolerance", "0.3%", most, 20,
                                   "--max-iterations", 1, code=4)
            self.assertIs(record["result"]["reached"], False)
            self.assertLessEqual(record["result"]["shells"], 20)
            self.assertTrue(os.path.exists(self.out + ".part"))
            os.remove(self.out + ".part")


    def test_a_smooth_surface_has_one_normal_per_node_and_no_gaps(self):
        vertices, triangles = sphere(3)
        vertices *= 1 + 0.12 * np.sin(vertices[:, :1] / 6) * np.cos(vertices[:, 1:2] / 8)
        wavy = self.path("wavy.ply")
        write_ply(wavy, vertices, triangles)
        for surface, widest in (("watertight", 1e-9), ("comas", 5)):
            record, _ = self.relax(wavy, wavy, self.out, "--tolerance", "1%", "--surface", surface, "--force")
            result = record["result"]
            self.assertTrue(result["reached"])
            self.assertEqual(result["self_intersections"], 0)
            with open(self.out, "rb") as file:
                self.assertNotIn(b"corner_normals", file.read(4096))
            self.assertLessEqual(result["gap_mm"], widest)
            self.assertGreaterEqual(result["size_ratio"], 1)
            self.assertLess(result["mean_distance_mm"], result["hausdorff_mm"]["upper"])
            self.assertLess(result["normal_error_deg"]["mean"], result["normal_error_deg"]["max"])

    def test_refining_without_a_tolerance_splits_every_shell_in_four(self):
        coarse = self.path("coarse.ply")
        write_ply(coarse, *cylinder(12, 6, radius=10.1))
        record, _ = self.relax(coarse, self.target, self.out, "--refine")
        self.assertEqual([i["shells"] for i in record["result"]["iterations"]], [144, 576])
        self.assertEqual(record["result"]["shells"], 576)
        record, _ = self.relax(coarse, self.target, self.out, "--refine", "--max-shells", 2400, "--force")
        self.assertEqual(record["result"]["shells"], 2304)

    def test_angles_are_kept_that_are_asked_for(self):
        vertices, triangles = cylinder(60, 24, radius=1, length=4)
        tube = self.path("tube.ply")
        write_ply(tube, vertices, triangles)
        shells = {}
        for angle in (8, 25):
            record, _ = self.relax(tube, tube, self.out, "--tolerance", "0.5%", "--min-angle", angle, "--force")
            self.assertTrue(record["result"]["reached"])
            self.assertGreaterEqual(record["result"]["min_angle_deg"], angle)
            shells[angle] = record["result"]["shells"]
        self.assertLess(shells[8], 1.1 * shells[25])  # a greedy search: a few shells more or fewer

    def test_a_mean_distance_in_parts_of_the_wall(self):
        bumpy = self.path("bumpy.ply")
        vertices, triangles = sphere(3)
        write_ply(bumpy, vertices * (1 + 0.05 * np.sin(vertices[:, :1] / 4) * np.cos(vertices[:, 1:2] / 5)), triangles)
        coarse = self.path("coarse.ply")
        write_ply(coarse, *sphere(1))
        counts = {}
        for thickness, words in (("4mm", (coarse, bumpy, self.out, "--refine")), ("16mm", (bumpy, bumpy, self.out))):
            record, _ = self.relax(*words, "--tolerance", "2%t", "--thickness", thickness, "--force")
            result, wanted = record["result"], 0.02 * float(thickness[:-2])
            self.assertTrue(result["reached"])
            self.assertLessEqual(result["mean_distance_bound_mm"], wanted)
            self.assertLessEqual(result["mean_distance_mm"], result["mean_distance_bound_mm"])
            counts[thickness] = result["shells"]
        self.assertLess(counts["16mm"], counts["4mm"])
        record, error = self.relax(coarse, bumpy, self.out, "--refine", "--tolerance", "1%t", "--thickness", "1mm",
                                   "--max-shells", 90, "--force", code=4)
        self.assertIs(record["result"]["reached"], False)
        self.assertIn("a mean distance of", error)
        for arguments, says in ((("--tolerance", "2%t"), "give --thickness too"), (("--thickness", "1mm"), "belongs to"),
                                (("--tolerance", "2t", "--thickness", "1mm"), "percentage"),
                                (("--tolerance", "1%", "--thickness", "1mm"), "belongs to"),
                                (("--tolerance", "0%t", "--thickness", "1mm"), "greater than zero")):
            self.relax(bumpy, bumpy, self.out, *arguments, "--force", code=2, says=says)

    def test_an_angle_that_cannot_be_kept_is_told(self):
        corners = np.array([[0, 0, 0], [40, 0, 0], [40, 4, 0], [20, 6, 0]], float)
        wedge = self.path("wedge.ply")
        write_ply(wedge, corners, [[0, 1, 2], [0, 2, 3]])
        record, err = self.relax(wedge, wedge, self.out, "--tolerance", "0.5%", "--min-angle", 20)
        self.assertLess(record["result"]["min_angle_deg"], 20)
        self.assertIn("the smallest angle of the shells is", err)


class MidSurface(Case):
    def setUp(self):
        super().setUp()
        self.ball, self.out = self.path("ball.ply"), self.path("out.ply")
        write_ply(self.ball, *sphere(3, 10.0))

    def points(self):
        return Ply(self.out).vertices

    def test_of_a_sphere_is_a_sphere_half_a_wall_away(self):
        write_ply(self.ball, *sphere(4, 10.0))
        for face, radius in (("outer", 9.0), ("inner", 11.0)):
            with self.subTest(face):
                record, said = self.relax(self.ball, self.ball, self.out, "--shells", 300, "--mid-surface", face, "--thickness",
                                          "2mm", "--max-iterations", 1, "--force")
                # A pressure inside acts on the inner face.
                ratio = float(re.search(r"IMAGED_AT\) by ([0-9.]+), unless", said)[1])
                self.assertAlmostEqual(ratio, (radius / (radius - 1)) ** 2, delta=0.005)
                result = record["result"]["mid_surface"]
                self.assertEqual(result["thickness_mm"], {"min": 2, "max": 2})
                self.assertLess(result["error_mm"]["max"], 0.02)
                np.testing.assert_allclose(np.linalg.norm(self.points(), axis=1), radius, atol=0.012)

    def test_of_a_box_has_its_sides_half_a_wall_inside(self):
        corners = np.array([(x, y, z) for x in (0, 8) for y in (0, 6) for z in (0, 4)], float)
        sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
        box = self.path("box.ply")
        write_ply(box, corners, [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])
        record, _ = self.relax(box, box, self.out, "--tolerance", "1%", "--mid-surface", "outer", "--thickness", "1mm",
                               "--max-iterations", 1)
        points = self.points()
        np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], [(0.5, 0.5, 0.5), (7.5, 5.5, 3.5)], atol=0.1)
        self.assertLess(record["result"]["mid_surface"]["error_mm"]["mean"], 0.02)

    def test_of_a_cut_tube_is_a_cut_tube(self):
        tube = self.path("tube.ply")
        write_ply(tube, *cylinder(48, 20))
        for face, radius in (("outer", 9.0), ("inner", 11.0)):
            with self.subTest(face):
                record, _ = self.relax(tube, tube, self.out, "--tolerance", "0.3%", "--mid-surface", face, "--thickness",
                                       "2mm", "--max-iterations", 1, "--force")
                result = record["result"]
                self.assertLessEqual(result["hausdorff_percent"]["upper"], 0.3)
                self.assertLessEqual(result["boundary_percent"]["upper"], 0.3)
                self.assertLess(result["mid_surface"]["error_mm"]["mean"], 0.01)
                points = self.points()
                np.testing.assert_allclose(np.linalg.norm(points[:, :2], axis=1), radius, atol=0.03)
                np.testing.assert_allclose([points[:, 2].min(), points[:, 2].max()], [0, 30], atol=0.03)

    def test_what_a_pressure_on_the_middle_is_off_by_is_told(self):
        """A tube's middle is wider than its inner face, of radius 10 here or 8, by the ratio of the radii."""
        tube = self.path("tube.ply")
        write_ply(tube, *cylinder(32, 12))
        for face, thickness, ratio in (("inner", 2, 11 / 10), ("outer", 2, 9 / 8), ("inner", 0.5, None)):
            _, error = self.relax(tube, tube, self.out, "--shells", 200, "--mid-surface", face, "--thickness", f"{thickness}mm",
                                  "--max-iterations", 1, "--force")
            said = re.search(r"IMAGED_AT\) by ([0-9.]+)", error)
            self.assertEqual(said is None, ratio is None, error)
            if said:
                self.assertAlmostEqual(float(said.group(1)), ratio, delta=0.01)

    def test_a_face_that_says_to_be_the_other_one_is_refused(self):
        tube = self.path("tube.ply")
        write_ply(tube, *cylinder(16, 6))
        with open(tube, "rb") as file:
            said = file.read().replace(b"\nelement vertex", b"\ncomment face inner\nelement vertex", 1)
        with open(tube, "wb") as file:
            file.write(said)
        self.relax(tube, tube, self.out, "--mid-surface", "outer", "--thickness", "1mm", code=3, says="is the inner face of a wall")

    def test_by_the_papers_rule_and_with_coarse_triangles_kept(self):
        coarse = self.path("coarse.ply")
        write_ply(coarse, *sphere(2, 10.0))
        for words in (["--method", "barycentre"], ["--refine", "--tolerance", "0.3%"]):
            record, _ = self.relax(coarse, self.ball, self.out, *words, "--mid-surface", "inner", "--thickness", "2mm",
                                   "--force")
            self.assertGreaterEqual(record["result"]["shells"], 320)
            self.assertLess(record["result"]["mid_surface"]["error_mm"]["mean"], 0.05)

    def test_a_face_turned_inward_is_turned_around(self):
        points, triangles = sphere(3, 10.0)
        write_ply(self.ball, points, triangles[:, ::-1])
        self.relax(self.ball, self.ball, self.out, "--shells", 300, "--mid-surface", "inner", "--thickness", "2mm",
                   "--max-iterations", 1, says="its normals point inward")
        np.testing.assert_allclose(np.linalg.norm(self.points(), axis=1), 11, atol=0.05)

    def narrow_torus(self):
        """Its hole is narrower than half of a wall of 3 mm."""
        u, v = np.meshgrid(np.arange(48), np.arange(24), indexing="ij")
        a, b = 2 * np.pi * u / 48, 2 * np.pi * v / 24
        points = np.stack([(6 + 5 * np.cos(b)) * np.cos(a), (6 + 5 * np.cos(b)) * np.sin(a), 5 * np.sin(b)], -1).reshape(-1, 3)
        at = lambda i, j: i % 48 * 24 + j % 24
        triangles = [t for i in range(48) for j in range(24)
                     for t in ((at(i, j), at(i + 1, j), at(i + 1, j + 1)), (at(i, j), at(i + 1, j + 1), at(i, j + 1)))]
        torus = self.path("torus.ply")
        write_ply(torus, points, triangles)
        return torus, torus, self.out, "--mid-surface", "inner", "--thickness", "3mm"

    def test_a_gap_that_half_of_the_wall_closes_is_told_and_its_funnels_come_within_most_tolerances(self):
        """Which edits the search takes hangs on the last digits of the mesh, which numpy computes anew on each processor."""
        words = self.narrow_torus()
        reached = 0
        for tolerance in ("4%", "3%", "2.5%"):
            record, _ = self.relax(*words, "--force", "--tolerance", tolerance, "--max-iterations", "1", code=(0, 4),
                                   says="0 rim(s) and 0 handle(s), TARGET has 0 and 1")
            self.assertEqual(record["result"]["self_intersections"], 0)
            reached += record["ok"]
        self.assertGreaterEqual(reached, 2)

    def test_between_two_faces_measures_the_thickness(self):
        inner = self.path("inner.ply")
        points, triangles = sphere(3, 8.0)
        write_ply(inner, points + [0.5, 0, 0], triangles)
        record, _ = self.relax(self.ball, self.ball, self.out, "--shells", 300, "--mid-surface", "outer", "--other-face", inner,
                               "--max-iterations", 1)
        thickness = record["result"]["mid_surface"]["thickness_mm"]
        self.assertAlmostEqual(thickness["min"], 1.5, delta=0.02)
        self.assertAlmostEqual(thickness["max"], 2.5, delta=0.02)
        with open(self.out, "rb") as file:
            self.assertIn(b"property double thickness\n", file.read(2000))
        scene = ('[run]\nkind = "static"\n[[shell]]\nname = "s"\nmesh = "out.ply"\nthickness_from = "thickness"\n'
                 'young = "1MPa"\npoisson = 0.3\n[[fix]]\nbody = "s"\nwhere = {rigid_motions = true}\n'
                 '[[load]]\nbody = "s"\nkind = "pressure"\nvalue = "1kPa"\n')
        self.run_tool("simulate", "--scene", self.write("scene.toml", scene), "out.hdf", "--quiet")
        self.relax(self.ball, self.ball, self.out, "--shells", 300, "--mid-surface", "inner", "--other-face", inner,
                   "--force", code=3, says="the wall's other face lies inside the target")
        self.relax(self.ball, self.ball, self.out, "--shells", 300, "--mid-surface", "outer", "--other-face", self.ball,
                   "--force", code=3, says="is it the other face of the wall?")

    def test_a_wall_thicker_than_its_body_is_refused(self):
        self.relax(self.ball, self.ball, self.out, "--shells", 300, "--mid-surface", "outer", "--thickness", "21mm",
                   code=4, says="ball.ply: no point inside is half of the wall, 10.5 mm, away")
        self.assertFalse(os.path.exists(self.out))

    def test_wrong_usage_is_2(self):
        for arguments, says in ((("--mid-surface", "outer"), "needs the wall's thickness"),
                                (("--mid-surface", "middle", "--thickness", "1mm"), "middle"),
                                (("--mid-surface", "outer", "--thickness", "0mm"), "greater than zero"),
                                (("--mid-surface", "outer", "--thickness", "1"), "has no unit"),
                                (("--other-face", self.ball), "belongs to --mid-surface")):
            self.relax(self.ball, self.ball, self.out, "--shells", 300, *arguments, code=2, says=says)


    def test_the_middle_of_a_wall_has_no_target_and_is_judged_on_its_own(self):
        """Half a wall away lies another surface, whose answers are others."""
        middle = self.path("middle.ply")
        self.relax(self.ball, self.ball, middle, "--shells", 320, "--mid-surface", "inner", "--thickness", "1mm")
        held = ["--poisson", 0.45, "--thickness", "1mm", "--imaged-at", "10kPa", "--fix", "rigid-motions", "--static", "--force"]
        self.run_tool("simulate", middle, self.path("out.hdf"), *held, "--target", self.ball, code=3,
                      says="moved to the middle of the wall")
        report = self.run_tool("simulate", middle, self.path("out.hdf"), *held)
        self.assertNotIn("coarse", " ".join(report["warnings"]))
        estimate = report["result"]["estimates"]["membrane_p99_mpa"]
        radius = np.linalg.norm(Ply(middle).vertices, axis=1).mean()
        self.assertLess(abs(report["result"]["wall"]["membrane_p99_mpa"] / (10e-3 * radius / 2) - 1), 0.02)
        self.assertLess(estimate["percent"], 5)
        claim = self.run_tool("simulate", middle, self.path("out.hdf"), *held, "--accuracy", "2%", "--of", "membrane")
        self.assertNotIn("--target", " ".join(claim["warnings"]))
        self.assertLess(abs(claim["result"]["accuracy"]["value"] / (10e-3 * radius / 2) - 1), 0.02)


class Patch(Case):
    def test_the_file_alone_gives_the_curved_surface(self):
        vertices, triangles = sphere(3)
        vertices *= 1 + 0.15 * np.sin(vertices[:, :1] / 7) * np.cos(vertices[:, 1:2] / 5)
        coarse, coarse_triangles = sphere(1)
        write_ply(self.path("target.ply"), vertices, triangles)
        write_ply(self.path("coarse.ply"), coarse, coarse_triangles)
        self.relax(self.path("coarse.ply"), self.path("target.ply"), self.path("shell.ply"), "--surface", "comas",
                   "--curved", self.path("curved.ply"))
        shell, curved = Ply(self.path("shell.ply")), Ply(self.path("curved.ply"))
        points, triangles, normals = shell.vertices, shell.triangles, shell.corner_normals()
        curved, fine = curved.vertices, curved.triangles
        size = np.linalg.norm(points.max(0) - points.min(0))

        # The fine vertices come patch by patch: a grid of level m has (m + 1)(m + 2) / 2 of them, rows along corner 3.
        used, fine_used = 0, 0
        for corners, facet_normals in zip(triangles, normals):
            level = 1
            while not (np.array_equal(curved[used], points[corners[0]])
                       and used + (level + 1) * (level + 2) // 2 <= len(curved)
                       and np.array_equal(curved[used + level], points[corners[1]])
                       and np.array_equal(curved[used + (level + 1) * (level + 2) // 2 - 1], points[corners[2]])):
                level += 1
                self.assertLess(level, 1000)
            b = np.array([(level - i - j, i, j) for j in range(level + 1) for i in range(level + 1 - j)]) / level
            expected = patch_points(points[corners], facet_normals, b)
            block = curved[used:used + len(b)]
            self.assertLess(np.abs(block - expected).max(), 1e-9 * size)
            # Within 0.001 % of the diagonal: the middles of the fine triangles against the patch at their parameters.
            cells = fine[fine_used:fine_used + level**2] - used
            middles = patch_points(points[corners], facet_normals, b[cells].mean(1))
            self.assertLess(np.linalg.norm(block[cells].mean(1) - middles, axis=1).max(), 1e-5 * size)
            used += len(b)
            fine_used += level**2
        self.assertEqual(used, len(curved))
        self.assertEqual(fine_used, len(fine))


class Spikes(Case):
    def test_a_tolerance_holds_at_a_spike_and_in_a_hole_as_narrow_as_its_triangles(self):
        vertices, triangles = sphere(5)
        vertices /= np.linalg.norm(vertices, axis=1)[:, None]
        near = np.clip(1 - np.linalg.norm(vertices - [0.6, 0.48, 0.64], axis=1) / 0.04, 0, None)[:, None]
        for depth in (0.3, -0.3):
            with self.subTest(depth):
                write_ply(self.path("spiky.ply"), 10 * vertices * (1 + depth * near), triangles)
                result = self.relax(self.path("spiky.ply"), self.path("spiky.ply"), self.path("shell.ply"), "--tolerance", "1%",
                                    "--force")[0]["result"]
                self.assertLessEqual(result["hausdorff_percent"]["upper"], 1)
                self.assertEqual(result["self_intersections"], 0)


@unittest.skipUnless(MESHES.is_dir(), f"no real organs in {MESHES}")
class Organs(Case):
    def test_a_tolerance_holds_whatever_the_order_of_the_vertices(self):
        """A gallbladder with the rest of its duct, and a stomach with a dent."""
        for name in ("sofaenv_gallbladder.stl", "openhelp_stomach.stl"):
            surface = self.path("surface.ply")
            self.run_tool("decimate", MESHES / name, surface, "--max-error", "0.001%", "--mesh-unit", "mm", "--force")
            mesh = Ply(surface)
            order = np.random.default_rng(1).permutation(len(mesh.vertices))
            place = np.argsort(order)
            for vertices, triangles in ((mesh.vertices, mesh.triangles), (mesh.vertices[order], place[mesh.triangles])):
                write_ply(surface, vertices, triangles)
                result = self.relax(surface, surface, self.path("shell.ply"), "--tolerance", "1%", "--force")[0]["result"]
                self.assertLessEqual(result["hausdorff_percent"]["upper"], 1, name)
                self.assertEqual(result["self_intersections"], 0, name)

    def test_an_open_aorta_within_a_percent_takes_no_more_shells_than_well_shaped_flat_triangles(self):
        target, unit = MESHES / "vmtk_aorta_open.stl", ["--mesh-unit", "mm"]
        flat = self.run_tool("decimate", target, "flat.ply", *unit, "--max-error", "1%", "--min-angle", 20)
        triangles = flat["result"]["triangles"]
        record, _ = self.relax(target, target, self.path("shell.ply"), *unit, "--tolerance", "1%")
        result = record["result"]
        self.assertLessEqual(result["hausdorff_percent"]["upper"], 1)
        self.assertLessEqual(result["boundary_percent"]["upper"], 1)
        self.assertLessEqual(result["shells"], triangles)
        self.assertGreaterEqual(result["min_angle_deg"], 20 - 1e-6)
        self.assertEqual(result["self_intersections"], 0)


    def test_middle_of_the_wall_of_an_aorta_whose_crotch_is_sharper_than_the_wall(self):
        # The lumen of a real aorta with its branches, closed and cut open.
        for name, rims in (("vmtk_aorta_gold.stl", 0), ("vmtk_aorta_open.stl", 3)):
            with self.subTest(name):
                lumen = MESHES / name
                record, error = self.relax(lumen, lumen, self.path("shell.ply"), "--mesh-unit", "mm", "--tolerance", "1%",
                                           "--mid-surface", "inner", "--thickness", "1.5mm", "--force")
                self.assertIn("its normals point inward", error)
                self.assertNotIn("rim(s)", error)
                result = record["result"]
                self.assertEqual(result["self_intersections"], 0)
                self.assertEqual(result["boundary_percent"] is None, rims == 0)
                self.assertLess(result["mid_surface"]["error_mm"]["mean"], 0.2)


@unittest.skipUnless(PAPER.is_dir(), f"no paper meshes in {PAPER}")
class PaperTargets(Case):
    """By the paper's rule."""

    method = ["--method", "barycentre"]

    def decimated(self, target, count):
        out = self.path("coarse.ply")
        self.run_tool("decimate", target, out, "--triangles", count, "--min-angle", 10, "--mesh-unit", "mm", "--force")
        return out

    def error(self, coarse, name, *arguments):
        record, _ = self.relax(coarse, PAPER / name, self.path("shell.ply"), "--mesh-unit", "mm", "--force",
                               *arguments)
        return record["result"]

    def test_cylinder_is_below_the_flat_mesh_and_one_split_brings_a_tenth(self):
        coarse = PAPER / "cylinderLowRes.obj"
        first = self.error(coarse, "cylinderHighRes.obj", "--max-iterations", 1)
        self.assertEqual(first["shells"], 40)
        self.assertLess(first["hausdorff_percent"]["upper"], 2.01 * 0.6)  # the same shells with plain normals: 2.01
        split = self.error(coarse, "cylinderHighRes.obj", "--max-iterations", 2, "--refine")
        self.assertEqual(split["shells"], 160)
        self.assertLess(split["hausdorff_percent"]["upper"], first["hausdorff_percent"]["upper"] / 8)

    def test_liver_capsule_is_closer_than_the_papers(self):
        target = PAPER / "liverHighRes.obj"
        result = self.error(self.decimated(target, 1200), "liverHighRes.obj", "--max-iterations", 3)
        self.assertLessEqual(result["shells"], 1200)
        self.assertLess(result["hausdorff_percent"]["upper"], 4.48)  # the paper's

    def test_aneurysm_is_closer_than_the_papers_shells(self):
        target = PAPER / "aneurysmHighRes.obj"
        for count, of_the_paper in ((200, 38), (800, 5.2)):
            result = self.error(self.decimated(target, count), "aneurysmHighRes.obj", "--max-iterations", 3)
            self.assertLess(result["hausdorff_percent"]["upper"], of_the_paper / 2)

    def test_a_non_manifold_coarse_mesh_of_the_paper_is_refused_with_its_place(self):
        for name in ("liverLowRes300.obj", "liverLowRes300_iteration1.obj"):
            self.relax(PAPER / name, PAPER / "liverHighRes.obj",
                       self.path("shell.ply"), "--mesh-unit", "mm", code=3, says="near (")


if __name__ == "__main__":
    unittest.main()
