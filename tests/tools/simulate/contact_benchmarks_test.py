#!/usr/bin/python3
"""Contact against further known answers: plates, membranes, belts, balls, closing tubes, impacts, a hoop."""
import math
import re
import signal
import tempfile
import time
import unittest

import contact_scenes
import contact_scenes_more as scenes
import h5py
import numpy as np
from published import Bench
from running import ToolTest

# A clamped plate on a flat, m: (b / a, force / load). Plate theory; and, half a wall above the flat with a rim that
# holds it in its plane too, von Karman's theory by 80 axisymmetric elements. Without stretch these give the former.
PLATE = {2: (0.09406, 0.13146), 16: (0.47295, 0.41782)}
STRETCHED_PLATE = {2: (0.07434, 0.10665), 16: (0.46657, 0.40308)}


class Benchmarks(ToolTest):
    def setUp(self):
        super().setUp()
        self.bench = Bench(self.folder)

    def assert_part(self, value, answer, within):
        self.assertAlmostEqual(value / answer, 1, delta=within)

    def assert_sound(self, record, result):
        self.assertLess(result["balance"]["force"], 1e-12)
        self.assertLess(result["balance"]["moment"], 1e-12)
        for gap in record["smallest_gap_mm"]:
            self.assertTrue(gap["lower"] is None or 0 < gap["lower"] <= gap["upper"], gap)

    def assert_plate(self, answer, *scene, **more):
        radius, force, record, result = scenes.plate_on_a_flat(self.bench, *scene, **more)
        self.assert_part(radius, answer[0], 0.02)
        self.assert_part(force, answer[1], 0.01)
        self.assert_sound(record, result)

    def test_a_plate_half_a_wall_above_a_flat(self):
        for m, resolution, segments in ((2, "0.2%", 16), (16, "0.5%", 12)):
            with self.subTest(m=m):
                self.assert_plate(STRETCHED_PLATE[m], m, 0.5, resolution, segments)

    def test_a_plate_a_tenth_of_a_wall_above_a_flat(self):
        """Its rim may move in its plane, so that stretching changes the answer by no more than .2 %."""
        for m, resolution, segments in ((2, "0.1%", 24), (16, "0.2%", 16)):
            with self.subTest(m=m):
                self.assert_plate(PLATE[m], m, 0.1, resolution, segments, rim="z")

    def test_an_inflated_membrane_presses_with_its_pressure(self):
        ratio, record, result = scenes.membrane_on_a_flat(self.bench, 1e-4, "5%")
        self.assert_part(ratio, 1, 0.01)
        self.assert_sound(record, result)

    def test_an_inflated_ring_between_plates(self):
        for height in (8.0, 6.0):
            ratio, record, result = scenes.blown_ring(self.bench, height, "5%")
            self.assert_part(ratio, 1, 0.01)
            self.assert_sound(record, result)

    def test_a_belt_over_a_cylinder(self):
        for friction, degrees in ((0.2, 90), (0.3, 180), (0.0, 180)):
            ratio, record, result = scenes.capstan(self.bench, friction, degrees, cells=12)
            self.assert_part(ratio, math.exp(friction * math.radians(degrees)), 0.01)
            self.assert_sound(record, result)

    def test_an_elastic_ball_on_a_rigid_plane(self):
        force, radius, record, result = scenes.hertz(self.bench, "plane", 8)
        self.assert_part(force, 1, 0.02)
        self.assert_part(radius, 1, 0.03)
        self.assert_sound(record, result)

    def test_a_rigid_ball_on_an_elastic_half_space(self):
        """Errors fall with the square of the mesh, to Hertz's answer."""
        (coarse, *_), (fine, radius, record, result) = (scenes.hertz(self.bench, "ball", cells) for cells in (6, 8))
        self.assertLess(abs(fine - 1), 0.7 * abs(coarse - 1))
        self.assert_part((64 * fine - 36 * coarse) / 28, 1, 0.02)
        self.assert_part(radius, 1, 0.03)
        self.assert_sound(record, result)

    def test_balls_in_a_capsule(self):
        for (inner, poisson), answer in scenes.BALL.items():
            self.assert_part(scenes.ball_in_a_capsule(self.bench, inner, poisson), answer, 0.01)

    def test_a_thick_sphere(self):
        for poisson in (0.3, 0.4999):
            for ratio in scenes.thick_sphere(self.bench, poisson):
                self.assert_part(ratio, 1, 0.01)

    def test_a_plaque_in_its_wall_widened_by_a_cylinder(self):
        for poisson, (way, pressure) in scenes.PLAQUE.items():
            found = scenes.plaque(self.bench, poisson)
            self.assert_part(found[0], way, 0.01)
            self.assert_part(found[1], pressure, 0.01)
            self.assert_sound(*found[2:])

    def test_a_tube_closes_under_pressure(self):
        for pressure, answer in scenes.WAIST.items():
            places, *_ = scenes.closing_tube(self.bench, pressure)
            self.assert_part((places[0, 2] - places[-1, 2]) / 2, answer, 0.01)

    def test_a_closed_tube_touches_itself(self):
        for pressure, (width, height) in scenes.CLOSED.items():
            places, record, result = scenes.closing_tube(self.bench, pressure)
            self.assertGreater(record["points"][-1], 0)
            self.assert_part(places[:, 0].max(), width, 0.001)
            self.assert_part(places[:, 2].max(), height, 0.005)
            self.assert_sound(record, result)

    def test_two_solids_press_as_each_on_the_plane_between(self):
        plane, *_ = scenes.two_caps(self.bench, "plane")
        both, record, result = scenes.two_caps(self.bench, "caps")
        self.assert_part(both, plane, 0.01)
        self.assert_sound(record, result)

    def test_stacked_blocks_press_evenly(self):
        """Flush sides, meshes that do not fit. The gap takes its part of the way that they are pressed by."""
        for resolution in ("1%", "5%"):
            ratio, record, result = scenes.stacked_blocks(self.bench, resolution)
            self.assert_part(ratio, 1 + record["smallest_gap_mm"][-1]["upper"] / 0.05, 0.015)
            self.assert_sound(record, result)

    def test_momentum_is_kept_in_an_impact(self):
        for pair, off in (("ball-ball", 0.1), ("ball-ball", 2.0)):
            with self.subTest(pair=pair, off=off):
                momenta, given, record, _ = scenes.impact(self.bench, pair, off)
                self.assertGreater(max(record["points"]), 0)
                self.assertLess(abs(momenta[20:] - given).max(), 1e-9 * np.linalg.norm(given))

    def test_a_plane_takes_the_momentum_that_it_says(self):
        momenta, given, record, _ = scenes.impact(self.bench, "ball-plane")
        taken = np.cumsum(record["force_n"], axis=0) * 1e-3
        self.assertGreater(momenta[-1][2], 0)
        self.assertLess(abs(momenta[20:] - given - taken[20:]).max(), 2e-9 * np.linalg.norm(given))

    def test_a_shell_that_bounces_never_passes_the_plane(self):
        momenta, _, record, result = scenes.impact(self.bench, "sphere-plane")
        self.assertGreater(momenta[-1][2], 0)
        self.assertGreater(max(record["points"]), 0)
        self.assert_sound(record, result)

    def test_metres_give_the_same_digits(self):
        for name, force in (("ring", lambda bench: contact_scenes.ring(bench, 0.1)[0]),
                            ("plaque", lambda bench: scenes.plaque(bench, 0.3, 0.03, 12, 4, "1%")[1]),
                            ("membrane", lambda bench: scenes.membrane_on_a_flat(bench, 1e-4, "20%", 6)[0])):
            with self.subTest(name), tempfile.TemporaryDirectory() as folder:
                self.assert_part(force(scenes.InMetres(folder)), force(self.bench), 1e-9)

    def test_a_hoop_of_twelve_shells_rolls_down_a_slope(self):
        """On its outer face: with a thick wall that tells from the middle."""
        for wall in (0.1, 0.5):
            way, answer, result = scenes.hoop(self.bench, "curved", wall)
            self.assert_part(way, answer, 0.01)
            self.assert_sound(result["contacts"]["c"], result)

    def test_a_hoop_of_twelve_facets_stays_put(self):
        way, answer, _ = scenes.hoop(self.bench, "facets")
        self.assertLess(abs(way), 0.01 * answer)

    def states_of(self, name):
        """How many states a run has written so far."""
        try:
            with h5py.File(self.bench.path(name), locking=False) as file:
                return len(file["tunica/history/time"])
        except (OSError, KeyError):
            return 0

    def kill_and_resume(self, after):
        """Runs the scene again, kills that run after so many states, resumes it. @return after which step it went on"""
        running = self.start_tool("simulate", "--scene", "run.toml", "again.hdf", "--quiet")
        while running.poll() is None and self.states_of("again.hdf.part") < after:
            time.sleep(0.005)
        running.send_signal(signal.SIGKILL)
        self.assertEqual(running.wait(), -signal.SIGKILL)
        self.run_tool("simulate", "--resume", "again.hdf.part", says="goes on after step")
        return int(re.search(r"goes on after step (\d+)", self.done.stderr)[1])

    def test_a_run_that_was_killed_in_contact_goes_on_to_the_bit(self):
        contact_scenes.ring(self.bench, 0.4, steps=200)
        self.assertGreaterEqual(self.kill_and_resume(100), 1)  # in contact since the first
        with h5py.File(self.bench.path("run.hdf")) as whole, h5py.File(self.bench.path("again.hdf")) as again:
            for group in ("tunica/contacts/c", "tunica/nodes"):
                for key, values in whole[group].items():
                    np.testing.assert_array_equal(values[()], again[group][key][()], err_msg=key)


if __name__ == "__main__":
    unittest.main()
