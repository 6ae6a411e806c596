"""The picture of a result: what it shows, what it refuses."""
import json
import os
import unittest

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOImage import vtkPNGReader

from contact_scenes import block, contact, lengths, write_vtk
from contact_scenes_more import held, solid
from support import SimulateTest, grid, sphere, write_ply

RADIUS = 10
BALL = ["ball.ply", "out.hdf", "--young", "1MPa", "--poisson", "0.3", "--thickness", "0.5mm", "--pressure", "1kPa",
        "--fix", "rigid-motions", "--static"]
STRESS = 1e-3 * RADIUS / (2 * 0.5)  # MPa, p R / 2 t
SAND, ORANGE, VIOLET = (243, 235, 219), (243, 122, 93), (88, 27, 110)  # of the colour bar: 0, half, all of the range
VIEW = slice(180, 760), slice(60, 1290)
GREY = (150, 163, 178)


class Picture(SimulateTest):
    def setUp(self):
        super().setUp()
        write_ply(self.path("ball.ply"), *sphere(2, RADIUS))

    def pixels(self, name="out.png"):
        reader = vtkPNGReader()
        reader.SetFileName(self.path(name))
        reader.Update()
        image = reader.GetOutput()
        width, height, _ = image.GetDimensions()
        return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, -1)[::-1].astype(float)

    def part_near(self, colour, within=12):
        """Part of the surface with the hue of a colour: light scales all three channels."""
        pixels = self.pixels()[VIEW].reshape(-1, 3)
        pixels = pixels[(pixels.min(axis=1) < 230) & (pixels.max(axis=1) > 60)]
        light = pixels @ np.array(colour) / np.dot(colour, colour)
        near = np.abs(pixels - light[:, None] * np.array(colour)).max(axis=1) < within
        return near.mean()

    def test_a_ball_has_the_colour_of_its_stress(self):
        report = self.run_tool(*BALL, "--picture", "out.png", "--picture-range", f"{2 * STRESS}MPa")
        self.assertEqual(self.pixels().shape, (900, 1600, 3))
        self.assertGreater(self.part_near(ORANGE, 25), 0.8)
        self.assertIn("out.png", json.dumps(report["outputs"]))
        self.run_tool(*BALL, "--picture", "out.png", "--picture-range", f"{0.5 * STRESS}MPa", "--force")
        self.assertGreater(self.part_near(VIOLET), 0.8)
        self.run_tool(*BALL, "--picture", "out.png", "--picture-range", "1GPa", "--force")
        self.assertGreater(self.part_near(SAND), 0.8)

    def test_displacement_and_strain_have_their_units(self):
        """u = p R^2 (1 - nu) / (2 E t), e = u / R."""
        strain = 0.7 * STRESS
        for colour, half in (("displacement", f"{2 * strain * RADIUS}mm"), ("strain", f"{200 * strain}%")):
            self.run_tool(*BALL, "--picture", "out.png", "--colour", colour, "--picture-range", half, "--force")
            self.assertGreater(self.part_near(ORANGE, 30), 0.8, colour)

    def test_same_bytes_with_any_number_of_threads(self):
        for threads in ("1", "2"):
            self.run_tool(*BALL, "--picture", f"{threads}.png", "--threads", threads, "--force")
        with open(self.path("1.png"), "rb") as one, open(self.path("2.png"), "rb") as two:
            self.assertEqual(one.read(), two.read())
        self.assertFalse([name for name in os.listdir(self.folder) if name.endswith(".part")])

    def test_magnified_displacements_are_drawn_larger(self):
        write_ply(self.path("strip.ply"), *grid(20, 2, 10, 1))
        arguments = ["strip.ply", "out.hdf", "--young", "100MPa", "--poisson", "0.3", "--thickness", "0.1mm",
                     "--pressure", "2Pa", "--fix", "below x=0mm", "--static", "--picture", "out.png", "--colour", "stress", "--force"]
        slopes = []
        # The first view: from above with the second one below it, from the side with the second one beside it.
        for factor, view in (("1", (slice(180, 450), slice(60, 1290))), ("20", (slice(180, 760), slice(60, 660)))):
            self.run_tool(*arguments, "--magnify", factor)
            pixels = self.pixels()[view].astype(int)
            rows, columns = np.where(pixels.max(axis=2) - pixels.min(axis=2) > 25)
            slopes.append(abs(np.polyfit(columns, rows, 1)[0]))
        self.assertGreater(slopes[1], 3 * slopes[0])

    def test_a_solid_on_a_rigid_ball(self):
        points, tetrahedra = block(2, np.array([10.0, 10.0, 5.0]), np.array([-5.0, -5.0, 0.01]))
        write_vtk(self.path("block.vtk"), points, tetrahedra)
        top = np.where(points[:, 2] > 5)[0]
        self.write("scene.toml", "[run]\nkind = \"static\"\n" + solid("b", "block.vtk", 1.0, 0.3) +
                   held("b", top, "xyz", (0, 0, -0.3)) + "[[rigid]]\nname = \"p\"\nshape = \"sphere\"\n"
                   f"centre = {lengths(0, 0, -6)}\nradius = \"6mm\"\n" + contact("b", "p"))
        for colour in ("stress", "displacement", "strain"):
            self.run_tool("--scene", "scene.toml", "out.hdf", "--picture", "out.png", "--colour", colour, "--force")
            self.assertGreater(self.part_near(GREY), 0.1, "no rigid ball")
            self.assertLess(self.part_near(GREY), 0.8, "no solid")

    def test_the_first_mode_has_a_shape(self):
        write_ply(self.path("plate.ply"), *grid(8, 8, 10, 10))
        self.write("scene.toml", "[run]\nkind = \"frequencies\"\ncount = 2\n[[shell]]\nname = \"s\"\nmesh = \"plate.ply\"\n"
                   "thickness = \"0.05mm\"\nyoung = \"1GPa\"\npoisson = 0.3\ndensity = \"1000kg/m3\"\n"
                   "[[fix]]\nbody = \"s\"\nwhere = {boundary = true}\ntranslation = \"xyz\"\nrotation = \"\"\n")
        self.run_tool("--scene", "scene.toml", "out.hdf", "--picture", "out.png", "--magnify", "10")
        # 1 % of the side in the middle, nothing at the rim: all colours of the bar.
        self.assertGreater(self.part_near(SAND), 0.02)
        self.assertGreater(self.part_near(VIOLET), 0.02)
        self.run_tool("--scene", "scene.toml", "out.hdf", "--picture", "out.png", "--picture-at", "1", "--magnify", "10", "--force")
        self.assertGreater(self.part_near(VIOLET), 0.02, "what the modes are of was drawn")
        self.run_tool("--scene", "scene.toml", "out.hdf", "--picture", "out.png", "--colour", "stress", "--force",
                      code=2, says="no stress")

    def test_moments_are_panels_of_the_nearest_states(self):
        run = [*BALL, "--load-steps", "4", "--picture", "out.png", "--force"]
        pictures = {}
        for at in ("0.5", "0.45", "1", "0.5 1"):
            self.run_tool(*run, "--picture-at", at)
            pictures[at] = self.pixels()
        self.assertTrue(np.array_equal(pictures["0.5"], pictures["0.45"]))
        self.assertFalse(np.array_equal(pictures["0.5"], pictures["1"]))
        left, right = pictures["0.5 1"][VIEW][:, :600], pictures["0.5 1"][VIEW][:, 700:]
        for half in (left, right):
            self.assertGreater(np.mean(half.min(axis=2) < 250), 0.2)
        self.assertLess(np.median(right[right.min(axis=2) < 230][:, 1]), np.median(left[left.min(axis=2) < 230][:, 1]) - 20,
                        "twice the stress is not darker")

    def test_moments_of_motions_and_modes(self):
        wall = ("[[shell]]\nname = \"s\"\nmesh = \"ball.ply\"\nthickness = \"0.5mm\"\nyoung = \"1MPa\"\npoisson = 0.3\n"
                "density = \"1100kg/m3\"\n[[fix]]\nbody = \"s\"\nwhere = {rigid_motions = true}\n")
        load = "[[load]]\nbody = \"s\"\nkind = \"pressure\"\nvalue = \"1kPa\"\n"
        for run, more, at in (("kind = \"dynamic\"\nduration = \"2ms\"\nstep = \"0.5ms\"\n", load, "0ms, 1ms, 2ms"),
                              ("kind = \"frequencies\"\ncount = 2\n", "", "1 2")):
            with self.subTest(run=run):
                self.write("scene.toml", "[run]\n" + run + wall + more)
                self.run_tool("--scene", "scene.toml", "out.hdf", "--picture", "out.png", "--picture-at", at, "--force")
                self.assertGreater(np.mean(self.pixels()[VIEW].min(axis=2) < 250), 0.1)

    def test_a_solid_cut_open_shows_its_inside(self):
        points, tetrahedra = block(3, np.array([10.0, 10.0, 10.0]), np.zeros(3))
        write_vtk(self.path("block.vtk"), points, tetrahedra)
        self.write("scene.toml", "[run]\nkind = \"static\"\n" + solid("b", "block.vtk", 1.0, 0.3) +
                   held("b", np.where(points[:, 2] == 0)[0], "xyz") + held("b", np.where(points[:, 2] == 10)[0], "xyz", (0, 0, -1)))
        covered = {}
        for words in ((), ("--picture-cut=-y",)):
            self.run_tool("--scene", "scene.toml", "out.hdf", "--picture", "out.png", "--picture-at", "1", *words, "--force")
            covered[words] = np.mean(self.pixels()[VIEW].min(axis=2) < 250)
        self.assertGreater(covered[("--picture-cut=-y",)], 0.5 * covered[()], "the section has no face")
        self.run_tool("--scene", "scene.toml", "out.hdf", "--picture", "out.png", "--picture-cut=-y=100mm", "--force")
        self.assertEqual(np.mean(self.pixels()[300:700, 300:1100].min(axis=2) < 250), 0, "something lies beyond the cut")

    def test_what_is_refused(self):
        def refused(message, *arguments, code=2):
            self.run_tool(*BALL, *arguments, code=code, says=message)
            self.assertFalse({"out.png", "out.hdf", "out.png.part"} & set(os.listdir(self.folder)))

        refused("did you mean 'stress'?", "--picture", "out.png", "--colour", "stres")
        refused("--colour belongs to --picture", "--colour", "strain")
        refused("--magnify belongs to --picture", "--magnify", "2")
        refused("--picture-range belongs to --picture", "--picture-range", "1kPa")
        refused("'0' is not a number above zero", "--picture", "out.png", "--magnify", "0")
        refused("--picture-range: ", "--picture", "out.png", "--picture-range", "3mm")
        refused("is not above zero", "--picture", "out.png", "--picture-range", "0kPa")
        refused("contradict each other: a picture needs a result", "--picture", "out.png", "--check")
        refused(".png", "--picture", "out.jpg")
        self.write("there.png", "")
        refused("exists", "--picture", "there.png", code=5)

    def test_moments_and_cuts_that_are_none_are_refused(self):
        for flag, value, said in (("at", "soon", "'soon' is not a number"), ("at", " ", "one to 24 moments"), ("at", "0,5 1", "'0,5' is not a number"), ("at", "1 " * 25, "not 25"),
                                  ("cut", "w", "is no axis with a place"), ("cut", "y=3", "unit"), ("cut", "yy", "is no axis")):
            with self.subTest(flag=flag, value=value):
                self.run_tool(*BALL, "--picture", "out.png", f"--picture-{flag}={value}", code=2, says=[f"--picture-{flag}: ", said])
        self.run_tool(*BALL, "--picture-at", "1", code=2, says="--picture-at belongs to --picture")

    def test_a_run_that_fails_leaves_no_picture(self):
        self.run_tool("ball.ply", "out.hdf", "--young", "1kPa", "--poisson", "0.3", "--thickness", "0.05mm",
                      "--pressure", "1MPa", "--fix", "rigid-motions", "--static", "--picture", "out.png", code=4)
        self.assertFalse({"out.png", "out.png.part"} & set(os.listdir(self.folder)))


if __name__ == "__main__":
    unittest.main()
