#!/usr/bin/python3
"""`--imaged-at` with `--unloaded`: the shape that an organ has without the pressure under which it was imaged."""
import math
import unittest

import numpy as np
from meshes import Ply
from published import fix, grid, load, run_lines, shell
from running import run_tool
from support import SimulateTest, sphere, write_ply

YOUNG, POISSON = 1.0, 0.3  # MPa
WALL = ("--young", "1MPa", "--poisson", "0.3", "--static")


class Unloaded(SimulateTest):
    def imaged(self, mesh, pressure, *more, code=0):
        return self.run_tool(mesh, "out.hdf", *WALL, "--pressure", f"{pressure!r}MPa", "--imaged-at", f"{pressure!r}MPa",
                             "--unloaded", "unloaded.ply", "--force", *more, code=code)

    def test_a_sphere_shrinks_by_its_formula(self):
        """p R0 / (E t) = 2 / (1 - nu) e / (1 + e)^2, R = (1 + e) R0: a linear law in engineering strains. By a third, too."""
        radius, thickness = 10, 0.2
        for part, splits in ((0.02, 2), (0.25, 2), (0.25, 3)):
            with self.subTest(part):
                write_ply(self.path("image.ply"), *sphere(splits, radius))
                pressure = part * 2 * YOUNG * thickness / (radius * (1 - POISSON))
                report = self.imaged("image.ply", pressure, "--thickness", "0.2mm", "--fix", "rigid-motions")["result"]
                unloaded = (3 / (4 * math.pi) * report["unloaded"]["volume_mm3"])**(1 / 3)
                self.assertAlmostEqual(unloaded / (radius * (1 - part)), 1, delta=1e-3)
                self.assertAlmostEqual(report["volume_after_mm3"] / (4 / 3 * math.pi * radius**3), 1, delta=3e-3)
                self.assertLess(report["unloaded"]["distance_mm"]["mean"], 1e-3 * part * radius)
                for shape in ("image", "unloaded"):
                    self.assertGreater(report["unloaded"]["roundness"][shape], 0.98)

    def test_a_tube_shrinks_by_its_formula(self):
        """Plane strain: R / R0 - 1 = p R (1 - nu^2) / (E t). A quarter; nothing moves along the axis."""
        radius, thickness, strain = 10.0, 0.2, 0.1
        points, triangles, normals = grid(
            16, 2, lambda u, v: (radius * np.cos(math.pi / 2 * u), radius * np.sin(math.pi / 2 * u), 3 * v),
            lambda p, u, v: (p[:, 0], p[:, 1], 0 * u))
        write_ply(self.path("tube.ply"), points, triangles, normals)
        pressure = strain * YOUNG * thickness / (radius * (1 - POISSON**2))
        scene = (run_lines(kind="static") + shell("tube.ply", thickness, YOUNG, POISSON) +
                 fix(range(len(points)), "z", "xy") + fix(np.flatnonzero(points[:, 1] < 1e-9), "y", "xz") +
                 fix(np.flatnonzero(points[:, 0] < 1e-9), "x", "yz") +
                 load("pressure", f"{pressure!r}MPa", more=f'imaged_at = "{pressure!r}MPa"\n'))
        self.write("scene.toml", scene)
        self.run_tool("--scene", "scene.toml", "out.hdf", "--unloaded", "unloaded.ply")
        found = np.hypot(*Ply(self.path("unloaded.ply")).vertices.T[:2])
        np.testing.assert_allclose(found, radius / (1 + strain), rtol=1e-3)

    def test_a_loaded_shape_goes_back_to_where_it_came_from(self):
        """An ellipsoid, loaded, taken for the image: nodes and normals come back, and the volume under twice the pressure is that
        of the known shape under it."""
        points, triangles, normals = sphere(2, 1)
        axes = np.array([12.0, 9.0, 7.0])
        normals = normals / axes
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        write_ply(self.path("known.ply"), points * axes, triangles, normals)
        thin = ("--thickness", "0.5mm", "--fix", "rigid-motions")
        double = self.run_tool("known.ply", "out.hdf", *WALL, "--pressure", "8kPa", *thin, "--force")["result"]
        self.run_tool("known.ply", "known.hdf", *WALL, "--pressure", "4kPa", *thin)
        import h5py  # noqa: PLC0415: of this test alone
        with h5py.File(self.path("known.hdf")) as file:
            moved = file["VTKHDF/PointData"]["displacement"]
            self.assertGreater(np.abs(moved).max(), 0.1)
            nodes = file["tunica/nodes"]
            displacement, rotation = (nodes[key][-1] for key in ("displacement", "rotation"))
        angle = np.linalg.norm(rotation, axis=1, keepdims=True)
        axis = rotation / np.maximum(angle, 1e-300)
        turned = (normals * np.cos(angle) + np.cross(axis, normals) * np.sin(angle) +
                  axis * (axis * normals).sum(axis=1, keepdims=True) * (1 - np.cos(angle)))
        write_ply(self.path("image.ply"), points * axes + displacement, triangles, turned)
        report = self.run_tool("image.ply", "out.hdf", *WALL, "--pressure", "8kPa", "--imaged-at", "4kPa", *thin,
                               "--unloaded", "back.ply", "--force")["result"]
        back = Ply(self.path("back.ply"))
        largest = np.linalg.norm(displacement, axis=1).max()
        self.assertLess(np.linalg.norm(back.vertices - points * axes, axis=1).max(), 5e-3 * largest)
        self.assertLess(np.linalg.norm(back.normals() - normals, axis=1).max(), 5e-3)
        self.assertAlmostEqual(report["volume_after_mm3"] / double["volume_after_mm3"], 1, delta=1e-3)

    def test_a_ball_of_voxels_shrinks_by_the_formula(self):
        """From an image to the unloaded organ: the volume by the formula of the sphere whose voxels were imaged."""
        def tool(*words):
            return run_tool(*words, folder=self.folder).report["result"]

        tool("phantom", "sphere", "ball.nii.gz", "--size", "48", "--spacing", "0.5")
        imaged = tool("extract", "ball.nii.gz", "surface.ply", "--label", "1", "--smooth", "staircase")["volume_mm3"]
        tool("decimate", "surface.ply", "coarse.ply", "--triangles", "600")
        tool("relax", "coarse.ply", "surface.ply", "shell.ply")
        radius = (3 * imaged / (4 * math.pi))**(1 / 3)
        part, thickness = 0.1, 0.3
        pressure = part * 2 * YOUNG * thickness / (radius * (1 - POISSON))
        report = self.imaged("shell.ply", pressure, "--thickness", "0.3mm", "--fix", "rigid-motions")["result"]
        unloaded = (3 / (4 * math.pi) * report["unloaded"]["volume_mm3"])**(1 / 3)
        self.assertAlmostEqual(unloaded / (radius * (1 - part)), 1, delta=3e-3)
        self.assertAlmostEqual(report["volume_after_mm3"] / imaged, 1, delta=2e-3)

    def test_beyond_the_limit_load_there_is_none(self):
        write_ply(self.path("image.ply"), *sphere(1, 10))
        pressure = 0.6 * 2 * YOUNG * 0.2 / (10 * (1 - POISSON))  # a sphere has no more than .5
        self.imaged("image.ply", pressure, "--thickness", "0.2mm", "--fix", "rigid-motions", code=4)
        self.assertIn("no unloaded shape was found", self.done.stderr)
        self.assertIn("times the pressure imaged_at: ", self.done.stderr)
        self.assertIn("take more shells", self.done.stderr)
        self.assertNotIn("--accuracy", self.done.stderr, "it is refused with imaged_at")
        self.assertIn("was the wall as thick and as stiff", self.done.stderr)

    def test_loads_out_of_balance_are_no_fault_of_the_wall(self):
        """Half a sphere that only its rigid motions hold: nothing bears the pressure under which it was imaged."""
        points, triangles, normals = (np.array(part) for part in sphere(2, 10))
        upper = triangles[(points[triangles][:, :, 2] > -1e-9).all(axis=1)]
        used, upper = np.unique(upper, return_inverse=True)
        write_ply(self.path("image.ply"), points[used], upper.reshape(-1, 3), normals[used])
        self.run_tool("image.ply", "out.hdf", *WALL, "--pressure", "0MPa", "--imaged-at", "1kPa", "--thickness", "0.2mm", "--fix",
                      "rigid-motions", "--unloaded", "unloaded.ply", code=3, says="hold it by a")

    def test_an_oval_that_flattens_is_doubted(self):
        """An oval ball becomes flatter without its pressure: a section loses more than half of its roundness."""
        vertices, triangles, normals = sphere(3, 10)
        flat = np.array([1.6, 1.2, 0.45])
        normals = np.array(normals) / flat
        write_ply(self.path("image.ply"), vertices * flat, triangles, normals / np.linalg.norm(normals, axis=1)[:, None])
        wall = ("--thickness", "1mm", "--fix", "rigid-motions")
        for pressure, is_doubtful in ((5e-4, False), (1.04e-3, True)):
            report = self.imaged("image.ply", pressure, *wall)
            rounded = report["result"]["unloaded"]["roundness"]
            self.assertLess(rounded["unloaded"], rounded["image"])
            self.assertEqual(rounded["unloaded"] < 0.5 * rounded["image"], is_doubtful, rounded)
            self.assertEqual("unloaded shape is doubtful" in " ".join(report["warnings"]), is_doubtful)

    def test_unloading_needs_no_other_pressure(self):
        write_ply(self.path("image.ply"), *sphere(2, 10))
        pressure = 0.1 * 2 * YOUNG * 0.2 / (10 * (1 - POISSON))
        report = self.run_tool("image.ply", "out.hdf", *WALL, "--pressure", "0MPa", "--imaged-at", f"{pressure!r}MPa", "--thickness",
                               "0.2mm", "--fix", "rigid-motions", "--unloaded", "unloaded.ply")
        self.assertNotIn("nothing loads the model", " ".join(report["warnings"]))
        result = report["result"]
        self.assertAlmostEqual(result["volume_after_mm3"] / result["unloaded"]["volume_mm3"], 1, delta=1e-6)

    def test_a_wall_that_buckles_on_the_way_is_refused(self):
        """Under an outer pressure well above the classical one."""
        write_ply(self.path("image.ply"), *sphere(2, 10))
        classical = 2 * YOUNG / math.sqrt(3 * (1 - POISSON**2)) * (0.1 / 10)**2
        self.imaged("image.ply", -4 * classical, "--thickness", "0.1mm", "--fix", "rigid-motions", code=4)
        self.assertIn("no unloaded shape was found", self.done.stderr)

    def test_an_image_beyond_the_snap_is_refused(self):
        """A shallow dome, pressed nearly flat: a dome in balance there exists, but pressed so hard it would snap through."""
        side, rise, thickness = 20.0, 0.1, 0.1
        wave = rise * math.pi / side
        points, triangles, normals = grid(
            16, 16, lambda u, v: (side * u, side * v, rise * np.sin(math.pi * u) * np.sin(math.pi * v)),
            lambda p, u, v: (-wave * np.cos(math.pi * u) * np.sin(math.pi * v),
                             -wave * np.sin(math.pi * u) * np.cos(math.pi * v), 1 + 0 * u))
        write_ply(self.path("image.ply"), points, triangles, normals)
        stiffness = YOUNG * thickness**3 / (12 * (1 - POISSON**2))
        one_thickness = -thickness * stiffness / (0.00126 * side**4)  # deflects a clamped plate by so much (Timoshenko)
        held = ("--thickness", "0.1mm", "--fix", "boundary")
        unloaded = self.imaged("image.ply", 2 * one_thickness, *held)["result"]["unloaded"]
        self.assertLess(unloaded["distance_mm"]["max"], 1e-3 * thickness)
        self.imaged("image.ply", 6 * one_thickness, *held, code=4)
        self.assertIn("the pressure leads to another state of rest", self.done.stderr)

    def test_a_wall_that_folds_on_the_way_is_refused(self):
        """A cushion, far too full: without its pressure its rim would have to lie within itself."""
        vertices, triangles, normals = sphere(1, 10)
        flat = np.array([3, 1, 0.3])
        normals = np.array(normals) / flat
        write_ply(self.path("image.ply"), vertices * flat, triangles, normals / np.linalg.norm(normals, axis=1)[:, None])
        self.imaged("image.ply", 0.2, "--thickness", "0.5mm", "--fix", "rigid-motions", code=4)
        self.assertIn("on the way to it the wall folds near (", self.done.stderr)
        self.assertNotIn("tunica-relax", self.done.stderr.splitlines()[-1], "another mesh would fold as well")

    def test_wrong_usage_is_2(self):
        write_ply(self.path("image.ply"), *sphere(1, 10))
        held = ("--thickness", "0.2mm", "--fix", "rigid-motions", "--pressure", "1kPa")
        self.run_tool("image.ply", "out.hdf", *WALL, *held, "--unloaded", "u.ply", code=2,
                      says="--unloaded belongs to --imaged-at")
        self.run_tool("image.ply", "out.hdf", *WALL, *held, "--imaged-at", "5", code=2)
        self.run_tool("image.ply", "out.hdf", *WALL, *held, "--imaged-at", "1kPa", "--accuracy", "5%", "--target", "image.ply",
                      "--unloaded", "u.ply", code=2, says="an unloaded shape and an accuracy")
        self.write("scene.toml", run_lines(kind="static") + shell("image.ply", 0.2, YOUNG, POISSON) +
                   load("gravity", [0.0, 0.0, -1.0], "m/s2", more='imaged_at = "1kPa"\n'))
        self.run_tool("--scene", "scene.toml", "out.hdf", code=3, says="imaged_at belongs to a pressure")


if __name__ == "__main__":
    unittest.main()
