#!/usr/bin/python3
"""The scenes of docs/scenes.md: every one is understood, the membrane's runs on a coarse mesh, and the angioplasty takes
another vessel."""

import json
import re
import struct
import subprocess
import tempfile
import unittest
import zlib
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


class Pictures(unittest.TestCase):
    """draw.py draws any result, without what --export pvd leaves beside it."""

    WALL = 'thickness = "1mm"\nyoung = "1MPa"\npoisson = 0.45\ndensity = "1100kg/m3"\n'
    HELD = '[[fix]]\nbody = "disc"\nwhere = {boundary = true}\ntranslation = "xyz"\nrotation = ""\n'
    PRESSED = '[[load]]\nbody = "disc"\nkind = "pressure"\nvalue = "1kPa"\n'
    DISC = '[[shell]]\nname = "disc"\nmesh = "membrane.ply"\n' + WALL
    RING = '[[solid]]\nname = "ring"\nmesh = "deposit.vtk"\nunit = "mm"\nyoung = "60kPa"\npoisson = 0.3\n'
    RING_HELD = HELD.replace("disc", "ring").replace("{boundary = true}", '{above = {axis = "z", at = "0mm"}}')

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="tunica-test-")
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        with_meshes("membrane", folder.name, "4")
        with_meshes("angioplasty", folder.name)

    def drawn(self, text, *words):
        """Runs a scene and draws it. @return pixels, height x width x 3"""
        (self.folder / "any.toml").write_text(text, encoding="utf-8")
        run_tool("simulate", "--scene", "any.toml", "any.hdf", "--quiet", "--force", folder=self.folder)
        self.draw("any.hdf", *words)
        data = (self.folder / "any.png").read_bytes()
        width, height = struct.unpack(">II", data[16:24])
        start = data.index(b"IDAT")
        rows = zlib.decompress(data[start + 4:start + 4 + struct.unpack(">I", data[start - 4:start])[0]])
        return np.frombuffer(rows, np.uint8).reshape(height, 1 + 3 * width)[:, 1:].reshape(height, width, 3)

    def draw(self, result, *words, code=0):
        return run_script(self.folder, "draw.py", result, "any.png", *words, code=code)

    def test_of_every_kind(self):
        steps = '[run]\nkind = "static"\nload_steps = 2\n'
        ball = ('[[rigid]]\nname = "ball"\nshape = "sphere"\nradius = "0.2cm"\n'
                'centre = [["0s", ["0mm", "0mm", "9mm"]], ["0.1s", ["0mm", "0mm", "8mm"]]]\n')
        two = self.DISC.replace('"disc"', '"other"') + self.HELD.replace("disc", "other")
        scenes = {
            "static": (steps + self.DISC + self.HELD + self.PRESSED, "--at", "0", "0.5", "--cut", "y"),
            "dynamic": ('[run]\nkind = "dynamic"\nduration = "0.1s"\nstep = "20ms"\n' + self.DISC + two + self.HELD + self.PRESSED + ball,
                        "--at", "0.1", "--cut=-x=1"),
            "frequencies": ('[run]\nkind = "frequencies"\ncount = 2\n' + self.DISC + self.HELD,),
            "solids alone": (steps + self.RING + self.RING_HELD + '[[load]]\nbody = "ring"\nkind = "pressure"\nvalue = "10Pa"\n',
                             "--cut", "x"),
            "shells and solids": (steps + self.DISC + self.HELD + self.PRESSED + self.RING + self.RING_HELD,),
        }
        for kind, (text, *words) in scenes.items():
            with self.subTest(kind=kind):
                pixels = self.drawn(text, *words)
                self.assertEqual(pixels.shape[1] // 560, max(1, len([w for w in words[1:] if re.fullmatch("[0-9.]+", w)])))
                self.assertGreater(len(np.unique(pixels.reshape(-1, 3), axis=0)), 100)
                self.assertGreater(np.mean(np.any(pixels < 250, axis=2)), 0.05)

    def test_what_cannot_be_drawn_is_said(self):
        run_tool("simulate", "membrane.ply", "one.hdf", "--young", "1MPa", "--poisson", "0.45", "--thickness", "1mm", "--pressure",
                 "1kPa", "--fix", "boundary", "--static", folder=self.folder)
        self.assertIn("leaves nothing", self.draw("one.hdf", "--cut", "y=-100", code=1))
        self.assertIn("write it like", self.draw("one.hdf", "--cut", "w", code=2))
        self.assertIn("looks along", self.draw("one.hdf", "--view", "0", "0", "1", code=2))
        self.assertIn("absent.hdf", self.draw("absent.hdf", code=1))


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
