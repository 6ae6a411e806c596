"""tunica-simulate --accuracy: mesh and model chosen, the claim reported, what is not credible refused."""
import json
import os
import unittest

import h5py

from running import run_tool
from support import SimulateTest, grid, sphere, write_ply

WALL = ["--young", "1MPa", "--poisson", "0.3", "--thickness", "0.5mm", "--pressure", "100Pa"]
HELD = WALL + ["--fix", "rigid-motions", "--static"]
EXACT = 100e-6 * 100 * 0.7 / (2 * 1 * 0.5)  # mm: p r^2 (1 - nu) / (2 E t)


class AccuracyTest(SimulateTest):
    def setUp(self):
        super().setUp()
        vertices, triangles, normals = sphere(1, 10)
        write_ply(self.path("ball.ply"), vertices, triangles, normals)
        write_ply(self.path("target.ply"), *sphere(5, 10)[:2])

    def test_the_answer_is_within_what_was_asked_for(self):
        report = self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "2%", "--target", "target.ply", "--shell-out",
                               "fine.ply")
        result, claim = report["result"], report["result"]["accuracy"]
        self.assertEqual((claim["requested_percent"], claim["of"], claim["credible"], claim["reasons"]),
                         (2, "displacement", True, []))
        self.assertNotIn("coarse", " ".join(report["warnings"]), "the claim says more")
        self.assertEqual(claim["not_included"], ["segmentation", "material", "thickness"])
        self.assertEqual(result["shells"], claim["levels"][-1]["shells"])
        self.assertAlmostEqual(result["max_displacement_mm"], claim["value"])
        self.assertLess(abs(claim["value"] / EXACT - 1), claim["estimate_percent"] / 100)
        self.assertLess(claim["estimate_percent"], 2)
        self.assertEqual([level["shells"] for level in claim["levels"]][:3], [80, 320, 1280])
        self.assertEqual({choice["part"] for choice in claim["choices"]}, {"shells", "model"})
        with h5py.File(self.path("out.hdf")) as file:
            self.assertEqual(json.loads(file["tunica/accuracy"][()])["of"], "displacement")
            self.assertEqual(len(file["tunica/elements/nodes"]), result["shells"])
        compared = run_tool("compare", "fine.ply", "target.ply", "--shell", folder=self.folder).report["result"]
        distance = compared["hausdorff_percent"]
        self.assertLessEqual(distance["lower"], claim["hausdorff_percent"]["upper"])
        self.assertGreaterEqual(distance["upper"], claim["hausdorff_percent"]["lower"])
        self.assertLessEqual(claim["hausdorff_percent"]["upper"] - claim["hausdorff_percent"]["lower"], 0.01 + 1e-9)
        again = self.run_tool("fine.ply", "again.hdf", *HELD)["result"]
        self.assertAlmostEqual(again["max_displacement_mm"] / claim["value"], 1, places=2)
        self.assertEqual([entry["path"] for entry in report["outputs"]], ["out.hdf", "out.page", "fine.ply"])
        self.assertEqual([entry["path"] for entry in report["inputs"]], ["ball.ply", "target.ply"])

    def test_few_shells_may_lie_farther_from_what_they_were_fitted_to(self):
        """A fortieth of the diagonal away is what twenty shells leave of a surface, and another surface for many."""
        write_ply(self.path("around.ply"), *sphere(5, 10.95)[:2])
        for level, code, says in ((0, 0, ""), (2, 3, "is not the surface that they were fitted to")):
            vertices, triangles, normals = sphere(level, 10)
            write_ply(self.path("few.ply"), vertices, triangles, normals)
            self.run_tool("few.ply", "out.hdf", *HELD, "--target", "around.ply", "--force", code=code, says=says)

    def test_the_border_of_a_load_is_part_of_the_claim(self):
        self.write("scene.toml", """
[run]
kind = "static"
[accuracy]
within = "5%"
target = {ball = "target.ply"}
[[shell]]
name = "ball"
mesh = "ball.ply"
young = "1MPa"
poisson = 0.45
thickness = "0.5mm"
[[fix]]
body = "ball"
where = {below = {axis = "z", at = "-5mm"}}
translation = "xyz"
rotation = "xyz"
[[load]]
body = "ball"
kind = "pressure"
value = "1kPa"
where = {above = {axis = "z", at = "2mm"}}
""")
        exact = 0.2152  # by meshes with rings of nodes at both borders, 2,232 to 12,864 shells
        claim = self.run_tool("--scene", "scene.toml", "out.hdf", "--max-shells", "6000")["result"]["accuracy"]
        self.assertLess(abs(claim["value"] / exact - 1), claim["estimate_percent"] / 100)

    def test_membrane_stress_that_the_linear_model_has_not(self):
        vertices, triangles = grid(12, 12, 20, 20)
        write_ply(self.path("plate.ply"), vertices, triangles)
        words = [*WALL[:-1], "1kPa", "--fix", "boundary", "--static", "--accuracy", "10%", "--of", "membrane"]
        claim = self.run_tool("plate.ply", "out.hdf", *words)["result"]["accuracy"]
        self.assertEqual([choice["chosen"] for choice in claim["choices"] if choice["part"] == "model"], ["nonlinear"])

    def test_a_loose_solver_is_part_of_the_claim(self):
        claim = self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "2%", "--target", "target.ply", "--solver", "cg",
                              "--cg-tolerance", "5%", "--converge", "0.5")["result"]["accuracy"]
        self.assertLess(abs(claim["value"] / EXACT - 1), claim["estimate_percent"] / 100)

    def test_without_a_target_the_geometry_is_not_included(self):
        claim = self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "5%", "--of", "energy")["result"]["accuracy"]
        self.assertEqual(claim["not_included"][0], "geometry")
        self.assertIsNone(claim["levels"][0]["mean_distance_mm"])
        self.assertIn("ball.ply: has no target", self.done.stderr)

    def test_an_aim_does_without_a_target_that_is_no_finer(self):
        report = self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "2%", "--target", "ball.ply", "--max-seconds", "60s")
        self.assertEqual(report["warning_kinds"], ["no target"])
        self.assertIn("the error of the geometry is not seen", report["warnings"][0])
        self.assertIn("geometry", report["result"]["accuracy"]["not_included"])
        self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "2%", "--target", "ball.ply", "--force", code=3,
                      says="take fewer shells (SHELLS=40)")

    def test_the_choice_does_not_depend_on_threads(self):
        claims = [self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "2%", "--target", "target.ply", "--force",
                                "--threads", threads)["result"]["accuracy"] for threads in ("1", "2", "2")]
        self.assertEqual(len({(tuple(level["shells"] for level in claim["levels"]),
                               tuple(choice["chosen"] for choice in claim["choices"])) for claim in claims}), 1)

    def test_what_is_not_credible_is_refused_and_kept_as_part(self):
        report = self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "0.01%", "--target", "target.ply", "--max-shells",
                               "1500", "--shell-out", "fine.ply", code=4, says="more than 1500")
        self.assertRegex(self.done.stderr, r"accuracy not reached: displacement [0-9.]+ mm with \d+ shells, "
                         r"(without a credible estimate of its error|estimated error [0-9.]+ %), 0.01 % asked: ")
        self.assertEqual(sorted(name for name in os.listdir(self.folder) if name.startswith(("out", "fine"))),
                         ["fine.ply.part", "out.hdf.part"])
        self.assertGreater(report["result"]["newton_iterations"], 0, "of the last level")

    def test_beyond_the_limit_load_the_second_mesh_is_the_last(self):
        """A sphere has no equilibrium above half of 2 E t / (1 - nu) r: finer meshes have none either."""
        self.run_tool("ball.ply", "out.hdf", *WALL[:-2], "--pressure", "0.1MPa", "--fix", "rigid-motions", "--static",
                      "--accuracy", "2%", "--target", "target.ply", code=4)
        lines = self.done.stderr.strip().splitlines()
        self.assertIn("no stable static equilibrium beyond load factor", lines[-1])
        levels = [line for line in lines if " shells: " in line and "load factor" in line]
        self.assertEqual(len(levels), 1, "the coarsest, and why it has no answer")
        self.assertIn("80 shells: ", levels[0])

    def test_wrong_usage_is_2(self):
        for arguments, says in (
                ([*HELD, "--of", "energy"], "--of belongs to --accuracy"),
                ([*HELD, "--accuracy", "2"], "2"),
                ([*HELD, "--accuracy", "0%"], "must be above 0"),
                ([*HELD, "--accuracy", "60%"], "at most 50%"),
                ([*HELD, "--accuracy", "2%", "--of", "weight"], "not one of displacement, energy, volume, stress"),
                ([*HELD, "--accuracy", "2%", "--load-steps", "3"], "leave out --load-steps"),
                ([*HELD, "--accuracy", "2%", "--cg-iterations", "5"], "asks for convergence"),
                ([*HELD, "--accuracy", "2%", "--max-shells", "0"], "--max-shells"),
                ([*HELD, "--max-shells", "500"], "--max-shells belongs to --accuracy")):
            self.run_tool("ball.ply", "out.hdf", *arguments, code=2, says=says)
            self.assertFalse(self.exists("out.hdf"))

    SCENE = """[run]
kind = "static"
[[shell]]
name = "ball"
mesh = "ball.ply"
thickness = "0.5mm"
young = "1MPa"
poisson = 0.3
density = "1g/cm3"
[[shell]]
name = "far ball"
mesh = "far.ply"
thickness = "0.5mm"
young = "1MPa"
poisson = 0.3
density = "1g/cm3"
[[fix]]
body = "ball"
where = {rigid_motions = true}
[[fix]]
body = "far ball"
where = {rigid_motions = true}
[[load]]
body = "ball"
kind = "pressure"
value = "100Pa"
[[load]]
body = "far ball"
kind = "pressure"
value = "200Pa"
[[probe]]
name = "top"
body = "far ball"
nearest = ["100mm", "0mm", "10mm"]
[accuracy]
within = "2%"
"""

    def scene(self, more, text=None):
        with open(self.path("scene.toml"), "w", encoding="utf-8") as file:
            file.write((text or self.SCENE) + more)
        return "--scene", "scene.toml"

    def test_a_scene_asks_for_an_accuracy_of_all_its_bodies(self):
        vertices, triangles, normals = sphere(1, 10)
        write_ply(self.path("far.ply"), vertices + [100, 0, 0], triangles, normals)
        vertices, triangles = sphere(5, 10)[:2]
        write_ply(self.path("far target.ply"), vertices + [100, 0, 0], triangles)
        more = 'target = {ball = "target.ply", "far ball" = "far target.ply"}\n'
        for of, exact, said in (('of = "displacement"\n', 2 * EXACT, "displacement"),
                                ('of = {probe = "top", axis = "z"}\n', 2 * EXACT, {"probe": "top", "axis": "z"})):
            report = self.run_tool(*self.scene(more + of), "out.hdf", "--force")
            claim = report["result"]["accuracy"]
            self.assertEqual((claim["of"], claim["credible"]), (said, True))
            self.assertLess(abs(claim["value"] / exact - 1), claim["estimate_percent"] / 100)
            self.assertEqual([level["shells"] for level in claim["levels"]][:2], [160, 640])
            self.assertEqual([entry["path"] for entry in report["inputs"]],
                             ["scene.toml", "ball.ply", "far.ply", "target.ply", "far target.ply"])
        with h5py.File(self.path("out.hdf")) as file:
            self.assertIn("[accuracy]", file["tunica/scene"][()].decode())
        part = self.run_tool(*self.scene('target = {ball = "target.ply"}\n'), "out.hdf", "--force")
        self.assertEqual(part["result"]["accuracy"]["not_included"][0], "geometry")

    def test_errors_of_a_scene(self):
        vertices, triangles, normals = sphere(1, 10)
        write_ply(self.path("far.ply"), vertices + [100, 0, 0], triangles, normals)
        for more, says in (('target = {brain = "target.ply"}\n', 'no body "brain"'),
                           ('of = {probe = "tip", axis = "z"}\n', 'no [[probe]] "tip"'),
                           ('of = "weight"\n', "weight"), ('target = "target.ply"\n', "must be a table"),
                           ('of = {probe = "top"}\n', "no 'axis'"), ("beyond = 3\n", "unknown key 'beyond'")):
            self.run_tool(*self.scene(more), "out.hdf", code=3, says=[says, "scene.toml:"])
        for found, replaced, says in (('kind = "static"', 'kind = "buckling"', "no single answer"),
                                      ('within = "2%"', 'within = "60%"', "at most 50%"),
                                      ('kind = "static"', 'kind = "static"\nload_steps = 3', "leave out the load steps"),
                                      ('where = {rigid_motions = true}',
                                       'where = {nodes = [0]}\ntranslation = "xyz"\nrotation = ""', "a list of nodes")):
            self.run_tool(*self.scene("", self.SCENE.replace(found, replaced, 1)), "out.hdf", code=3, says=says)
        scene = self.scene('target = {ball = "target.ply"}\n')
        for flags, says in ((["--accuracy", "2%"], "contradict each other"), (["--shell-out", "fine.ply"], "more than one body")):
            self.run_tool(*scene, "out.hdf", *flags, code=3 if "2%" in flags else 2, says=says)
        self.run_tool(*self.scene("", self.SCENE.split("[accuracy]")[0]), "out.hdf", "--accuracy", "2%", "--target",
                      "target.ply", code=2, says="name each one's in [accuracy]")

    def test_a_slow_ramp_is_taken_as_rest(self):
        motion = [*WALL, "--density", "1g/cm3", "--duration", "100ms", "--step", "10ms", "--ramp", "80ms", "--fix",
                  "rigid-motions", "--accuracy", "5%", "--target", "target.ply"]
        claim = self.run_tool("ball.ply", "out.hdf", *motion)["result"]["accuracy"]
        chosen = {choice["part"]: choice["chosen"] for choice in claim["choices"]}
        self.assertEqual(chosen["run"], "static")
        self.assertLess(abs(claim["value"] / EXACT - 1), claim["estimate_percent"] / 100)

    def test_voxels_of_the_image_are_told(self):
        with open(self.path("target.ply"), "rb") as file:
            data = file.read()
        with open(self.path("target.ply"), "wb") as file:
            file.write(data.replace(b"element vertex", b"comment voxel 0.8 0.8 1.5 mm\nelement vertex", 1))
        claim = self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "5%", "--target", "target.ply")["result"]["accuracy"]
        self.assertAlmostEqual(claim["surface_uncertainty_mm"], 0.15)
        self.assertIn("at voxels of 1.5 mm the surface itself is uncertain by about 0.15 mm", self.done.stderr)
        with open(self.path("target.ply"), "wb") as file:
            file.write(data.replace(b"element vertex", b"comment voxel nan inf -3 mm\nelement vertex", 1))
        claim = self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "5%", "--target", "target.ply",
                              "--force")["result"]["accuracy"]
        self.assertIsNone(claim["surface_uncertainty_mm"])

    def test_unfit_inputs_are_3(self):
        write_ply(self.path("far.ply"), sphere(2, 10)[0] + 1e4, sphere(2, 10)[1])
        vertices, triangles = sphere(2, 10)[:2]
        write_ply(self.path("torn.ply"), vertices, [*triangles, triangles[0][::-1]])
        write_ply(self.path("other.ply"), sphere(4, 10)[0] * [1, 1, 0.3], sphere(4, 10)[1])
        write_ply(self.path("coarse.ply"), *sphere(1, 10)[:2])
        for target in ("nothing.ply", "far.ply", "torn.ply", "other.ply", "coarse.ply"):
            self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "2%", "--target", target, code=3, says=target)
        write_ply(self.path("plate.ply"), *grid(4, 4, 10, 10))
        self.run_tool("plate.ply", "out.hdf", *WALL, "--fix", "boundary", "--static", "--accuracy", "2%", "--of", "volume",
                      code=3, says="encloses no volume")


if __name__ == "__main__":
    unittest.main()
