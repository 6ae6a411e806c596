#!/usr/bin/python3
"""The scenes of docs/scenes.md: every one is understood, and the membrane's runs on a coarse mesh."""

import json
import os
import subprocess
import tempfile
import unittest
from pathlib import Path

SCENES = Path(os.environ["TUNICA_SOURCE"]) / "examples" / "scenes"
SIMULATE = Path(os.environ["TUNICA_BIN"]) / "tunica-simulate"


def with_meshes(name, folder, *fineness):
    """Puts the scene and its meshes into the folder."""
    subprocess.run(["/usr/bin/python3", "-B", SCENES / name / "mesh.py", folder, *fineness], check=True)
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
                        run = subprocess.run([SIMULATE, "--scene", scene, "--check"], capture_output=True, text=True, check=False)
                        self.assertEqual(run.returncode, 0, run.stderr)

    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory(prefix="tunica-test-") as folder:
            with_meshes("membrane", folder, "8")
            run = subprocess.run([SIMULATE, "--scene", "scene.toml", "out.hdf", "--report", "report.json", "--quiet"], cwd=folder,
                                 capture_output=True, text=True, check=False)
            if run.returncode != 0:
                raise AssertionError(run.stderr)
            cls.membrane = json.loads((Path(folder) / "report.json").read_text(encoding="utf-8"))["result"]
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


if __name__ == "__main__":
    unittest.main()
