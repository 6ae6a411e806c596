#!/usr/bin/python3
"""`--imaged-at`: an organ imaged under pressure is at rest as the image shows it, and bears that pressure already."""
import math
import unittest

import h5py
import numpy as np
from support import SimulateTest, sphere, write_ply

MMHG = 133.322387415e-6  # MPa
THIN = ("--poisson", "0.45", "--thickness", "1mm", "--fix", "rigid-motions")
RADIUS = 20.0


def oval(splits):
    vertices, triangles, normals = sphere(splits, 1)
    axes = RADIUS * np.array([1.0, 1.0, 1.4])
    normals = normals / axes
    return vertices * axes, triangles, normals / np.linalg.norm(normals, axis=1)[:, None]


def scene(*loads, run='kind = "static"', young='young = "1MPa"\n', more=""):
    text = f'[run]\n{run}\n[[shell]]\nname = "wall"\nmesh = "oval.ply"\nthickness = "1mm"\n{young}poisson = 0.45\n' \
           f'density = "1100kg/m3"\n[[fix]]\nbody = "wall"\nwhere = {{rigid_motions = true}}\n'
    for load in loads:
        text += f'[[load]]\nbody = "wall"\nkind = "pressure"\n{load}\n'
    return text + more


class Imaged(SimulateTest):
    def setUp(self):
        super().setUp()
        write_ply(self.path("oval.ply"), *oval(2))

    def faces(self, name="out.hdf", key="von_mises_top"):
        with h5py.File(self.path(name)) as file:
            return np.array(file["tunica/elements"][key][-1])

    def test_a_shape_in_which_the_wall_cannot_rest_is_said(self):
        for young, stable in (("1GPa", True), ("1kPa", False)):
            report = self.run_tool("oval.ply", "out.hdf", *THIN, "--imaged-at=-120mmHg", "--static", "--young", young, "--force")
            self.assertIs(report["result"]["prestress"]["stable"], stable)
            self.assertEqual(any("is not stable in the shape of the image" in text for text in report["warnings"]), not stable)

    def test_at_that_pressure_no_stiffness_is_needed_and_nothing_moves(self):
        report = self.run_tool("oval.ply", "out.hdf", *THIN, "--imaged-at", "120mmHg", "--static")
        result = report["result"]
        self.assertEqual(result["max_displacement_mm"], 0)
        self.assertEqual(result["newton_iterations"], 0)
        self.assertEqual((report["stated"]["young_mpa"], report["stated"]["poisson"]), (None, 0.45))
        for key in ("pressure_mpa", "imaged_at_mpa"):
            self.assertAlmostEqual(report["stated"][key] / (120 * MMHG), 1, places=8)
        self.assertAlmostEqual(result["prestress"]["pressure_mpa"] / (120 * MMHG), 1, places=8)
        self.assertLess(result["prestress"]["residual"], 1e-9)
        self.assertIsNone(result["prestress"]["stable"], "how stiff the wall is is not known")
        found = self.faces()
        for young in ("0.1MPa", "1GPa"):  # and the same with any
            self.run_tool("oval.ply", "any.hdf", *THIN, "--imaged-at", "120mmHg", "--static", "--young", young, "--force")
            np.testing.assert_allclose(self.faces("any.hdf"), found, rtol=1e-6)
        self.write("scene.toml", scene('value = "120mmHg"', run='kind = "static"\ngeometry = "linear"'))
        self.run_tool("--scene", "scene.toml", "linear.hdf")
        np.testing.assert_allclose(self.faces("linear.hdf"), found, rtol=1e-6)

    def test_another_pressure_needs_a_stiffness(self):
        self.run_tool("oval.ply", "out.hdf", *THIN, "--imaged-at", "0mmHg", "--static", code=2, says="--pressure is missing")
        self.run_tool("oval.ply", "out.hdf", *THIN, "--imaged-at", "80mmHg", "--pressure", "120mmHg", "--static", code=2,
                      says="--young is missing")
        self.run_tool("oval.ply", "out.hdf", *THIN, "--pressure", "120mmHg", "--static", code=2, says="--young is missing")
        self.write("scene.toml", scene('value = "2kPa"\nimaged_at = "1kPa"', young=""))
        self.run_tool("--scene", "scene.toml", "out.hdf", code=3)
        self.assertIn('"wall" has no young', self.done.stderr)
        self.write("scene.toml", scene('value = "1kPa"\nimaged_at = "1kPa"', young=""))
        self.run_tool("--scene", "scene.toml", "out.hdf")

    def test_a_ball_goes_on_from_its_image(self):
        """From 80 to 120 mmHg: N0 + E t e / (1 - nu) = p r^2 / (2 R), r = R (1 + e)."""
        write_ply(self.path("ball.ply"), *sphere(3, RADIUS))
        report = self.run_tool("ball.ply", "out.hdf", *THIN, "--young", "0.5MPa", "--imaged-at", "80mmHg", "--pressure",
                               "120mmHg", "--static")["result"]
        strain = 0.0
        for _ in range(100):
            strain = (120 * MMHG * (1 + strain)**2 - 80 * MMHG) * RADIUS / 2 * 0.55 / 0.5
        self.assertAlmostEqual(report["max_displacement_mm"] / (strain * RADIUS), 1, delta=5e-3)

    def test_several_pressures_each_begin_where_they_were(self):
        loads = ('value = "2kPa"\nimaged_at = "2kPa"', 'value = "1kPa"\nimaged_at = "0.5kPa"', 'value = "0.2kPa"')
        self.write("scene.toml", scene(*loads))
        both = self.run_tool("--scene", "scene.toml", "out.hdf")["result"]
        self.write("scene.toml", scene('value = "3.2kPa"\nimaged_at = "2.5kPa"'))
        one = self.run_tool("--scene", "scene.toml", "out.hdf", "--force")["result"]
        self.assertAlmostEqual(both["max_displacement_mm"] / one["max_displacement_mm"], 1, places=7)
        self.assertIsNone(both["prestress"]["pressure_mpa"], "they differ")

    def test_a_beat_comes_back_to_the_image(self):
        beat = 'value = "2kPa"\nimaged_at = "1kPa"\nramp = [["0s", 0.0], ["0.2s", 1.0], ["0.4s", 0.0], ["9s", 0.0]]'
        run = 'kind = "dynamic"\nduration = "0.6s"\nstep = "20ms"'
        self.write("scene.toml", scene(beat, run=run))
        self.run_tool("--scene", "scene.toml", "out.hdf")
        with h5py.File(self.path("out.hdf")) as file:
            size = np.linalg.norm(file["tunica/nodes/displacement"], axis=2).max(axis=1)
        self.assertEqual(size[0], 0)
        self.assertGreater(size[10], 0.1)
        self.assertLess(size[-1], 0.01 * size[10])

    def test_the_tension_raises_frequencies_and_buckling_pressures(self):
        run = 'kind = "frequencies"\ncount = 3'
        found = []
        for image in ("0kPa", "8kPa"):
            self.write("scene.toml", scene(f'value = "{image}"\nimaged_at = "{image}"', run=run))
            found.append(self.run_tool("--scene", "scene.toml", "out.hdf", "--force")["result"]["frequencies_hz"][0])
        self.assertGreater(found[1], 1.02 * found[0])
        factors = []
        for image in (0, 2):  # the load that is added counts
            run = 'kind = "buckling"\ncount = 1'
            self.write("scene.toml", scene(f'value = "{image - 1}kPa"\nimaged_at = "{image}kPa"', run=run))
            factors.append(self.run_tool("--scene", "scene.toml", "out.hdf", "--force")["result"]["buckling_factors"][0])
        self.assertAlmostEqual(factors[1] - factors[0], 2, delta=0.2)

    def test_it_goes_with_contact_and_accuracy(self):
        plate = '[[rigid]]\nname = "plate"\nshape = "plane"\npoint = [["0s", ["0mm", "0mm", "29mm"]], ["1s", ["0mm", "0mm", ' \
                '"27.7mm"]]]\nnormal = [0.0, 0.0, -1.0]\n[[contact]]\nname = "c"\nbetween = ["wall", "plate"]\n'
        text = scene('value = "4kPa"\nimaged_at = "4kPa"', more=plate)
        self.write("scene.toml", text.replace('where = {rigid_motions = true}', 'where = {below = {axis = "z", at = "-20mm"}}\ntranslation = "xyz"\nrotation = "xyz"')
                   .replace('["0s",', '[0.0,').replace('["1s",', '[1.0,'))
        result = self.run_tool("--scene", "scene.toml", "out.hdf")["result"]
        self.assertLess(result["contacts"]["c"]["force_n"][-1][2], -0.1)
        write_ply(self.path("target.ply"), *oval(5)[:2])
        write_ply(self.path("few.ply"), *oval(1))
        claim = self.run_tool("few.ply", "out.hdf", *THIN, "--imaged-at", "120mmHg", "--static", "--accuracy", "3%", "--of",
                              "stress", "--target", "target.ply", "--force")["result"]
        self.assertTrue(claim["accuracy"]["credible"])
        self.assertEqual(claim["max_displacement_mm"], 0)
        self.assertIn("prestress", claim)

    def test_it_is_resumed_as_it_began(self):
        self.write("scene.toml", scene('value = "2kPa"\nimaged_at = "1kPa"', run='kind = "static"\nload_steps = 4'))
        self.run_tool("--scene", "scene.toml", "out.hdf", "--export", "inp", code=2, says="no prestress")

    def test_a_coarse_mesh_says_how_far_it_is_off(self):
        """Membrane stress of an ellipsoid, p R2 / (2 t) at its poles at least: the estimate covers what is left of it."""
        write_ply(self.path("few.ply"), *oval(1))
        write_ply(self.path("target.ply"), *oval(5)[:2])
        at = ("--imaged-at", "120mmHg", "--static", "--force")
        few = self.run_tool("few.ply", "out.hdf", *THIN, *at, "--target", "target.ply")["result"]
        write_ply(self.path("many.ply"), *oval(4))
        many = self.run_tool("many.ply", "out.hdf", *THIN, *at)["result"]
        self.assertEqual(many["estimates"], {})
        for key in ("membrane_p99_mpa", "stress_p99_mpa", "tension_p99_n_per_mm"):
            estimate = few["estimates"][key]
            error = 100 * abs(few["wall"][key] / many["wall"][key] - 1)
            self.assertLess(error, 1.5 * estimate["percent"] + 0.05)
            self.assertLess(estimate["percent"], 5 * error + 1)
            self.assertIn("one refinement to 320 shells", estimate["from"])
        self.assertEqual(few["estimates"]["max_displacement_mm"]["percent"], 0)

    def test_a_surface_no_finer_than_the_shells_gives_no_estimate(self):
        write_ply(self.path("oval.ply"), *oval(1))
        write_ply(self.path("same.ply"), *oval(1)[:2])
        run = ("oval.ply", "out.hdf", *THIN, "--imaged-at", "120mmHg", "--static", "--force")
        self.assertIn("or name the surface", " ".join(self.run_tool(*run)["warnings"]))
        report = self.run_tool(*run, "--target", "same.ply")
        self.assertEqual(report["result"]["estimates"], {})
        self.assertIn("too few to fit", " ".join(report["warnings"]))
        self.assertNotIn("or name the surface", " ".join(report["warnings"]))

    def test_a_bound_of_time_ends_with_what_there_is(self):
        write_ply(self.path("few.ply"), *oval(1))
        write_ply(self.path("target.ply"), *oval(5)[:2])
        report = self.run_tool("few.ply", "out.hdf", *THIN, "--imaged-at", "120mmHg", "--static", "--accuracy", "0.001%", "--of",
                               "stress", "--target", "target.ply", "--max-seconds", "1ms")
        self.assertFalse(report["result"]["accuracy"]["credible"])
        self.assertIn("past the 0.001 s allowed", " ".join(report["warnings"]))
        self.run_tool("few.ply", "out.hdf", *THIN, "--imaged-at", "120mmHg", "--static", "--accuracy", "0.001%", "--of", "stress",
                      "--target", "target.ply", "--max-seconds", "1ms", "--shell-out", "fine.ply", "--force")
        self.assertTrue(self.exists("fine.ply"))
        self.run_tool("few.ply", "out.hdf", *THIN, "--imaged-at", "120mmHg", "--static", "--max-seconds", "1s", "--force", code=2,
                      says="--max-seconds belongs to --accuracy")

    def test_equilibrium_decides_the_membrane_stress(self):
        """At the equator of the ellipsoid, half axes a and b: p a / 2 along, p a (1 - a^2 / (2 b^2)) around."""
        write_ply(self.path("oval.ply"), *oval(4))
        self.run_tool("oval.ply", "out.hdf", *THIN, "--imaged-at", "120mmHg", "--static")
        with h5py.File(self.path("out.hdf")) as file:
            force = np.array(file["tunica/elements/membrane_force"][-1])
            nodes = np.array(file["tunica/elements/nodes"])
        points = oval(4)[0][nodes].mean(axis=1)
        near = abs(points[:, 2]) < 1
        along, around = RADIUS / 2, RADIUS * (1 - 1 / (2 * 1.4**2))
        mean = force[near, :2].sum(axis=1).mean()
        self.assertAlmostEqual(mean / (120 * MMHG * (along + around)), 1, delta=5e-3)
        self.assertTrue(math.isfinite(mean))


if __name__ == "__main__":
    unittest.main()
