"""Paths by arc length from end to end: lengths in mm, forces in N."""
import math
import unittest

import h5py
import numpy as np

from scenes_test import fix, probe, shell
from support import SimulateTest, grid, write_ply


class Paths(SimulateTest):
    def roof(self, run, more=""):
        """A quarter of the hinged roof of Sze, Liu, Lo 2004, t = 12.7."""
        vertices, triangles = grid(8, 8, 1, 1)
        angle = 0.1 * vertices[:, 1]
        points = np.stack([254 * vertices[:, 0], 2540 * np.sin(angle), 2540 * np.cos(angle)], axis=1)
        write_ply(self.path("roof.ply"), points, triangles)
        hinge = 2540 * math.sin(0.1) - 1e-3
        return ("[run]\nkind = \"static\"\n" + run + "\n" + shell("roof.ply", 12.7, 3102.75, 0.3) +
                fix(f"above = {{axis = \"y\", at = \"{hinge}mm\"}}", "xyz", "yz") +
                fix("below = {axis = \"x\", at = \"0mm\"}", "x", "yz") +
                fix("below = {axis = \"y\", at = \"0mm\"}", "y", "xz") +
                more + probe("centre", 0, 0, 2540))

    FORCE = ("[[load]]\nbody = \"s\"\nkind = \"force\"\nwhere = {nearest = [\"0mm\", \"0mm\", \"2540mm\"]}\n"
             "value = [\"0N\", \"0N\", \"-750N\"]\n")
    UNTIL = "control = \"arc-length\"\nuntil = {probe = \"centre\", axis = \"z\", reaches = \"-30mm\"}\n"

    def test_a_path_whose_steps_run_out_says_where(self):
        short = "control = \"arc-length\"\nmax_steps = 2\nmax_factor = 1.0\nload_steps = 100\n"
        self.write("scene.toml", self.roof(short, self.FORCE))
        report = self.run_tool("--scene", "scene.toml", "out.hdf", "--force")
        ended = report["result"]["probes"]["centre"]["load_factor"][-1]
        self.assertIn(f"took all of its 2 steps and ended at load factor {ended:.4g}", self.done.stderr)
        self.assertIn("the path took all", " ".join(report["warnings"]))
        self.assertLess(ended, .5)

    def test_roof_through_its_limit_points(self):
        result = self.simulate(self.roof(self.UNTIL, self.FORCE))
        w = -np.array(result["probes"]["centre"]["displacement_mm"])[:, 2]
        factor = np.array(result["probes"]["centre"]["load_factor"])
        self.assertTrue((np.diff(w) > 0).all())
        for at, reference in ((4.477, .4686), (9.339, .7246), (14.728, .5643), (19.852, .1729), (29.374, 1.0835)):
            self.assertAlmostEqual(np.interp(at, w, factor), reference, delta=0.03)
        np.testing.assert_allclose(result["limit_load_factors"], [.7421, .1729], atol=0.005)
        self.assertAlmostEqual(w[-1], 30, places=6)
        self.assertTrue(result["converged"])
        with h5py.File(self.path("out.hdf")) as file:
            np.testing.assert_allclose(file["tunica/history/load_factor"][:], factor)
            np.testing.assert_array_equal(file["VTKHDF/Steps/Values"][:], np.arange(len(factor)))

    def test_roof_that_snaps_says_so(self):
        """Dead load beyond the limit: the next state of rest, told in a warning and in the result."""
        self.write("scene.toml", self.roof("", self.FORCE))
        report = self.run_tool("--scene", "scene.toml", "out.hdf")
        result = report["result"]
        self.assertEqual(result["steps"], 1)
        self.assertEqual(len(result["snaps"]), 1)
        self.assertAlmostEqual(result["snaps"][0]["load_factor"], .7421, delta=0.005)
        self.assertGreater(result["snaps"][0]["distance_mm"], 10)
        self.assertRegex(self.done.stderr, r"warning: .*: beyond load factor 0\.74.* the body buckles or snaps")
        w = -result["probes"]["centre"]["displacement_mm"][-1][2]
        self.assertAlmostEqual(w, np.interp(1, [.3871, 1.0835], [24.049, 29.374]), delta=0.6)

    def test_path_that_does_not_get_there(self):
        self.write("scene.toml", self.roof(self.UNTIL + "max_steps = 5", self.FORCE))
        report = self.run_tool("--scene", "scene.toml", "out.hdf", code=4)
        self.assertIn("ended after 5 steps", report["error"])
        self.assertEqual(len(report["result"]["probes"]["centre"]["load_factor"]), 6)
        with h5py.File(self.path("out.hdf.part")) as file:
            self.assertEqual(file["VTKHDF/Steps"].attrs["NSteps"], 6)


if __name__ == "__main__":
    unittest.main()
