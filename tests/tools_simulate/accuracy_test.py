"""tunica-simulate --accuracy: mesh and model chosen, the claim reported, what is not credible refused."""
import json
import os
import unittest

import h5py

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
        again = self.run_tool("fine.ply", "again.hdf", *HELD)["result"]
        self.assertAlmostEqual(again["max_displacement_mm"] / claim["value"], 1, places=2)
        self.assertEqual(report["outputs"], ["out.hdf", "fine.ply"])
        self.assertEqual([entry["path"] for entry in report["inputs"]], ["ball.ply", "target.ply"])

    def test_a_loose_solver_is_part_of_the_claim(self):
        claim = self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "2%", "--target", "target.ply", "--solver", "cg",
                              "--cg-tolerance", "5%", "--converge", "0.5")["result"]["accuracy"]
        self.assertLess(abs(claim["value"] / EXACT - 1), claim["estimate_percent"] / 100)

    def test_without_a_target_the_geometry_is_not_included(self):
        claim = self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "5%", "--of", "energy")["result"]["accuracy"]
        self.assertEqual(claim["not_included"][0], "geometry")
        self.assertIsNone(claim["levels"][0]["mean_distance_mm"])

    def test_the_choice_does_not_depend_on_threads(self):
        claims = [self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "2%", "--target", "target.ply", "--force",
                                "--threads", threads)["result"]["accuracy"] for threads in ("1", "2", "2")]
        self.assertEqual(len({(tuple(level["shells"] for level in claim["levels"]),
                               tuple(choice["chosen"] for choice in claim["choices"])) for claim in claims}), 1)

    def test_what_is_not_credible_is_refused_and_kept_as_part(self):
        self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "0.01%", "--target", "target.ply", "--max-shells", "1500",
                      "--shell-out", "fine.ply", expect=4)
        self.assertIn("0.01% of displacement is not credible", self.done.stderr)
        self.assertIn("more than 1500", self.done.stderr)
        self.assertEqual(sorted(name for name in os.listdir(self.folder) if name.startswith(("out", "fine"))),
                         ["fine.ply.part", "out.hdf.part"])

    def test_usage_errors(self):
        for arguments, says in (
                ([*HELD, "--of", "energy"], "--of belongs to --accuracy"),
                ([*HELD, "--accuracy", "2"], "2"),
                ([*HELD, "--accuracy", "0%"], "not above 0"),
                ([*HELD, "--accuracy", "60%"], "at most 50%"),
                ([*HELD, "--accuracy", "2%", "--of", "weight"], "not one of displacement, energy, volume, stress"),
                ([*HELD, "--accuracy", "2%", "--load-steps", "3"], "leave out --load-steps"),
                ([*HELD, "--accuracy", "2%", "--cg-iterations", "5"], "asks for convergence"),
                ([*HELD, "--accuracy", "2%", "--max-shells", "0"], "--max-shells"),
                ([*WALL, "--density", "1g/cm3", "--duration", "1s", "--step", "0.1s", "--fix", "rigid-motions",
                  "--accuracy", "2%"], "not available yet")):
            self.run_tool("ball.ply", "out.hdf", *arguments, expect=2)
            self.assertIn(says, self.done.stderr)
            self.assertFalse(os.path.exists(self.path("out.hdf")))

    def test_bad_input(self):
        write_ply(self.path("far.ply"), sphere(2, 10)[0] + 1e4, sphere(2, 10)[1])
        vertices, triangles = sphere(2, 10)[:2]
        write_ply(self.path("torn.ply"), vertices, [*triangles, triangles[0][::-1]])
        for target in ("nothing.ply", "far.ply", "torn.ply"):
            self.run_tool("ball.ply", "out.hdf", *HELD, "--accuracy", "2%", "--target", target, expect=3)
            self.assertIn(target, self.done.stderr)
        write_ply(self.path("plate.ply"), *grid(4, 4, 10, 10))
        self.run_tool("plate.ply", "out.hdf", *WALL, "--fix", "boundary", "--static", "--accuracy", "2%", "--of", "volume",
                      expect=3)
        self.assertIn("encloses no volume", self.done.stderr)


if __name__ == "__main__":
    unittest.main()
