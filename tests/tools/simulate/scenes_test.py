"""Scenes from end to end against answers on paper: lengths in mm, forces in N."""
import math
import unittest

import h5py
import numpy as np

from support import SimulateTest, grid, sphere, write_ply


def shell(mesh, thickness, young, poisson, more=""):
    return (f"[[shell]]\nname = \"s\"\nmesh = \"{mesh}\"\nthickness = \"{thickness}mm\"\nyoung = \"{young}MPa\"\n"
            f"poisson = {poisson}\n{more}\n")


def fix(where, translation="xyz", rotation="xyz", more=""):
    return (f"[[fix]]\nbody = \"s\"\nwhere = {{{where}}}\ntranslation = \"{translation}\"\nrotation = \"{rotation}\"\n"
            f"{more}\n")


def load(kind, value, where="", more=""):
    where = f"where = {{{where}}}\n" if where else ""
    return f"[[load]]\nbody = \"s\"\nkind = \"{kind}\"\nvalue = {value}\n{where}{more}\n"


def probe(name, x, y, z):
    return f"[[probe]]\nname = \"{name}\"\nbody = \"s\"\nnearest = [\"{x}mm\", \"{y}mm\", \"{z}mm\"]\n"


STATIC = "[run]\nkind = \"static\"\n"
LINEAR = "[run]\nkind = \"static\"\ngeometry = \"linear\"\n"


class Scenes(SimulateTest):
    def last(self, result, name):
        return np.array(result["probes"][name]["displacement_mm"][-1])

    def test_clamped_plate_under_pressure(self):
        """w D / (q a^4) = 0.00126532 (Timoshenko); the same by pressure and by a load per area."""
        a, t, young, q = 100, 1, 2e5, 1e-3
        stiffness = young * t**3 / (12 * (1 - 0.3**2))
        errors = []
        for n in (8, 16):
            write_ply(self.path("plate.ply"), *grid(n, n, a, a))
            for how in (load("pressure", f"\"{q}MPa\""), load("area", f"[\"0Pa\", \"0Pa\", \"{q}MPa\"]")):
                result = self.simulate(LINEAR + shell("plate.ply", t, young, 0.3) + fix("boundary = true") + how +
                                       probe("middle", a / 2, a / 2, 0))
                w = self.last(result, "middle")[2]
                errors.append(abs(w * stiffness / (q * a**4) / 0.00126532 - 1))
        self.assertLess(max(errors[:2]), 0.04)
        self.assertLess(max(errors[2:]), 0.01)
        self.assertLess(errors[2], errors[0] / 2)

    def test_what_a_scene_says_wrong_is_told_with_its_place(self):
        write_ply(self.path("plate.ply"), *grid(4, 4, 10, 10))
        body = shell("plate.ply", 0.1, 1, 0.3)
        held = fix("below = {axis = \"x\", at = \"0mm\"}")
        pulled = load("force", "[\"0N\", \"0N\", \"1mN\"]", "nodes = [0]")
        path = STATIC + "control = \"arc-length\"\n"

        def place(text, item, number=1):
            lines = text.splitlines()
            return [i + 1 for i, line in enumerate(lines) if line == item][number - 1]

        moved = fix("nodes = [0]", more="displacement = [\"0mm\", \"0mm\", \"1mm\"]")
        free, twice, lifted = STATIC + body + pulled, STATIC + body + held + moved, STATIC + body + held + pulled
        for scene, where, says in (
                (free, f"{place(free, '[[shell]]')}:1: ", "can move freely"),
                (twice, f"{place(twice, '[[fix]]', 2)}:1: ", f"scene.toml:{place(twice, '[[fix]]')}:1) and 1 mm along z"),
                (path + body + held, "3:11: ", "arc length needs a load")):
            self.simulate(scene, code=3)
            self.assertTrue(self.done.stderr.startswith(f"tunica-simulate: scene.toml:{where}"), self.done.stderr)
            self.assertIn(says, self.done.stderr)
        self.write("scene.toml", lifted)
        report = self.run_tool("--scene", "scene.toml", "out.hdf")
        self.assertEqual(report["warnings"], [f"scene.toml:{place(lifted, '[[load]]')}:1: s: this force acts on held "
                                              "nodes only, so it moves nothing"])
        ramped = STATIC + body + held + load("area", "[\"0Pa\", \"0Pa\", \"1Pa\"]", more="ramp = [[0, 0], [1, 0]]")
        self.write("scene.toml", ramped)
        report = self.run_tool("--scene", "scene.toml", "out.hdf", "--force")
        self.assertIn("ramp of this load is zero", report["warnings"][0])

    def test_normals_that_are_no_numbers_are_told_with_file_and_node(self):
        vertices, triangles, normals = sphere(0, 10)
        normals[7] = [math.nan, 0, 1]
        write_ply(self.path("ball.ply"), vertices, triangles, normals)
        self.simulate(STATIC + shell("ball.ply", 0.1, 1, 0.3) + fix("all = true"), code=3)
        self.assertIn("scene.toml:5:8: ", self.done.stderr)
        self.assertIn("ball.ply: the normal of vertex 7 has components that are no numbers", self.done.stderr)

    def test_simply_supported_plate(self):
        """w D / (q a^4) = 0.00406235: a fix that leaves the rotations free."""
        a, t, young, q = 100, 1, 2e5, 1e-3
        write_ply(self.path("plate.ply"), *grid(16, 16, a, a))
        result = self.simulate(LINEAR + shell("plate.ply", t, young, 0.3) + fix("boundary = true", "xyz", "") +
                               load("pressure", f"\"{q}MPa\"") + probe("middle", a / 2, a / 2, 0))
        stiffness = young * t**3 / (12 * (1 - 0.3**2))
        self.assertAlmostEqual(self.last(result, "middle")[2] * stiffness / (q * a**4) / 0.00406235, 1, delta=0.01)

    def test_linear_cantilever_by_force_edge_load_and_gravity(self):
        """P L^3 / 3EI and g L^4 / 8EI: force, load per edge and the same force as weight."""
        length, width, t, young = 100, 10, 1, 2e5
        inertia = width * t**3 / 12
        write_ply(self.path("strip.ply"), *grid(40, 4, length, width))
        body = shell("strip.ply", t, young, 0, "density = \"1g/cm3\"")
        held = fix("below = {axis = \"x\", at = \"0mm\"}")
        tip = probe("tip", length, width / 2, 0)
        end = f"above = {{axis = \"x\", at = \"{length}mm\"}}"
        exact = 1 * length**3 / (3 * young * inertia)
        by_force = self.simulate(LINEAR + body + held + load("force", "[\"0N\", \"0N\", \"-1N\"]", end) + tip)
        self.assertAlmostEqual(self.last(by_force, "tip")[2] / -exact, 1, delta=0.005)
        self.assertAlmostEqual(by_force["probes"]["tip"]["rotation_rad"][-1][1] / (1.5 * exact / length), 1, delta=0.005)
        by_edge = self.simulate(LINEAR + body + held +
                                load("edge", f"[\"0N/mm\", \"0N/mm\", \"{-1 / width}N/mm\"]", end) + tip)
        self.assertAlmostEqual(self.last(by_edge, "tip")[2] / -exact, 1, delta=0.005)
        weight_per_length = 1e-9 * 9810 * t * width
        sag = weight_per_length * length**4 / (8 * young * inertia)
        by_weight = self.simulate(LINEAR + body + held + load("gravity", "[\"0m/s2\", \"0m/s2\", \"-9.81m/s2\"]") + tip)
        self.assertAlmostEqual(self.last(by_weight, "tip")[2] / -sag, 1, delta=0.005)
        # What the edge load carries: its work is twice the energy stored.
        self.assertAlmostEqual(by_force["strain_energy_mj"] / (exact / 2), 1, delta=0.01)

    def test_cantilever_far_beyond_small_displacements(self):
        """Sze, Liu, Lo 2004: end shear 4 on L 10, b 1, h 0.1, E 1.2e6: -u 3.286, w 6.698; at half the load 1.604, 4.933."""
        write_ply(self.path("strip.ply"), *grid(16, 1, 10, 1))
        result = self.simulate("[run]\nkind = \"static\"\nload_steps = 10\n" + shell("strip.ply", 0.1, 1.2e6, 0) +
                               fix("below = {axis = \"x\", at = \"0mm\"}") +
                               load("force", "[\"0N\", \"0N\", \"4N\"]", "above = {axis = \"x\", at = \"10mm\"}") +
                               probe("tip", 10, 0, 0))
        path = np.array(result["probes"]["tip"]["displacement_mm"])
        np.testing.assert_allclose(path[10, [0, 2]], [-3.286, 6.698], rtol=0.01)
        np.testing.assert_allclose(path[5, [0, 2]], [-1.604, 4.933], rtol=0.01)

    def test_strip_bent_by_a_moment_into_a_half_circle(self):
        """M = pi E I / L bends a strip into a half circle: the tip is at (0, 2 L / pi), turned by pi."""
        length, young, inertia = 12, 1.2e6, 0.1**3 / 12
        moment = 0.5 * math.pi * young * inertia / length
        write_ply(self.path("strip.ply"), *grid(16, 1, length, 1))
        result = self.simulate(STATIC + shell("strip.ply", 0.1, young, 0) + fix("below = {axis = \"x\", at = \"0mm\"}") +
                               load("moment", f"[\"0N*mm\", \"{-moment}N*mm\", \"0N*mm\"]",
                                    f"above = {{axis = \"x\", at = \"{length}mm\"}}") + probe("tip", length, 0, 0))
        # A quarter circle of radius 2 L / pi.
        radius = 2 * length / math.pi
        np.testing.assert_allclose(self.last(result, "tip"), [radius - length, 0, radius], atol=0.01 * length)
        self.assertAlmostEqual(result["probes"]["tip"]["rotation_rad"][-1][1], -math.pi / 2, delta=0.01)
        # Bent up, towards its normal: the top is shortened and the bottom lengthened by t / 2 times the curvature.
        curvature = math.pi / (2 * length)
        with h5py.File(self.path("out.hdf")) as file:
            elements = {name: values[-1] for name, values in file["tunica/elements"].items()}
        top, bottom = elements["principal_strain_top"], elements["principal_strain_bottom"]
        np.testing.assert_allclose(top.mean(axis=0), [0, -0.05 * curvature], atol=0.02 * 0.05 * curvature)
        np.testing.assert_allclose(bottom.mean(axis=0), [0.05 * curvature, 0], atol=0.02 * 0.05 * curvature)
        trace = elements["bending_moment"][:, :2].sum(axis=1)  # whatever each shell's own axes
        np.testing.assert_allclose(trace.mean(), -moment, rtol=0.02)
        np.testing.assert_allclose(elements["von_mises_top"].mean(), 0.05 * curvature * young, rtol=0.02)

    def test_a_tapered_strip_stretches_and_bends_by_its_formulas(self):
        """Thickness from the mesh, a to b linearly along the strip. Stretched by d: energy E w (a - b) d^2 / (2 L ln(a/b)).
        A force at the thin end: w = 12 P / (E w s^3) [ln t + 2 b/t - b^2 / 2 t^2] between b and a, s = (a - b) / L."""
        length, width, young, thick, thin = 100, 10, 2e5, 2.0, 0.5
        slope = (thick - thin) / length
        energy = young * width * slope * 0.01**2 / (2 * math.log(thick / thin))

        def primitive(t):
            return math.log(t) + 2 * thin / t - thin**2 / (2 * t**2)

        bend = 12 / (young * width * slope**3) * (primitive(thick) - primitive(thin))
        held, end = fix("below = {axis = \"x\", at = \"0mm\"}"), f"above = {{axis = \"x\", at = \"{length}mm\"}}"
        pull = fix(end, "xyz", "xyz", "displacement = [\"0.01mm\", \"0mm\", \"0mm\"]")
        push = load("edge", f"[\"0N/mm\", \"0N/mm\", \"{1 / width}N/mm\"]", end)
        errors = []
        for columns in (10, 20, 40):
            vertices, triangles = grid(columns, 2, length, width)
            write_ply(self.path("strip.ply"), vertices, triangles, wall=thick - slope * vertices[:, 0])
            body = shell("strip.ply", 1, young, 0).replace("thickness = \"1mm\"", "thickness_from = \"wall\"")
            stretched = self.simulate(LINEAR + body + held + pull)["strain_energy_mj"]
            bent = self.last(self.simulate(LINEAR + body + held + push + probe("tip", length, width / 2, 0)), "tip")[2]
            errors.append([abs(stretched / energy - 1), abs(bent / bend - 1)])
        self.assertLess(max(errors[-1]), 0.002)
        for coarse, fine in zip(errors, errors[1:]):
            self.assertLess(fine[0], coarse[0] / 3)  # of second order
            self.assertLess(fine[1], coarse[1] / 2)
        with h5py.File(self.path("out.hdf")) as file:
            drawn, walls = file["VTKHDF/Points"][:, 0], file["VTKHDF/PointData/thickness"][()]
            np.testing.assert_allclose(walls, thick - slope * drawn, rtol=1e-6)
            self.assertIn("thickness_from = \"wall\"", file["tunica/scene"][()].decode())

    def test_one_thickness_at_every_vertex_is_that_thickness(self):
        vertices, triangles, normals = sphere(1, 10)
        write_ply(self.path("ball.ply"), vertices, triangles, normals, thickness=np.full(len(vertices), 0.5))
        body = shell("ball.ply", 0.5, 1, 0.3)
        rest = fix("rigid_motions = true", "", "").replace("translation = \"\"\nrotation = \"\"\n", "")
        rest += load("pressure", "\"1kPa\"")
        one = self.simulate(STATIC + body + rest)["max_displacement_mm"]
        each = self.simulate(STATIC + body.replace("thickness = \"0.5mm\"", "thickness_from = \"thickness\"") + rest)
        self.assertAlmostEqual(each["max_displacement_mm"] / one, 1, delta=1e-9)

    def test_a_prescribed_displacement_stretches_by_hookes_law(self):
        """A strip stretched by 0.1 %: stress E e, energy E e^2 / 2 per volume."""
        write_ply(self.path("strip.ply"), *grid(8, 2, 40, 10))
        result = self.simulate(STATIC + shell("strip.ply", 1, 1000, 0) +
                               fix("below = {axis = \"x\", at = \"0mm\"}", "x", "yz") +
                               fix("above = {axis = \"x\", at = \"40mm\"}", "x", "yz",
                                   "displacement = [\"0.04mm\", \"0mm\", \"0mm\"]") +
                               fix("nodes = [0]", "yz", "x") + probe("middle", 20, 5, 0))
        np.testing.assert_allclose(self.last(result, "middle"), [0.02, 0, 0], atol=1e-5)
        self.assertAlmostEqual(result["strain_energy_mj"] / (1000 * 0.001**2 / 2 * 400), 1, delta=2e-3)

    def test_sphere_under_its_own_pressure(self):
        """w = p R^2 (1 - nu) / 2 E t, converging with the mesh, whatever the sign."""
        radius, t, young, poisson = 10, 0.1, 1, 0.3
        for p in (1e-8, -1e-8):
            w = p * radius**2 * (1 - poisson) / (2 * young * t)
            errors = []
            for splits in (1, 2, 3):
                vertices, triangles, normals = sphere(splits, radius)
                write_ply(self.path("ball.ply"), vertices, triangles, normals)
                result = self.simulate("[run]\nkind = \"static\"\nload_steps = 1\n" +
                                       shell("ball.ply", t, young, poisson) +
                                       "[[fix]]\nbody = \"s\"\nwhere = {rigid_motions = true}\n" +
                                       load("pressure", f"\"{p}MPa\""))
                with h5py.File(self.path("out.hdf")) as file:
                    outward = (file["tunica/nodes/displacement"][-1] * normals).sum(axis=1)
                errors.append(abs(outward.mean() / w - 1))
                volume = result["volume_after_mm3"] - result["volume_before_mm3"]
                self.assertAlmostEqual(volume / (4 * math.pi * radius**2 * w), 1, delta=0.4 / 4**splits)
            self.assertLess(errors[0], 0.01)
            self.assertLess(errors[1], 0.003)
            self.assertLess(errors[2], 0.0003)

    def test_long_damped_motion_ends_in_the_static_answer(self):
        write_ply(self.path("plate.ply"), *grid(6, 6, 20, 20))
        rest = (shell("plate.ply", 0.5, 1, 0.45, "density = \"1100kg/m3\"") + fix("boundary = true") +
                load("pressure", "\"1kPa\"", more="{ramp}") + probe("middle", 10, 10, 0))
        static = self.last(self.simulate(STATIC + rest.replace("{ramp}", "")), "middle")
        moving = self.simulate("[run]\nkind = \"dynamic\"\nduration = \"2s\"\nstep = \"20ms\"\nevery = 10\n"
                               "damping = {mass = \"20/s\"}\n" +
                               rest.replace("{ramp}", "ramp = [[\"0s\", 0.0], [\"0.5s\", 1.0]]"))
        np.testing.assert_allclose(self.last(moving, "middle"), static, rtol=1e-4, atol=1e-9)
        self.assertGreater(static[2], 0.1)
        times = moving["probes"]["middle"]["time_s"]
        np.testing.assert_allclose(times, 0.2 * np.arange(11), atol=1e-9)

    def test_units_are_only_a_way_of_writing(self):
        vertices, triangles = grid(6, 4, 30, 20)
        lines = [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
        for name, size in (("mm", 1), ("m", 1000), ("um", 1e-3)):
            points = [f"v {x / size!r} {y / size!r} {z / size!r}" for x, y, z in vertices.tolist()]
            self.write(f"{name}.obj", "\n".join(points + lines) + "\n")
        answers = []
        for mesh, unit, t, young, p in (("mm", "mm", "1mm", "2MPa", "1mmHg"), ("m", "m", "0.001m", "2000kPa", "133.322387415Pa"),
                                        ("um", "um", "1000um", "2e-3GPa", "1.33322387415e-3bar")):
            scene = (STATIC + f"[[shell]]\nname = \"s\"\nmesh = \"{mesh}.obj\"\nunit = \"{unit}\"\nthickness = \"{t}\"\n"
                     f"young = \"{young}\"\npoisson = 0.3\n" + fix("boundary = true") + load("pressure", f"\"{p}\""))
            answers.append(self.simulate(scene)["max_displacement_mm"])
        self.assertGreater(answers[0], 1e-3)
        np.testing.assert_allclose(answers, answers[0], rtol=1e-9)

    def test_two_bodies_in_one_scene(self):
        vertices, triangles, normals = sphere(1, 5)
        write_ply(self.path("a.ply"), vertices, triangles, normals)
        write_ply(self.path("b.ply"), vertices + [20, 0, 0], triangles, normals)
        scene = STATIC
        for name, value in (("a", "1Pa"), ("b", "3Pa")):
            scene += shell(f"{name}.ply", 0.5, 1, 0.3).replace('"s"', f'"{name}"')
            scene += f"[[fix]]\nbody = \"{name}\"\nwhere = {{rigid_motions = true}}\n"
            scene += load("pressure", f"\"{value}\"").replace('"s"', f'"{name}"')
            scene += probe(name, 5 if name == "a" else 25, 0, 0).replace('"s"', f'"{name}"')
        result = self.simulate(scene)
        self.assertEqual((result["shells"], result["nodes"]), (160, 84))
        a, b = (np.linalg.norm(self.last(result, name)) for name in "ab")
        self.assertAlmostEqual(b / a, 3, delta=1e-3)
        self.simulate(scene.replace("\"3Pa\"", "\"100kPa\""), code=4)


if __name__ == "__main__":
    unittest.main()
