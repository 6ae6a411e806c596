"""tunica-decimate as its users run it: counts, errors kept, topology of the written file, each exit code."""
import math
import os
import unittest

import meshes
from running import SHARED, ToolTest


class Decimate(ToolTest):
    verb = "decimate"

    def surface(self, name="in.ply", level=4):
        vertices, triangles = meshes.sphere(level, 20.0)
        meshes.write_ply(self.path(name), vertices, triangles, comments=["SPACE=RAS"])
        return vertices, triangles

    def test_a_count_is_kept_with_the_topology(self):
        self.surface()
        report = self.run_tool("in.ply", "out.ply", "--triangles", 200)
        result = report["result"]
        ply = meshes.Ply(self.path("out.ply"))
        self.assertEqual(len(ply.triangles), 200)
        self.assertEqual(result["triangles"], 200)
        self.assertEqual(result["triangles_in"], 2048)
        self.assertTrue(result["manifold"])
        self.assertLessEqual(result["hausdorff_percent"]["lower"], result["hausdorff_percent"]["upper"])
        self.assertLess(result["hausdorff_percent"]["upper"], 2)
        self.assertGreater(result["hausdorff_percent"]["lower"], 0.1)
        self.assertGreater(result["min_angle_deg"], 1)
        self.assertGreater(result["mean_quality"], 0.5)
        self.assertEqual(ply.euler(), 2)
        self.assertTrue(ply.is_closed_oriented_manifold())
        self.assertIn("SPACE=RAS", ply.comments)
        self.assertIn("units mm", ply.comments)
        self.assertEqual(list(report["seconds"]), ["total", "read", "decimate", "measure", "write"])

    def test_max_error_in_percent_and_mm_agree(self):
        self.surface()
        percent = self.run_tool("in.ply", "a.ply", "--max-error", "1%")["result"]
        self.assertLessEqual(percent["hausdorff_percent"]["upper"], 1)
        mm = "%.17gmm" % (percent["diagonal_mm"] / 100)
        self.assertEqual(self.run_tool("in.ply", "b.ply", "--max-error", mm)["result"]["triangles"], percent["triangles"])
        self.assertLess(percent["triangles"], 400)

    def test_seams_are_said_and_joined(self):
        vertices, triangles = meshes.sphere(4, 10.0)
        count = len(vertices)
        below = [sum(vertices[i][2] for i in t) < 0 for t in triangles]
        for name, moved in [("exact.ply", 0), ("rounded.ply", 2e-5)]:
            glued = [tuple(i + count * b for i in t) for t, b in zip(triangles, below)]
            copies = [tuple(x + moved * (-1) ** i for x in v) for i, v in enumerate(vertices)]
            meshes.write_ply(self.path(name), vertices + copies, glued, comments=["units mm"])
            report = self.run_tool(name, "out.ply", "--triangles", 300, "--force")
            self.assertIn("open seam", report["warning_kinds"])
            self.assertIn("--repair", report["warnings"][0])
            self.assertEqual(report["result"]["boundary_loops"], 2)
            report = self.run_tool(name, "out.ply", "--triangles", 300, "--repair", "--force")
            self.assertEqual(report["warning_kinds"], [])
            self.assertEqual(report["result"]["repairs"]["joined_edges"], 128)
            self.assertEqual(report["result"]["boundary_loops"], 0)
            self.assertEqual(meshes.Ply(self.path("out.ply")).euler(), 2)

    def test_a_ply_that_says_no_unit_is_told_what_it_is_taken_for(self):
        vertices, triangles = meshes.sphere(3, 10.0)
        meshes.write_ply(self.path("bare.ply"), vertices, triangles)
        self.assertIn("taken for mm", self.run_tool("bare.ply", "out.ply", "--triangles", 300)["notes"][0])
        told = self.run_tool("bare.ply", "out.ply", "--triangles", 300, "--mesh-unit", "cm", "--force")
        self.assertEqual(told["notes"], [])

    def test_seams_that_no_repair_joins_are_not_to_be_repaired(self):
        columns, rows = 60, 4  # a band with a half twist: joined, it would have one side only
        vertices, triangles = [], []
        for i in range(columns + 1):
            turn = 2 * math.pi * i / columns
            for j in range(rows + 1):
                across = 4 * (j / rows - 0.5)
                radius = 10 + across * math.cos(turn / 2)
                vertices.append((radius * math.cos(turn), radius * math.sin(turn), across * math.sin(turn / 2)))
                if i < columns and j < rows:
                    v = i * (rows + 1) + j
                    triangles += [(v, v + rows + 1, v + 1), (v + 1, v + rows + 1, v + rows + 2)]
        meshes.write_ply(self.path("band.ply"), vertices, triangles, comments=["units mm"])
        report = self.run_tool("band.ply", "out.ply", "--triangles", 300)
        self.assertIn("open seam", report["warning_kinds"])
        self.assertIn("cannot be joined", report["warnings"][0])
        self.assertNotIn("--repair", report["warnings"][0])

    def test_t_junctions_are_said_and_split(self):
        vertices, triangles = meshes.sphere(3, 10.0)
        vertices, middles, mixed = list(vertices), {}, []

        def middle(i, j):
            if (key := (min(i, j), max(i, j))) not in middles:
                middles[key] = len(vertices)
                vertices.append(tuple((a + b) / 2 for a, b in zip(vertices[i], vertices[j])))
            return middles[key]

        for i, j, k in triangles:
            if sum(vertices[v][2] for v in (i, j, k)) > 0:
                a, b, c = middle(i, j), middle(j, k), middle(k, i)
                mixed += [(i, a, c), (j, b, a), (k, c, b), (a, b, c)]
            else:
                mixed.append((i, j, k))
        meshes.write_ply(self.path("in.ply"), vertices, mixed, comments=["units mm"])
        self.run_tool("in.ply", "out.ply", "--triangles", 300, code=3, says="32 long edges")
        apart = len(vertices)  # with vertices of their own
        halves = [t if sum(vertices[v][2] for v in t) > 0 else tuple(v + apart for v in t) for t in mixed]
        meshes.write_ply(self.path("apart.ply"), 2 * vertices, halves, comments=["units mm"])
        report = self.run_tool("apart.ply", "out.ply", "--triangles", 300)
        self.assertEqual(report["warning_kinds"], ["T-junctions"])
        self.assertIn("32 long edges", "".join(report["warnings"]))
        for name in "in.ply", "apart.ply":
            report = self.run_tool(name, "all.ply", "--triangles", 9999, "--repair", "--force")
            self.assertEqual(report["warning_kinds"], [])
            self.assertEqual(report["result"]["repairs"]["split_edges"], 32)
            self.assertEqual(report["result"]["boundary_loops"], 0)
            self.assertEqual(report["result"]["triangles"], len(mixed) + 32)

    def test_sheets_that_cross_are_said(self):
        vertices, triangles = meshes.sphere(5, 10.0)
        inner, faces = meshes.sphere(5, 9.9)
        wall = [tuple(t) for t in triangles] + [tuple(i + len(vertices) for i in t[::-1]) for t in faces]
        meshes.write_ply(self.path("in.ply"), vertices + inner, wall, comments=["units mm"])
        for flags in [], ["--min-angle", 20]:
            report = self.run_tool("in.ply", "out.ply", "--triangles", 300, *flags, "--force")
            self.assertGreater(report["result"]["self_intersections"], 0)
            self.assertEqual(report["warning_kinds"][0], "surface crosses itself")
            self.assertIn("%d pairs" % report["result"]["self_intersections"], report["warnings"][0])
        report = self.run_tool("in.ply", "out.ply", "--triangles", 12000, "--force")
        self.assertEqual(report["result"]["self_intersections"], 0)
        self.assertEqual(report["warning_kinds"], [])

    def test_a_count_that_is_not_reached_is_said(self):
        self.surface()
        report = self.run_tool("in.ply", "out.ply", "--triangles", 6400)
        self.assertEqual(report["warning_kinds"], ["fewer than asked for"])
        self.assertIn("2048 triangles instead of 6400", report["warnings"][0])
        self.assertEqual(self.run_tool("in.ply", "same.ply", "--triangles", 2048)["warning_kinds"], [])

    def test_inward_normals_are_kept_and_said(self):
        vertices, triangles = self.surface()
        meshes.write_ply(self.path("inward.ply"), vertices, [t[::-1] for t in triangles])
        report = self.run_tool("inward.ply", "out.ply", "--triangles", 200)
        self.assertEqual(report["warning_kinds"], ["faces inward"])
        self.assertEqual(self.run_tool("out.ply", "again.ply", "--triangles", 100)["warning_kinds"], ["faces inward"])
        self.assertEqual(self.run_tool("in.ply", "right.ply", "--triangles", 200)["warning_kinds"], [])

    def test_what_is_said_of_voxels_goes_on(self):
        vertices, triangles = self.surface()
        meshes.write_ply(self.path("in.ply"), vertices, triangles, comments=["SPACE=LPS", "voxel 0.8 0.8 3 mm"])
        self.run_tool("in.ply", "out.ply", "--triangles", 200)
        self.assertIn("voxel 0.8 0.8 3 mm", meshes.Ply(self.path("out.ply")).comments)

    def test_a_smallest_angle_is_kept(self):
        self.surface()
        result = self.run_tool("in.ply", "out.ply", "--triangles", 300, "--min-angle", 20)["result"]
        self.assertGreaterEqual(result["min_angle_deg"], 20)
        self.assertGreaterEqual(result["mean_quality"], 0.85)
        self.assertLessEqual(result["triangles"], 300)
        self.assertTrue(result["manifold"])
        plain = self.run_tool("in.ply", "plain.ply", "--triangles", 300, "--min-angle", 0)["result"]
        self.assertEqual((plain["min_angle_held"], plain["triangles"]), (None, 300), "0: any angle")
        self.assertLessEqual(result["hausdorff_percent"]["upper"], 2.5 * plain["hausdorff_percent"]["upper"])
        both = self.run_tool("in.ply", "both.ply", "--max-error", "1%", "--min-angle", 20)["result"]
        self.assertGreaterEqual(both["min_angle_deg"], 20)
        self.assertLessEqual(both["hausdorff_percent"]["upper"], 1)
        self.assertLess(both["triangles"], 500)

    def test_min_angle_leaves_sharp_corners_of_the_boundary(self):
        n = 40
        for tips, most in [([20], 400), ([6, 13, 20, 27, 34], 600)]:
            vertices = [(float(i), float(j), 1.5 * math.sin(0.2 * i) * math.cos(0.2 * j))
                        for j in range(n + 1) for i in range(n + 1)]
            triangles = [t for j in range(n) for i in range(n) for a in [j * (n + 1) + i]
                         for t in [(a, a + 1, a + n + 2), (a, a + n + 2, a + n + 1)]]
            for i in tips:  # 5 mm out, 11 degrees
                vertices.append((i + 0.5, -5.0, (vertices[i][2] + vertices[i + 1][2]) / 2))
                triangles.append((i + 1, i, len(vertices) - 1))
            meshes.write_ply(self.path("in.ply"), vertices, triangles, comments=["units mm"])
            result = self.run_tool("in.ply", "out.ply", "--min-angle", 20, "--max-error", "0.2mm", "--force")["result"]
            self.assertLess(result["triangles"], most)
            self.assertLessEqual(result["hausdorff_mm"]["upper"], 0.2)
            # The tips are as sharp as they were, but for chords that are 0.2 mm beside their sides; nothing else is.
            self.assertGreater(result["min_angle_deg"], 10)
            # That IN's own corners are the reason is said, with the angle.
            self.assertIs(result["min_angle_held"], True)
            said = self.run_tool("in.ply", "again.ply", "--min-angle", 20, "--max-error", "0.2mm", "--force")["warnings"]
            self.assertIn(f"the smallest angle is {result['min_angle_deg']:.3g} degrees", "\n".join(said))
            self.assertLess(result["min_angle_deg"], math.degrees(2 * math.atan(0.7 / 5)))
            ply, sharp = meshes.Ply(self.path("out.ply")), set()
            for face in ply.vertices[ply.triangles]:
                for k in range(3):
                    u, v = face[k - 2] - face[k], face[k - 1] - face[k]
                    if u @ v / math.hypot(*u) / math.hypot(*v) > math.cos(math.radians(20)):
                        sharp.add(tuple(face[k][:2]))
            self.assertEqual(sharp, {(i + 0.5, -5.0) for i in tips})

    def test_min_angle_that_cannot_be_held(self):
        strip = [(float(x), y, 0.0) for x in range(11) for y in (0.0, 0.2)]
        triangles = [t for i in range(0, 20, 2) for t in ((i, i + 2, i + 3), (i, i + 3, i + 1))]
        meshes.write_ply(self.path("in.ply"), strip, triangles)
        report = self.run_tool("in.ply", "out.ply", "--triangles", 2, "--min-angle", 20, code=4, says="smallest angle")
        angle = report["result"]["min_angle_deg"]
        self.assertLess(angle, 20)
        self.assertIn(f"{angle:.3g} degrees", report["error"])
        self.assertIs(report["result"]["min_angle_held"], False)
        self.assertTrue(self.exists("out.ply.part"))
        self.assertFalse(self.exists("out.ply"))
        wish = self.run_tool("in.ply", "out.ply", "--triangles", 2, "--min-angle", 20, "--soft-angle", "--force")
        self.assertEqual((wish["result"]["min_angle_deg"], wish["result"]["min_angle_held"]), (angle, False))
        self.assertIn("no better mesh was found", " ".join(wish["warnings"]))
        within = self.run_tool("in.ply", "out.ply", "--max-error", "1e-6mm", "--min-angle", 20, "--soft-angle", "--force")["result"]
        self.assertLessEqual(within["hausdorff_mm"]["upper"], 1e-6)

    @unittest.skipUnless((SHARED / "meshes").is_dir(), "the real meshes are absent: skipped")
    def test_min_angle_on_real_organs(self):
        for name, count in [("gca_colon_90_20k.obj", 1500), ("sofaenv_gallbladder.stl", 500), ("vmtk_aorta_open.stl", 800)]:
            given = SHARED / "meshes" / name
            result = self.run_tool(given, "out.ply", "--triangles", count, "--min-angle", 20, "--mesh-unit", "mm",
                                   "--force")["result"]
            self.assertGreaterEqual(result["min_angle_deg"], 20, name)
            self.assertGreaterEqual(result["mean_quality"], 0.85, name)
            self.assertTrue(result["manifold"], name)

    def test_threads_change_nothing(self):
        self.surface()
        self.run_tool("in.ply", "a.ply", "--max-error", "0.8%", "--threads", 1)
        self.run_tool("in.ply", "b.ply", "--max-error", "0.8%", "--threads", 4)
        a, b = meshes.Ply(self.path("a.ply")), meshes.Ply(self.path("b.ply"))
        self.assertEqual((a.vertices.tolist(), a.triangles.tolist()), (b.vertices.tolist(), b.triangles.tolist()))

    def test_boundary_stays_on_its_circle(self):
        meshes.write_ply(self.path("in.ply"), *meshes.tube(64, 40))
        self.run_tool("in.ply", "out.ply", "--triangles", 150)
        ply = meshes.Ply(self.path("out.ply"))
        rim = ply.vertices[ply.rim()[:, 0]]
        self.assertGreaterEqual(len(rim), 6)
        for x, y, z in rim:
            self.assertTrue(abs(z) < 1e-12 or abs(z - 4) < 1e-12)
            self.assertLess(abs((x * x + y * y) ** 0.5 - 1), 0.002)
        self.assertEqual(ply.euler(), 0)

    def test_a_fan_of_needles_takes_as_much_memory_as_any_mesh(self):
        n = 12_000
        rim = [(20 * math.cos(2 * math.pi * i / n), 20 * math.sin(2 * math.pi * i / n), 0.0) for i in range(n)]
        meshes.write_ply(self.path("fan.ply"), [(0.0, 0.0, 5.0)] + rim, [(0, 1 + i, 1 + (i + 1) % n) for i in range(n)])
        report = self.run_tool("fan.ply", "out.ply", "--triangles", 1200)
        self.assertEqual(report["result"]["triangles"], 1200)
        self.assertLess(report["peak_mib"], 90)

    def test_a_format_without_a_unit_claims_none(self):
        vertices, triangles = meshes.sphere(3)
        meshes.write_obj(self.path("in.obj"), vertices, triangles)
        report = self.run_tool("in.obj", "a.ply", "--triangles", 100)
        self.assertAlmostEqual(report["result"]["diagonal_mm"], 12 ** 0.5)
        self.assertIn("says no unit of length", " ".join(report["warnings"]))
        with open(self.path("a.ply"), "rb") as made:  # millimetres would be a claim that nobody made
            self.assertNotIn(b"comment units", made.read(400))
        self.run_tool("in.obj", "c.ply", "--max-error", "0.2mm", code=2, says="--mesh-unit")
        cm = self.run_tool("in.obj", "b.ply", "--triangles", 100, "--mesh-unit", "cm")["result"]
        self.assertAlmostEqual(cm["diagonal_mm"], 10 * 12 ** 0.5)

    def test_real_meshes_keep_their_topology(self):
        for name, chi in [("meshes/gca_colon_90_20k.obj", 0), ("meshes/vmtk_aorta_open.stl", -1)]:
            path = SHARED / name
            if not path.exists():
                self.skipTest(f"{path} is absent")
            result = self.run_tool(path, "out.ply", "--triangles", 1500, "--force")["result"]
            self.assertTrue(result["manifold"])
            self.assertEqual(meshes.Ply(self.path("out.ply")).euler(), chi)
            self.assertLess(result["hausdorff_percent"]["upper"], 2)

    def test_real_mesh_that_is_not_manifold(self):
        path = SHARED / "meshes" / "awkward_colon_VHF_nonmanifold.obj"
        if not path.exists():
            self.skipTest(f"{path} is absent")
        self.run_tool(path, "out.ply", "--triangles", 1500, code=3, says="195 edges are shared by three")
        self.assertFalse(self.exists("out.ply"))

    def test_wrong_usage_is_2(self):
        self.surface()
        for arguments in [[], ["--triangles", "0"], ["--triangles", "-5"], ["--triangles", "2.5"], ["--triangles", "x"],
                          ["--max-error", "1"], ["--max-error", "0%"], ["--max-error", "-1mm"], ["--nonsense"],
                          ["--triangles", "9", "--mesh-unit", "inch"]]:
            self.run_tool("in.ply", "out.ply", *arguments, code=2)
        for angle in ["-3", "45", "x", "20deg"]:
            self.run_tool("in.ply", "out.ply", "--triangles", 100, "--min-angle", angle, code=2, says="--min-angle")
        self.run_tool("in.ply", "out.ply", "--min-angle", 20, code=2, says="--triangles")
        self.assertFalse(self.exists("out.ply"))

    def test_unfit_inputs_are_3(self):
        self.run_tool("absent.ply", "out.ply", "--triangles", 100, code=3, says="absent.ply")
        vertices, triangles = self.surface()
        with open(self.path("in.ply"), "rb") as file:
            whole = file.read()
        with open(self.path("cut.ply"), "wb") as file:
            file.write(whole[:len(whole) // 2])
        self.run_tool("cut.ply", "out.ply", "--triangles", 100, code=3, says="cut.ply")
        flipped = [triangles[0][::-1]] + triangles[1:]
        meshes.write_ply(self.path("flipped.ply"), vertices, flipped)
        self.run_tool("flipped.ply", "out.ply", "--triangles", 100, code=3, says="face opposite ways")
        fin = triangles + [(triangles[0][0], triangles[0][1], len(vertices))]
        meshes.write_ply(self.path("fin.ply"), vertices + [(0.0, 0.0, 90.0)], fin)
        self.run_tool("fin.ply", "out.ply", "--triangles", 100, code=3, says="shared by three or more")
        meshes.write_ply(self.path("point.ply"), [(1, 1, 1)] * 3, [(0, 1, 2)])
        self.run_tool("point.ply", "out.ply", "--triangles", 100, code=3, says="point.ply")
        self.assertFalse(self.exists("out.ply"))

    def test_triangles_without_area_are_refused_by_name(self):
        meshes.write_ply(self.path("line.ply"), [(0.0, 0, 0), (1.0, 0, 0), (2.0, 0, 0), (4.0, 0, 0)],
                         [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)])
        self.run_tool("line.ply", "out.ply", "--triangles", 4, code=3, says="line.ply: all of its triangles are without area")
        self.assertFalse(self.exists("out.ply"))

    def test_poles_that_are_rings_of_vertices_are_closed(self):
        n, m = 24, 12
        vertices, triangles = meshes.tube(n, m)
        for i, (x, y, _) in enumerate(vertices):
            across = 0.0 if i // n in (0, m) else math.sin(math.pi * (i // n) / m)
            vertices[i] = (10 * across * x, 10 * across * y, -10 * math.cos(math.pi * (i // n) / m))
        meshes.write_ply(self.path("in.ply"), vertices, triangles)
        for goal in [("--triangles", 200), ("--max-error", "2%"), ("--triangles", 200, "--min-angle", 20)]:
            result = self.run_tool("in.ply", "out.ply", *goal, "--force")["result"]
            self.assertEqual(result["closed_loops"], 2)
            self.assertEqual(result["degenerate_triangles"], 0)
            self.assertEqual((result["euler"], result["boundary_loops"]), (2, 0))
            self.assertEqual(result["longest_spike_mm"], 0)
            self.assertLess(result["hausdorff_percent"]["upper"], 5)
        found = self.run_tool("in.ply", "out.ply", "--triangles", 200, "--force")["warnings"]
        self.assertEqual(len(found), 1, found)
        self.assertIn("2 hole(s) whose rim was a single point are closed", found[0])
        self.surface("sound.ply")
        self.assertEqual(self.run_tool("sound.ply", "out.ply", "--triangles", 200, "--force")["warnings"], [])
        self.assertEqual(self.run_tool("sound.ply", "out.ply", "--triangles", 200, "--force")["result"]["closed_loops"], 0)

    def test_spikes_without_area_go_as_far_as_the_error_allows(self):
        n = 12
        vertices = [(float(i), float(j), 0.3 * math.sin(0.5 * i)) for j in range(n + 1) for i in range(n + 1)]
        triangles = [t for j in range(n) for i in range(n) for a in [j * (n + 1) + i]
                     for t in [(a, a + 1, a + n + 2), (a, a + n + 2, a + n + 1)]]
        last, end, z = n * (n + 1) - 1, (n + 1) ** 2 - 1, vertices[-1][2]
        for i in range(1, 5):  # a chain along x = n, 2 mm beyond the corner
            vertices.append((float(n), n + 0.5 * i, z))
            triangles.append((end, last, len(vertices) - 1) if i % 2 else (last, end, len(vertices) - 1))
            last, end = end, len(vertices) - 1
        meshes.write_ply(self.path("in.ply"), vertices, triangles, comments=["units mm"])
        gone = self.run_tool("in.ply", "out.ply", "--max-error", "2.5mm", "--force")["result"]
        self.assertEqual(gone["degenerate_triangles"], 0)
        self.assertAlmostEqual(gone["longest_spike_mm"], 2)
        self.assertGreater(gone["hausdorff_mm"]["lower"], 1.99)
        self.assertLessEqual(gone["hausdorff_mm"]["upper"], 2.5)
        self.assertIn("up to 2 mm long, are taken away", self.run_tool("in.ply", "out.ply", "--max-error", "2.5mm", "--force")["warnings"][0])
        for goal in [("--triangles", 60), ("--triangles", 100, "--min-angle", 20)]:
            counted = self.run_tool("in.ply", "out.ply", *goal, "--force")["result"]
            self.assertEqual(counted["degenerate_triangles"], 0)
            self.assertAlmostEqual(counted["longest_spike_mm"], 2)
        kept = self.run_tool("in.ply", "out.ply", "--max-error", "0.1mm", "--force")["result"]
        self.assertGreater(kept["degenerate_triangles"], 0)
        self.assertEqual(kept["longest_spike_mm"], 0)
        self.assertLessEqual(kept["hausdorff_mm"]["upper"], 0.1)
        self.assertLess(kept["triangles"], 60)  # the rest of the surface is not held up by them
        self.assertIn("--max-error is too small for their spikes to go",
                      self.run_tool("in.ply", "out.ply", "--max-error", "0.1mm", "--force")["warnings"][0])

    def test_spikes_longer_than_the_error_exclude_an_angle(self):
        n = 12
        vertices = [(float(i), float(j), 0.0) for j in range(n + 1) for i in range(n + 1)]
        triangles = [t for j in range(n) for i in range(n) for a in [j * (n + 1) + i]
                     for t in [(a, a + 1, a + n + 2), (a, a + n + 2, a + n + 1)]]
        for end, last in ((n * (n + 1), (n - 1) * (n + 1)), ((n + 1)**2 - 1, n * (n + 1) - 1)):  # beyond two corners
            triangles.append((last, end, len(vertices))[::1 if end == n * (n + 1) else -1])
            vertices.append((vertices[end][0], n + 3.0, 0.0))
        meshes.write_ply(self.path("in.ply"), vertices, triangles, comments=["units mm"])
        report = self.run_tool("in.ply", "out.ply", "--max-error", "0.3mm", "--min-angle", 20, code=4,
                               says="spikes without area")
        self.assertGreater(report["result"]["hausdorff_mm"]["upper"], 2.9)
        self.assertFalse(self.exists("out.ply"))
        self.assertLess(len(meshes.Ply(self.path("out.ply.part")).triangles), 100)
        self.run_tool("in.ply", "out.ply", "--max-error", "3.5mm", "--min-angle", 20)

    def test_repair_drops_pieces_without_area(self):
        vertices, triangles = self.surface()
        loose = [(len(vertices) + 3 * i, len(vertices) + 3 * i + 1, len(vertices) + 3 * i + 2) for i in range(5)]
        points = [(20.0 + j * j, i, 0.0) for i in range(5) for j in range(3)]
        meshes.write_ply(self.path("loose.ply"), vertices + points, triangles + loose)
        result = self.run_tool("loose.ply", "out.ply", "--triangles", 300, "--repair")["result"]
        self.assertEqual(result["repairs"]["dropped_triangles"], 5)
        self.assertEqual(result["degenerate_triangles"], 0)
        meshes.write_ply(self.path("line.ply"), points[:3], [(0, 1, 2)])
        self.run_tool("line.ply", "line_out.ply", "--triangles", 300, "--repair", code=3,
                      says="when pieces without area are dropped")

    def test_triangles_without_area_that_join_parts_are_counted_and_warned_of(self):
        # Two squares of two triangles, and between them two triangles on the line y = 0.
        vertices = [(0.0, 0, 0), (1.0, 0, 0), (1.2, 0, 0), (0.0, 1, 0), (3.0, 0, 0), (2.8, 0, 0), (4.0, 0, 0), (4.0, 1, 0)]
        triangles = [(0, 1, 3), (1, 2, 3), (4, 6, 7), (4, 7, 5), (2, 1, 4), (2, 4, 5)]
        meshes.write_ply(self.path("in.ply"), vertices, triangles)
        result = self.run_tool("in.ply", "out.ply", "--triangles", 6)["result"]
        self.assertEqual(result["degenerate_triangles"], 2)
        self.assertEqual((result["euler"], result["boundary_loops"]), (1, 1))
        found = self.run_tool("in.ply", "out.ply", "--triangles", 6, "--force")["warnings"]
        self.assertIn("2 triangle(s) without area are left", found[0])

    def test_what_repair_mends_is_counted(self):
        vertices, triangles = self.surface()
        broken = [triangles[0][::-1]] + triangles[1:] + [triangles[7], (0, 0, 1),
                                                         (triangles[9][0], triangles[9][1], len(vertices))]
        fin = tuple(1.1 * x for x in vertices[triangles[9][0]])
        meshes.write_ply(self.path("broken.ply"), vertices + [fin], broken)
        self.run_tool("broken.ply", "out.ply", "--triangles", 300, code=3, says="--repair")
        result = self.run_tool("broken.ply", "out.ply", "--triangles", 300, "--repair")["result"]
        self.assertTrue(result["manifold"])
        self.assertEqual(result["triangles_in"], len(triangles) + 1)  # the fin stays, as a piece of its own
        self.assertEqual(result["repairs"]["dropped_triangles"], 2)
        self.assertEqual(result["repairs"]["turned_triangles"], 1)
        self.assertLess(result["hausdorff_percent"]["upper"], 3)
        meshes.write_ply(self.path("none.ply"), [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 1)])
        self.run_tool("none.ply", "none_out.ply", "--triangles", 300, "--repair", code=3, says="no triangle is left")

    @unittest.skipUnless((SHARED / "meshes").is_dir(), "the real meshes are absent: skipped")
    def test_repair_of_real_meshes(self):
        for name in ["awkward_colon_VHF_nonmanifold.obj", "awkward_liver_pieces.stl", "awkward_skull_polys.obj",
                     "awkward_aorta_3pieces.obj"]:
            given = SHARED / "meshes" / name
            result = self.run_tool(given, "out.ply", "--triangles", 3000, "--repair", "--mesh-unit", "mm",
                                   "--force")["result"]
            self.assertTrue(result["manifold"], name)
            self.assertLessEqual(result["triangles"], 3000, name)
            self.assertLess(result["hausdorff_percent"]["upper"], 2, name)

    def test_count_below_the_topology(self):
        a, triangles = meshes.sphere(2)
        b, more = meshes.sphere(2, centre=(5.0, 0.0, 0.0))
        meshes.write_ply(self.path("in.ply"), a + b, triangles + [tuple(i + len(a) for i in t) for t in more])
        report = self.run_tool("in.ply", "out.ply", "--triangles", 5, code=4, says="8 triangles are the fewest")
        self.assertEqual(report["result"]["triangles"], 8)
        self.assertFalse(self.exists("out.ply"))
        self.assertEqual(len(meshes.Ply(self.path("out.ply.part")).triangles), 8)

    def test_count_and_error_that_exclude_each_other(self):
        self.surface()
        report = self.run_tool("in.ply", "out.ply", "--triangles", 20, "--max-error", "0.5%", code=4, says="--max-error")
        self.assertLessEqual(report["result"]["hausdorff_percent"]["upper"], 0.5)
        self.assertEqual(len(meshes.Ply(self.path("out.ply.part")).triangles), report["result"]["triangles"])
        self.run_tool("in.ply", "out.ply", "--max-error", "1e-30mm", code=4, says="double precision")
        vertices, triangles = meshes.sphere(3)
        meshes.write_ply(self.path("long.ply"), [(x, y, 4 * z) for x, y, z in vertices], triangles, comments=["units mm"])
        self.run_tool("long.ply", "angles.ply", "--max-error", "1e-7mm", "--min-angle", 35, code=4, says="keeps both")

    def test_an_existing_output_is_5_unless_forced(self):
        self.surface()
        self.run_tool("in.ply", "out.ply", "--triangles", 100)
        self.run_tool("in.ply", "out.ply", "--triangles", 50, code=5, says="out.ply")
        self.assertEqual(len(meshes.Ply(self.path("out.ply")).triangles), 100)
        self.run_tool("in.ply", "out.ply", "--triangles", 50, "--force")
        self.assertEqual(len(meshes.Ply(self.path("out.ply")).triangles), 50)
        self.run_tool("in.ply", "absent/out.ply", "--triangles", 50, code=5)

    def test_output_through_a_symbolic_link(self):
        self.surface()
        os.mkdir(self.path("store"))
        for name, there in [("store/coarse.ply", True), ("store/new.ply", False)]:
            if there:
                self.run_tool("in.ply", name, "--triangles", 100)
            link = "link%d.ply" % there
            os.symlink(name, self.path(link))
            self.run_tool("in.ply", link, "--triangles", 50, "--force")
            self.assertTrue(os.path.islink(self.path(link)))
            self.assertEqual(len(meshes.Ply(self.path(name)).triangles), 50)


if __name__ == "__main__":
    unittest.main()
