#!/usr/bin/python3
"""Contact where it is hard: bodies that could pass through each other unseen, corners, forces that jump from face to face."""
import unittest

import numpy as np
from support import SimulateTest, grid, sphere, write_ply

MATERIAL = 'young = "1MPa"\npoisson = 0.45\ndensity = "1g/cm3"\n'
STEPS = {"static": 'kind = "static"\nload_steps = {}\n', "dynamic": 'kind = "dynamic"\nstep = "1ms"\nduration = "{}ms"\n'}


def run(kind, steps):
    return "[run]\n" + STEPS[kind].format(steps)


def shell(name, mesh, thickness, held, more=""):
    return (f'[[shell]]\nname = "{name}"\nmesh = "{mesh}"\nthickness = "{thickness}mm"\n{MATERIAL}'
            f'[[fix]]\nbody = "{name}"\nwhere = {held}\ntranslation = "xyz"\nrotation = "xyz"\n{more}')


def moved(*rows):
    return "motion = [" + ", ".join(f'[{at}, ["{x}mm", "{y}mm", "{z}mm"]]' for at, (x, y, z) in rows) + "]\n"


def contact(one, other, more=""):
    return f'[[contact]]\nname = "c"\nbetween = ["{one}", "{other}"]\n{more}'


class Robust(SimulateTest):
    def setUp(self):
        super().setUp()
        points, triangles = grid(10, 10, 20, 20)
        write_ply(self.path("plate.ply"), points - [10, 10, 0], triangles, np.tile([0, 0, 1.0], (len(points), 1)))
        self.plate = shell("p", "plate.ply", 0.5, "{boundary = true}")

    def touched(self, scene):
        result = self.simulate(scene)
        record = result["contacts"]["c"]
        self.assertLess(result["balance"]["force"], 1e-12)
        return record, result

    def test_a_bullet_does_not_pass_through_within_a_step(self):
        """Neither as one step nor where settling finds a state on the far side."""
        ball = '[[rigid]]\nname = "b"\nshape = "sphere"\ncentre = ["0mm", "0mm", "5mm"]\nradius = "2mm"\n'
        for kind, end, steps in (("dynamic", "0.002s", 2), ("static", 1, 1)):
            with self.subTest(kind):
                rows = ((0 if kind == "static" else "0s", (0, 0, 0)), (end, (0, 0, -60)))
                motion = "motion = [" + ", ".join(
                    f'[{at if kind == "static" else chr(34) + at + chr(34)}, ["{x}mm", "{y}mm", "{z}mm"]]' for at, (x, y, z) in rows) + "]\n"
                self.write("scene.toml", run(kind, steps) + self.plate + ball + motion + contact("b", "p"))
                self.run_tool("--scene", "scene.toml", "out.hdf", code=4)

    def test_a_motion_there_and_back_is_followed_within_one_load_step(self):
        """The way ends where the motion turns: what it pushes on the way is found, and friction remembers it."""
        ball = ('[[rigid]]\nname = "b"\nshape = "sphere"\ncentre = ["0mm", "0mm", "2.4mm"]\nradius = "2mm"\n' +
                moved((0, (0, 0, 0)), (0.5, (0, 0, -0.6)), (1, (0, 0, 0))))
        _, result = self.touched(run("static", 1) + self.plate + ball + contact("b", "p"))
        self.assertNotIn("nothing touches", self.done.stderr)
        self.assertGreater(result["newton_iterations"], 6)

    def test_the_tip_of_a_rigid_mesh_is_seen_between_samples(self):
        """A cone above the middle of a shell."""
        turns = 2 * np.pi * np.arange(12) / 12
        points = np.concatenate([[[0, 0, 0]], np.stack([0.5 * np.cos(turns), 0.5 * np.sin(turns), np.full(12, 4.0)], axis=1), [[0, 0, 4]]])
        triangles = [(0, 1 + (k + 1) % 12, 1 + k) for k in range(12)] + [(13, 1 + k, 1 + (k + 1) % 12) for k in range(12)]
        write_ply(self.path("cone.ply"), points, triangles)
        tool = '[[rigid]]\nname = "t"\nmesh = "cone.ply"\n' + moved((0, (0.7, 0.4, 0.3)), (1, (0.7, 0.4, -0.5)))
        record, _ = self.touched(run("static", 4) + self.plate + tool + contact("t", "p"))
        self.assertGreater(record["force_n"][-1][2], 1e-3)
        self.assertGreater(record["smallest_gap_mm"][-1]["lower"], 0)
        pierced = tool.replace('"0.3mm"', '"-1mm"')
        self.write("scene.toml", run("static", 4) + self.plate + pierced + contact("t", "p"))
        self.run_tool("--scene", "scene.toml", "pierced.hdf", code=3, says="t and p overlap by ")

    def test_two_equal_balls_node_on_node(self):
        """The normals of each jump where the other's nodes lie: forces are equal, and along the axis."""
        points, triangles, normals = sphere(2, 10)
        # A node at either pole.
        axis = points[0] / np.linalg.norm(points[0])
        side = np.cross(axis, [1.0, 0, 0])
        side /= np.linalg.norm(side)
        turn = np.stack([side, np.cross(axis, side), axis])
        points, normals = points @ turn.T, normals @ turn.T
        write_ply(self.path("lower.ply"), points, triangles, normals)
        mirror = np.array([1, 1, -1.0])
        write_ply(self.path("upper.ply"), points * mirror + [0, 0, 21.5], np.array(triangles)[:, ::-1], normals * mirror)
        scene = (run("static", 4) + shell("a", "lower.ply", 1, '{below = {axis = "z", at = "-6mm"}}') +
                 shell("b", "upper.ply", 1, '{above = {axis = "z", at = "27.5mm"}}', 'displacement = ["0mm", "0mm", "-1mm"]\n') +
                 contact("a", "b"))
        record, _ = self.touched(scene)
        x, y, z = record["force_n"][-1]
        self.assertLess(z, -0.01)
        self.assertLess(max(abs(x), abs(y)), 5e-3 * abs(z))
        self.assertGreater(min(gap["lower"] for gap in record["smallest_gap_mm"] if gap["lower"] is not None), 0)

    def test_slip_adds_up(self):
        """A ball drawn over a held plate by 2 mm."""
        ball = ('[[rigid]]\nname = "b"\nshape = "sphere"\ncentre = ["-1mm", "0mm", "2.3mm"]\nradius = "2mm"\n' +
                moved((0, (0, 0, 0)), (0.2, (0, 0, -0.2)), (1, (2, 0, -0.2))))
        scene = run("static", 10) + self.plate + ball + contact("b", "p", "friction = 0.1\n")
        record, _ = self.touched(scene)
        slip = record["slip_mm"]
        self.assertTrue(all(b >= a - 0.3 for a, b in zip(slip, slip[1:])), slip)
        self.assertGreater(max(slip), 0.3)
        self.assertLess(max(slip), 2.01)

    def test_bodies_do_not_touch_where_one_carries_the_other(self):
        points, triangles = grid(4, 4, 6, 6)
        write_ply(self.path("patch.ply"), points + [-3.2, -3.1, 0.5], triangles, np.tile([0, 0, 1.0], (len(points), 1)))
        carried = (f'[[shell]]\nname = "q"\nmesh = "patch.ply"\nthickness = "0.5mm"\n{MATERIAL}[[attach]]\nbody = "q"\nto = "p"\n'
                   'where = {all = true}\nside = "outer"\n')
        scene = run("static", 1) + self.plate + carried + contact("p", "q") + '[[load]]\nbody = "p"\nkind = "pressure"\nvalue = "1kPa"\n'
        result = self.simulate(scene)
        self.assertEqual(result["contacts"]["c"]["points"][-1], 0)

    def test_a_failed_run_keeps_its_last_accepted_state(self):
        ball = ('[[rigid]]\nname = "b"\nshape = "sphere"\ncentre = ["0mm", "0mm", "2.4mm"]\nradius = "2mm"\n' +
                moved((0, (0, 0, 0)), (1, (0, 0, -80))))
        self.write("scene.toml", run("static", 1) + self.plate + ball + contact("b", "p"))
        report = self.run_tool("--scene", "scene.toml", "out.hdf", code=4)
        self.assertRegex(self.done.stderr, r"in contact c they are closest at \([-0-9.e+]+, [-0-9.e+]+, [-0-9.e+]+\) mm, "
                                           "where b meets p")
        record = report["result"]["contacts"]["c"]
        self.assertGreater(record["smallest_gap_mm"][-1]["lower"], 0)
        self.assertLess(abs(record["force_n"][-1][2]), 100)

    def test_memory_is_that_of_what_is_near(self):
        """Many small bodies on a plate: each contact is near few of its shells. Samples of all shells for all of them
        take 1.4 GiB."""
        points, triangles = grid(12, 12, 20, 20)
        write_ply(self.path("many.ply"), points - [10, 10, 0], triangles, np.tile([0, 0, 1.0], (len(points), 1)))
        scene = run("static", 1) + shell("p", "many.ply", 0.5, "{boundary = true}")
        for k in range(30):
            x, y = -7.5 + 3 * (k % 6), -6 + 3 * (k // 6)
            scene += (f'[[rigid]]\nname = "b{k}"\nshape = "sphere"\ncentre = ["{x}mm", "{y}mm", "0.46mm"]\nradius = "0.2mm"\n' +
                      moved((0, (0, 0, 0)), (1, (0, 0, -0.02))) + f'[[contact]]\nname = "c{k}"\nbetween = ["b{k}", "p"]\n')
        self.write("scene.toml", scene)
        report = self.run_tool("--scene", "scene.toml", "out.hdf", "--memory-limit", "1GB")
        self.assertLess(report["peak_mib"], 400)
        self.assertGreater(report["result"]["contacts"]["c14"]["force_n"][-1][2], 0)

    def test_a_step_that_hardly_gets_on_says_where_and_why(self):
        """A tube that its load flattens: its wall buckles, and comes to touch itself."""
        columns, rows = 16, 3
        sheet, triangles = grid(columns, rows, 2 * np.pi, 10)
        around = np.stack([np.cos(sheet[:, 0]), np.sin(sheet[:, 0]), 0 * sheet[:, 0]], axis=1)
        closed = np.arange(len(sheet)).reshape(rows + 1, columns + 1)
        closed[:, -1] = closed[:, 0]
        used, numbers = np.unique(closed, return_inverse=True)
        triangles = numbers.reshape(-1)[triangles]
        write_ply(self.path("tube.ply"), 5 * around[used] + sheet[used] * [0, 0, 0] + np.outer(sheet[used, 1], [0, 0, 1]),
                  triangles, around[used])
        self.write("scene.toml", run("static", 1) + shell("t", "tube.ply", 0.3, '{below = {axis = "z", at = "0.01mm"}}') +
                   '[[load]]\nbody = "t"\nkind = "pressure"\nvalue = "-2kPa"\n' + contact("t", "t"))
        report = self.run_tool("--scene", "scene.toml", "out.hdf", code=4)
        notes = [note for note in report["notes"] if "hardly gets on" in note]
        self.assertEqual(len(notes), 1)
        self.assertRegex(notes[0], r"^scene.toml: load factor [0-9.]+ of 1: this step hardly gets on: [12]\d\d iterations so far; "
                                   r"in a part of [0-9.e-]+ (the stiffness is not positive|bodies|Newton).*(; it yields most at|they "
                                   r"are closest at) \([-0-9.e+]+, [-0-9.e+]+, [-0-9.e+]+\) mm.*; if it takes too long, stop it and let ")
        self.assertRegex(report["error"], r"(; it yields most at|they are closest at) \([-0-9.e+]+, [-0-9.e+]+, [-0-9.e+]+\) mm")


if __name__ == "__main__":
    unittest.main()
