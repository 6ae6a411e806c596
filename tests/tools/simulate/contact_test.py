#!/usr/bin/python3
"""Contact against known answers, friction, balance, and what is refused."""
import json
import math
import unittest
from pathlib import Path

import numpy as np
from contact_scenes import RING, SPHERE, block, ring, slope, sphere, tube, write_vtk
from published import Bench, run_lines
from running import ToolTest


class Contact(ToolTest):
    def setUp(self):
        super().setUp()
        self.bench = Bench(self.folder)

    def assert_sound(self, record, result):
        self.assertLess(result["balance"]["force"], 1e-12)
        self.assertLess(result["balance"]["moment"], 1e-12)
        for gap in record["smallest_gap_mm"]:
            self.assertTrue(gap["lower"] is None or gap["lower"] > 0, gap)
            self.assertTrue(gap["lower"] is None or gap["lower"] <= gap["upper"], gap)

    def test_ring_between_plates(self):
        for flattening, answer in RING.items():
            force, record, result = ring(self.bench, flattening)
            self.assertAlmostEqual(force / answer, 1, delta=0.005)
            self.assert_sound(record, result)

    def test_a_finer_resolution_is_exacter(self):
        errors = [abs(ring(self.bench, 0.1, resolution)[0] / RING[0.1] - 1) for resolution in ("20%", "5%", "1%")]
        self.assertLess(errors[1], errors[0] / 2)
        self.assertLess(errors[2], 3e-4)

    def test_sphere_under_a_plate(self):
        for drop in (0.9995, 1.498):
            force, record, result = sphere(self.bench, drop)
            self.assertAlmostEqual(force / SPHERE[drop], 1, delta=0.01)
            self.assert_sound(record, result)

    def test_tube_on_a_rigid_cylinder(self):
        ratio, record, result = tube(self.bench)
        self.assertAlmostEqual(ratio, 1, delta=0.005)
        self.assert_sound(record, result)

    def test_flat_facets_touch_elsewhere_than_the_curved_surface(self):
        curved, flat = tube(self.bench)[0], tube(self.bench, more="surface = \"facets\"\n")[0]
        self.assertGreater(abs(flat / curved - 1), 1e-3)

    def test_the_papers_rule_is_not_in_balance_and_says_so(self):
        ratio, _, result = tube(self.bench, more="transfer = \"paper\"\n")
        self.assertAlmostEqual(ratio, 1, delta=0.005)
        self.assertLess(result["balance"]["force"], 1e-12)
        self.assertGreater(result["balance"]["moment"], 1e-3)
        with open(self.bench.path("run.json"), encoding="utf-8") as file:
            self.assertIn("which is not in balance", "".join(json.load(file)["warnings"]))

    def test_a_block_sticks_below_the_angle_of_friction(self):
        result = slope(self.bench, 0.999 * math.atan(0.3), 0.3, run_lines(kind="static", load_steps=1))
        self.assertEqual(self.bench.code, 0, self.bench.error)
        self.assertLess(result["contacts"]["c"]["slip_mm"][-1], 1e-4)

    def test_a_block_finds_no_rest_above_it(self):
        slope(self.bench, 1.05 * math.atan(0.3), 0.3, run_lines(kind="static", load_steps=1))
        self.assertEqual(self.bench.code, 4)

    def test_a_block_slides_with_the_right_acceleration(self):
        angle, friction, steps, step = math.radians(30), 0.2, 20, 0.005
        result = slope(self.bench, angle, friction, run_lines(kind="dynamic", duration="0.1s", step="5ms"))
        self.assertEqual(self.bench.code, 0, self.bench.error)
        # Backward Euler moves by a step^2 n (n + 1) / 2.
        way = 9810 * (math.sin(angle) - friction * math.cos(angle)) * step**2 * steps * (steps + 1) / 2
        self.assertAlmostEqual(result["max_displacement_mm"] / way, 1, delta=0.01)

    def test_bodies_that_touch_in_the_reference_are_understood(self):
        slope(self.bench, 0.1, 0.3, run_lines(kind="static", load_steps=1))
        points, tetrahedra = block(2, np.array([10.0, 10.0, 5.0]), np.zeros(3))
        write_vtk(self.bench.path("mesh.vtk"), points, tetrahedra)
        result = self.bench.run(Path(self.bench.path("run.toml")).read_text(encoding="utf-8"), check=False)
        self.assertEqual(self.bench.code, 0, self.bench.error)
        self.assert_sound(result["contacts"]["c"], result)

    def test_bodies_that_overlap_are_named(self):
        slope(self.bench, 0.1, 0.3, run_lines(kind="static", load_steps=1))
        scene = Path(self.bench.path("run.toml")).read_text(encoding="utf-8")
        self.bench.run(scene.replace("point = [\"0.0mm\", \"0.0mm\", \"0.0mm\"]", "point = [\"0mm\", \"0mm\", \"1mm\"]"),
                       check=False)
        self.assertEqual(self.bench.code, 3)
        self.assertIn("b and p overlap by 0.98", self.bench.error)


if __name__ == "__main__":
    unittest.main()
