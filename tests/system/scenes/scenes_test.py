#!/usr/bin/python3
"""The scenes of docs/scenes.md: every one is understood, the membrane's runs on a coarse mesh, and the angioplasty takes
another vessel."""

import importlib
import json
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np
from running import SHARED, SOURCE, ToolTest, run_tool

SCENES = SOURCE / "examples" / "scenes"


def run_script(folder, name, *words, code=0):
    """@return what a script of the scenes said"""
    done = subprocess.run(["/usr/bin/python3", "-B", SCENES / name, *map(str, words)], cwd=folder, capture_output=True, text=True,
                          check=False)
    assert done.returncode == code, done.stderr
    return done.stderr


def with_meshes(name, folder, *fineness):
    """Puts the scene and its meshes into the folder."""
    run_script(folder, f"{name}/mesh.py", folder, *fineness)
    for scene in (SCENES / name).glob("*.toml"):
        (Path(folder) / scene.name).write_text(scene.read_text(encoding="utf-8"), encoding="utf-8")


class Scenes(unittest.TestCase):
    def test_every_scene_is_understood(self):
        names = sorted(path.parent.name for path in SCENES.glob("*/mesh.py"))
        self.assertEqual(names, ["angioplasty", "lens", "liver", "membrane"])
        for name in names:
            with tempfile.TemporaryDirectory(prefix="tunica-test-") as folder:
                with_meshes(name, folder)
                for scene in sorted(Path(folder).glob("*.toml")):
                    with self.subTest(scene=f"{name}/{scene.name}"):
                        run_tool("simulate", "--scene", scene, "--check", report=False)

    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory(prefix="tunica-test-") as folder:
            with_meshes("membrane", folder, "8")
            cls.membrane = run_tool("simulate", "--scene", "scene.toml", "out.hdf", "--quiet", folder=folder).report["result"]
        cls.contact = cls.membrane["contacts"]["tool-membrane"]

    def test_the_membrane_pushes_back(self):
        force = [f[2] for f in self.contact["force_n"]]  # on the tool, which is named first
        self.assertGreater(min(force[:-1]), 0)
        self.assertAlmostEqual(self.contact["load_factor"][force.index(max(force))], 0.5)
        self.assertAlmostEqual(max(force), 2.483, delta=0.02)  # of 1,176 shells
        self.assertLess(self.membrane["balance"]["force"], 1e-12)

    def test_nothing_is_left_when_the_tool_is_gone(self):
        self.assertLess(abs(self.contact["force_n"][-1][2]), 1e-12)
        self.assertLess(max(abs(x) for x in self.membrane["probes"]["centre"]["displacement_mm"][-1]), 1e-9)

    def test_no_state_has_bodies_inside_each_other(self):
        self.assertGreater(min(gap["lower"] for gap in self.contact["smallest_gap_mm"]), 0)


class Lumen(ToolTest):
    def test_the_radius_is_that_of_the_page(self):
        """A tube of radius 5 mm, 1 mm thick, held at its ends: in the middle it widens by p R^2 / (E t) where it is long."""
        with_meshes("angioplasty", self.folder)
        self.run_tool("simulate", "vessel.ply", "out.hdf", "--young", "1MPa", "--poisson", "0", "--thickness", "1mm", "--pressure",
                      "1kPa", "--fix", "boundary", "--static")
        sys.path.insert(0, str(SCENES))
        self.addCleanup(sys.path.remove, str(SCENES))
        run = importlib.import_module("run")
        factor, shells, solids = run.drawn_surfaces(self.folder / "out.page")[-1]
        self.assertEqual((factor, len(solids)), (1, 0))
        angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
        directions = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
        middle, outside = run.radii_about(shells, np.zeros(3), np.array([0.0, 0, 1]), [0, 40], directions)
        self.assertAlmostEqual(middle, 5 + 0.001 * 25 / 1, delta=0.002)
        self.assertEqual(outside, np.inf)


class OwnVessel(ToolTest):
    def own(self, *words, code=0):
        return run_script(self.folder, "angioplasty/own.py", ".", *words, code=code)

    def check(self):
        self.run_tool("simulate", "--scene", "scene.toml", "--check", report=False)

    def up_to(self, factor):
        """Runs the scene as far as this load factor. @return the report's result"""
        scene = self.folder / "scene.toml"
        text = scene.read_text(encoding="utf-8")
        some = [f for f in json.loads(re.search(r"load_factors = (.*)", text)[1]) if f <= factor]
        scene.write_text(re.sub("load_factors = .*", f"load_factors = {some}", text), encoding="utf-8")
        return self.run_tool("simulate", "--scene", "scene.toml", "out.hdf", "--quiet")["result"]

    def test_the_samples_meshes_make_a_scene(self):
        with_meshes("angioplasty", self.folder)
        place = ("from=0,0,-6", "to=0,0,6", "inflated=4.5")
        for words in (("vessel.ply", "deposit.vtk", "push=24", "friction=0.1"), ("vessel.ply", "pressure=80"),
                      ("vessel.ply", "hold=0,0,15,6", "hold=0,0,-15,6")):
            with self.subTest(words=words):
                self.own(*words, *place)
                self.check()

    def test_what_is_missing_or_unknown_is_named(self):
        self.assertIn("missing: to, inflated", self.own("vessel.ply", "from=0,0,0", code=1))
        self.assertIn("unknown: inflate", self.own("vessel.ply", "from=0,0,0", "to=1,0,0", "inflated=1", "inflate=2", code=1))

    @unittest.skipUnless((SHARED / "paper").is_dir(), f"the shared meshes of the paper are absent ({SHARED})")
    def test_the_papers_vessel_and_deposits(self):
        paper = SHARED / "paper"
        run_script(self.folder, "angioplasty/paper.py", paper / "vesselScale.msh", paper / "stenosis2.xml", ".")
        self.own("vessel.ply", "deposits.vtk", "from=-8,0,0", "to=8,0,0", "inflated=0.7", "collapsed=0.15", "push=20", "wall=0.3")
        result = self.up_to(0.23)
        self.assertEqual((result["shells"], result["tetrahedra"]), (160, 2978))
        contact = result["contacts"]["balloon-deposit"]
        self.assertEqual(contact["area_mm2"][1], 0)  # pushed in, not yet inflated
        self.assertGreater(contact["area_mm2"][-1], 0.1)
        self.assertLess(result["balance"]["force"], 1e-9)

    @unittest.skipUnless((SHARED / "meshes").is_dir(), f"the shared meshes are absent ({SHARED})")
    def test_a_real_aneurysm(self):
        surface = SHARED / "meshes" / "sofa_aneurysm3D_1.obj"
        unit = ("--mesh-unit", "mm", "--quiet")
        self.run_tool("decimate", surface, "coarse.ply", "--triangles", 900, "--min-angle", 20, *unit)
        self.run_tool("relax", "coarse.ply", surface, "vessel.ply", "--refine", "--tolerance", "1%", *unit)
        self.own("vessel.ply", "from=-11.5,1.8,-5.8", "to=-8.6,2.55,-3.7", "inflated=1.6", "collapsed=0.6", "wall=0.3",
                 "hold=-19.6,-17.3,-13.3,2.6", "hold=-3.1,-6.05,5.6,2.2", "hold=4.9,-5.3,-12.9,1.3")
        self.check()


if __name__ == "__main__":
    unittest.main()
