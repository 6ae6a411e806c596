#!/usr/bin/python3
"""Scenes with contact that can hardly be meant are named before the first step: by `--check`, with their place."""
import re
import unittest

import numpy as np
from contact_scenes import block, write_vtk
from support import SimulateTest, grid, sphere, write_ply

RUN = "[run]\nkind = \"static\"\n"
HELD = "where = {boundary = true}\ntranslation = \"xyz\"\nrotation = \"xyz\"\n"


def shell(name="plate", mesh="plate.ply"):
    """Held at its rim; 10 x 10 x 0.2 mm from the origin, its middle at z = 0. Ten lines."""
    return (f"[[shell]]\nname = \"{name}\"\nmesh = \"{mesh}\"\nthickness = \"0.2mm\"\nyoung = \"1MPa\"\npoisson = 0.3\n"
            f"[[fix]]\nbody = \"{name}\"\n{HELD}")


def solid(mesh, name="cube"):
    return (f"[[solid]]\nname = \"{name}\"\nmesh = \"{mesh}\"\nunit = \"mm\"\nyoung = \"60kPa\"\npoisson = 0.3\n"
            f"[[fix]]\nbody = \"{name}\"\nwhere = {{all = true}}\ntranslation = \"xyz\"\n")


def ball(height, name="ball", more=""):
    return (f"[[rigid]]\nname = \"{name}\"\nshape = \"sphere\"\ncentre = [\"5mm\", \"5mm\", \"{height}mm\"]\nradius = \"1mm\"\n{more}")


def contact(one, other, more=""):
    return f"[[contact]]\nbetween = [\"{one}\", \"{other}\"]\n{more}"


class BadScenes(SimulateTest):
    def setUp(self):
        super().setUp()
        points, triangles = grid(6, 6, 10, 10)
        write_ply(self.path("plate.ply"), points, triangles)
        write_ply(self.path("above.ply"), points + [0, 0, 0.15], triangles)
        points, triangles, normals = sphere(1, 2)
        write_ply(self.path("ball.ply"), points + [5, 5, 1.5], triangles, normals)
        write_ply(self.path("open.ply"), points, triangles[:-1], normals)
        self.points, self.tetrahedra = block(2, np.array([2.0, 2.0, 2.0]), np.array([4.0, 4.0, 0.2]))
        write_vtk(self.path("cube.vtk"), self.points, self.tetrahedra)
        write_vtk(self.path("low.vtk"), self.points - [0, 0, 0.15], self.tetrahedra)
        write_vtk(self.path("far.vtk"), self.points + [0, 0, 5], self.tetrahedra)

    def named(self, scene, *words, place=None):
        """Exit 3 and all the words in one line, which begins with the place of the scene's last line that holds `place`."""
        self.write("scene.toml", scene)
        self.run_tool("--scene", "scene.toml", "--check", code=3)
        line = self.done.stderr.strip().splitlines()[-1]
        for word in words:
            self.assertIn(word, line)
        if place:
            number = max(i for i, text in enumerate(scene.splitlines(), 1) if place in text)
            self.assertTrue(line.startswith(f"tunica-simulate: scene.toml:{number}:"), line)

    def refused(self, scene, message):
        """By the run, not by --check."""
        self.write("scene.toml", scene)
        self.run_tool("--scene", "scene.toml", "out.hdf", code=3, says=message)

    def noted(self, scene, *words):
        self.write("scene.toml", scene)
        self.run_tool("--scene", "scene.toml", "--check")
        for word in words:
            self.assertIn(word, self.done.stderr)

    def test_bodies_that_overlap(self):
        for more, pair, depth in ((ball(0.9), ("ball", "plate"), 0.2),  # the wall's face is at 0.1
                                  (shell("upper", "above.ply"), ("plate", "upper"), 0.05),
                                  (solid("low.vtk"), ("plate", "cube"), None),
                                  ("[[rigid]]\nname = \"tool\"\nmesh = \"ball.ply\"\n", ("tool", "plate"), None)):
            with self.subTest(pair=pair):
                self.named(RUN + shell() + more + contact(*pair), f"{pair[0]} and {pair[1]} overlap by ", "move them apart",
                           place="[[contact]]")
                said = float(re.search(r"overlap by ([0-9.]+) mm", self.done.stderr)[1])
                self.assertAlmostEqual(said, depth or said, delta=0.001)

    def test_a_body_wholly_inside_another(self):
        points, tetrahedra = block(3, np.array([4.0, 4.0, 4.0]), np.array([3.0, 3.0, -2.0]))
        write_vtk(self.path("big.vtk"), points, tetrahedra)
        points, tetrahedra = block(2, np.array([1.0, 1.0, 1.0]), np.array([4.5, 4.5, -0.5]))
        write_vtk(self.path("small.vtk"), points, tetrahedra)
        points, triangles, normals = sphere(1, 0.5)
        write_ply(self.path("inside.ply"), points + [5, 5, 0], triangles, normals)
        closed = shell("ball", "inside.ply").replace("boundary = true", "all = true")
        big = solid("big.vtk")
        for more, name in ((solid("small.vtk", "small"), "small"), (closed, "ball"), (ball(0), "ball"),
                           ("[[rigid]]\nname = \"tool\"\nmesh = \"inside.ply\"\n", "tool")):
            with self.subTest(name=name):
                self.named(RUN + big + more + contact("cube", name), f"cube and {name} overlap by ", place="[[contact]]")
                self.assertGreaterEqual(float(re.search(r"overlap by ([0-9.]+) mm", self.done.stderr)[1]), 1.499)

    def test_solids_that_overlap_are_told_how_deep(self):
        for name, shift in (("one", 0), ("two", 1.3)):
            points, tetrahedra = block(4, np.array([2.0, 2.0, 2.0]), np.array([shift, 0.1, 0.1]))
            write_vtk(self.path(f"{name}.vtk"), points, tetrahedra)
        self.named(RUN + solid("one.vtk", "one") + solid("two.vtk", "two") + contact("one", "two"), "one and two overlap by 0.7 mm")

    def test_a_body_that_nothing_holds(self):
        scene = (RUN + solid("far.vtk").split("[[fix]]", maxsplit=1)[0] + ball(1) + contact("cube", "ball", 'name = "c"\n') +
                 "[[load]]\nbody = \"cube\"\nkind = \"gravity\"\nvalue = [\"0m/s2\", \"0m/s2\", \"9.81m/s2\"]\n")
        self.write("scene.toml", scene.replace("poisson = 0.3", 'poisson = 0.3\ndensity = "1g/cm3"'))
        self.run_tool("--scene", "scene.toml", "out.hdf", code=4, says="nothing but contact could hold cube")

    def test_bodies_that_never_meet(self):
        self.write("scene.toml", RUN + shell() + ball(5) + contact("plate", "ball", 'name = "c"\n') +
                   "[[load]]\nbody = \"plate\"\nkind = \"pressure\"\nvalue = \"-1Pa\"\n")
        self.run_tool("--scene", "scene.toml", "out.hdf", says="c: nothing touches in any step: do these")

    def test_a_body_that_meets_another_within_a_step_only(self):
        ramp = 'radius = [["0s", "1mm"], ["1ms", "3.1mm"], ["2ms", "1mm"]]'
        self.write("scene.toml", '[run]\nkind = "dynamic"\nduration = "12ms"\nstep = "4ms"\n' +
                   shell().replace("poisson = 0.3", 'poisson = 0.3\ndensity = "1100kg/m3"') +
                   ball(3).replace('radius = "1mm"', ramp) + contact("plate", "ball", 'name = "c"\n'))
        report = self.run_tool("--scene", "scene.toml", "out.hdf")
        self.assertEqual(set(report["result"]["contacts"]["c"]["points"]), {0})
        self.assertNotIn("nothing touches", self.done.stderr)
        self.assertIn("note: scene.toml: c: touches within steps only", self.done.stderr)

    def test_pieces_of_a_solid_that_overlap(self):
        whole, tetrahedra = block(3, np.array([4.0, 4.0, 4.0]), np.array([3.0, 3.0, -2.0]))
        for at, code in ((4.5, 3), (6.7, 3), (7.5, 0)):  # wholly inside, in part, beside it
            points, more = block(2, np.array([1.0, 1.0, 1.0]), np.array([at, 4.5, -0.5]))
            write_vtk(self.path("two.vtk"), np.concatenate([whole, points]), np.concatenate([tetrahedra, more + len(whole)]))
            scene = RUN + solid("two.vtk") + contact("cube", "cube")
            with self.subTest(at=at):
                if code:
                    self.named(scene, "cube and cube overlap by ", place="[[contact]]")
                else:
                    self.noted(scene)

    def test_a_solid_of_one_piece_against_itself(self):
        write_vtk(self.path("one.vtk"), *block(3, np.array([4.0, 4.0, 4.0]), np.array([3.0, 3.0, -2.0])))
        self.named(RUN + solid("one.vtk") + contact("cube", "cube"), "solid of one piece", place="[[contact]]")

    def test_a_body_that_crosses_itself(self):
        points, triangles, normals = sphere(1, 2)
        write_ply(self.path("twins.ply"), np.concatenate([points, points + [1, 0.1, 0.2]]),
                  np.concatenate([triangles, triangles + len(points)]), np.concatenate([normals, normals]))
        body = shell("twins", "twins.ply").replace("boundary = true", "all = true")
        self.named(RUN + body + contact("twins", "twins"), "twins and twins overlap by ", place="[[contact]]")

    def test_a_tetrahedron_without_volume(self):
        flat = self.points.copy()
        flat[13] = flat[0]  # the node in the middle onto a corner
        write_vtk(self.path("flat.vtk"), flat, self.tetrahedra)
        self.named(RUN + solid("flat.vtk"), "flat.vtk: tetrahedron ", "has no volume", place="mesh = ")

    def test_tetrahedra_that_are_inside_out_are_turned_and_counted(self):
        turned = self.tetrahedra.copy()
        turned[5:8] = turned[5:8][:, [0, 2, 1, 3]]
        write_vtk(self.path("turned.vtk"), self.points, turned)
        self.noted(RUN + solid("turned.vtk"), "turned.vtk: 3 of 48 tetrahedra were inside out")

    def test_an_attachment_out_of_reach(self):
        body = solid("far.vtk").split("[[fix]]", maxsplit=1)[0]
        self.named(RUN + shell() + body + "[[attach]]\nbody = \"cube\"\nto = \"plate\"\nwhere = {touching = \"0.1mm\"}\n",
                   "selects no node", "the closest lies 5.2 mm from the surface", place="touching")

    def test_all_nodes_attached_out_of_reach(self):
        body = solid("far.vtk").split("[[fix]]", maxsplit=1)[0]
        self.refused(RUN + shell() + body + "[[attach]]\nbody = \"cube\"\nto = \"plate\"\nwhere = {all = true}\n",
                     "cube on plate: node 0 is 5.2 mm away, out of reach")
        plate = shell().split("[[fix]]", maxsplit=1)[0]
        self.refused(RUN + solid("far.vtk") + plate + "[[attach]]\nbody = \"plate\"\nto = \"cube\"\nwhere = {all = true}\n",
                     "plate on cube: node 0 is out of reach, farther out than a tetrahedron")

    def test_a_tetrahedron_that_is_folded_over(self):
        folded = self.points.copy()
        folded[13] = folded[0] - 1  # the node in the middle out through a corner
        write_vtk(self.path("folded.vtk"), folded, self.tetrahedra)
        self.named(RUN + solid("folded.vtk"), "folded.vtk: tetrahedra ", "lie on the same side of the face that they share",
                   place="mesh = ")

    def test_a_rigid_body_that_touches_nothing(self):
        self.noted(RUN + shell() + ball(5), "no [[contact]] names \"ball\", so all goes through it")

    def test_friction_without_contact(self):
        self.named(RUN + shell() + ball(5, more="friction = 0.2\n"), "unknown key 'friction' in [[rigid]]", place="friction")
        self.named(RUN + shell() + ball(5) + "[[contact]]\nfriction = 0.2\n", "between", place="[[contact]]")

    def test_loads_that_no_number_holds(self):
        """Neither are they taken, nor does a message print what is left of them."""
        points, triangles = grid(2, 2, 10, 10)
        write_ply(self.path("plate.ply"), points, triangles, np.tile([0, 0, 1.0], (len(points), 1)))
        for value, factor, code in (("1e306MPa", "1", 3), ("1kPa", "1e300", 3), ("1kPa", "1e150", 4)):
            ramp = f"ramp = [[0, 0], [0.5, {factor}], [1, 0]]\n" if factor != "1" else ""
            self.write("scene.toml", '[run]\nkind = "static"\nload_steps = 1\n[[shell]]\nname = "p"\nmesh = "plate.ply"\n'
                       'thickness = "1mm"\nyoung = "1MPa"\npoisson = 0.3\n[[fix]]\nbody = "p"\nwhere = {boundary = true}\ntranslation = "xyz"\nrotation = "xyz"\n'
                       f'[[load]]\nbody = "p"\nkind = "pressure"\nvalue = "{value}"\n{ramp}')
            self.run_tool("--scene", "scene.toml", "out.hdf", "--force", code=code)
            self.assertNotRegex(self.done.stderr, r"\b(inf|nan)\b")
            if code == 3:
                self.assertIn("scene.toml:", self.done.stderr)
                self.assertRegex(self.done.stderr, "is too large|is larger than any force: is its unit right")

    def test_two_bodies_of_one_name(self):
        for more in (ball(5, "plate"), shell("plate", "above.ply"), solid("cube.vtk", "plate")):
            self.named(RUN + shell() + more, "two bodies named \"plate\"")

    def test_a_surface_with_holes_is_not_filled(self):
        for body in ("[[solid]]\nname = \"s\"\nfill = \"open.ply\"\nsize = \"1mm\"\nyoung = \"1kPa\"\npoisson = 0.3\n",
                     shell() + "[[rigid]]\nname = \"s\"\nmesh = \"open.ply\"\n"):
            self.named(RUN + body, "open.ply: 3 edges have a triangle on one side only", "it must be closed", place="open.ply")


if __name__ == "__main__":
    unittest.main()
