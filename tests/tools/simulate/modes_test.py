"""Frequencies and buckling factors from end to end: lengths in mm, forces in N."""
import math
import unittest

import h5py
import numpy as np

from scenes_test import fix, load, probe, shell
from support import SimulateTest, grid, sphere, write_ply

DENSITY = "density = \"1000kg/m3\""  # 1e-9 t / mm^3


def run(kind, more=""):
    return f"[run]\nkind = \"{kind}\"\n{more}\n"


class Modes(SimulateTest):
    def plate(self, n=16):
        write_ply(self.path("plate.ply"), *grid(n, n, 10, 10))
        return shell("plate.ply", 0.05, 1000, 0.3, DENSITY)

    def test_frequencies_of_a_supported_plate(self):
        scene = run("frequencies", "count = 4") + self.plate() + fix("boundary = true", "xyz", "")
        result = self.simulate(scene + probe("middle", 5, 5, 0))
        unit = math.sqrt(1000 * 0.05**3 / (12 * 0.91) / (1e-9 * 0.05)) / 100 / (2 * math.pi)
        for found, squares in zip(result["frequencies_hz"], (2, 5, 5, 8), strict=True):
            self.assertAlmostEqual(found / (math.pi**2 * squares * unit), 1, delta=0.03)
        self.assertEqual(result["buckling_factors"], [])
        self.assertTrue(result["converged"])
        self.assertIsNone(result["max_displacement_mm"])
        shapes = np.array(result["probes"]["middle"]["displacement_mm"])
        self.assertEqual(shapes.shape, (5, 3))  # the reference first
        self.assertAlmostEqual(shapes[1, 2], 0.1)  # 1 % of the side, upwards
        self.assertLess(np.abs(shapes[2:, 2]).max(), 1e-6)  # it lies on their nodal lines
        with h5py.File(self.path("out.hdf")) as file:
            self.assertEqual(file["VTKHDF/Steps"].attrs["NSteps"], 5)
            np.testing.assert_allclose(file["VTKHDF/Steps/Values"][1:], result["frequencies_hz"], rtol=1e-12)
            self.assertTrue((np.diff(file["tunica/history/time"][:]) > 0).all())
            self.assertEqual(file["tunica/converged"][()], 1)

    def test_free_ball_under_pressure(self):
        """Nothing holds it; pressure stiffens it."""
        vertices, triangles, normals = sphere(2, 10)
        write_ply(self.path("ball.ply"), vertices, triangles, normals)
        body = shell("ball.ply", 0.5, 1000, 0.3, DENSITY)
        free = self.simulate(run("frequencies", "count = 5") + body)["frequencies_hz"]
        omega = np.array(free) * 2 * math.pi * 10 * math.sqrt(1e-9 / 1000)
        np.testing.assert_allclose(omega, 0.7348, rtol=0.03)
        pressed = run("frequencies", "count = 5\nload_steps = 2") + body + (
            "[[fix]]\nbody = \"s\"\nwhere = {rigid_motions = true}\n" + load("pressure", "\"1MPa\""))
        self.assertGreater(self.simulate(pressed)["frequencies_hz"][0], 1.001 * free[0])

    def test_buckling_of_a_column(self):
        """P = pi^2 E I / (4 L^2)."""
        write_ply(self.path("strip.ply"), *grid(20, 1, 10, 1))
        critical = math.pi**2 * 1000 * 0.1**3 / 12 / 400
        scene = (run("buckling", "count = 2") + shell("strip.ply", 0.1, 1000, 0.0) +
                 fix("below = {axis = \"x\", at = \"0mm\"}") +
                 load("edge", f"[\"{-critical / 2}N/mm\", \"0N/mm\", \"0N/mm\"]",
                      "above = {axis = \"x\", at = \"10mm\"}"))
        result = self.simulate(scene)
        np.testing.assert_allclose(result["buckling_factors"], [2, 18], rtol=0.02)
        self.assertEqual(result["frequencies_hz"], [])
        with h5py.File(self.path("out.hdf")) as file:
            np.testing.assert_allclose(file["tunica/history/load_factor"][1:], result["buckling_factors"])

    def test_what_cannot_be_ends_with_its_code(self):
        plate = self.plate(4)
        supported = fix("boundary = true", "xyz", "")
        pulled = (fix("all = true", "z", "") + fix("below = {axis = \"x\", at = \"0mm\"}", "xyz", "") +
                  load("edge", "[\"1N/mm\", \"0N/mm\", \"0N/mm\"]", "above = {axis = \"x\", at = \"10mm\"}"))
        for scene, code, says in (
            (run("buckling") + plate + supported, 3, "scene.toml:2:8: buckling needs a load"),
            (run("frequencies", "count = 9000") + plate + supported, 3, "count = 9000, but the model has only"),
            (run("frequencies") + shell("plate.ply", 0.05, 1000, 0.3) + supported, 3, "no density"),
            (run("frequencies", "solver = \"cg\"") + plate + supported, 3, "direct solver"),
            (run("buckling") + plate + pulled, 4, "the loads buckle nothing"),
        ):
            self.write("scene.toml", scene)
            report = self.run_tool("--scene", "scene.toml", "out.hdf", "--force", code=code)
            self.assertIn(says, report["error"])


if __name__ == "__main__":
    unittest.main()
