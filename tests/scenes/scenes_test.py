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

    def test_the_membrane_pushes_back_and_is_never_passed(self):
        with tempfile.TemporaryDirectory(prefix="tunica-test-") as folder:
            with_meshes("membrane", folder, "6")
            run = subprocess.run([SIMULATE, "--scene", "scene.toml", "out.hdf", "--report", "report.json", "--quiet", "--threads", "2"],
                                 cwd=folder, capture_output=True, text=True, check=False)
            self.assertEqual(run.returncode, 0, run.stderr)
            result = json.loads((Path(folder) / "report.json").read_text(encoding="utf-8"))["result"]
        contact = result["contacts"]["tool-membrane"]
        force = [f[2] for f in contact["force_n"]]  # on the tool, which is named first
        factors = contact["load_factor"]
        self.assertGreater(min(force[:-2]), 0)
        self.assertAlmostEqual(factors[force.index(max(force))], 0.5)
        # Half a newton per millimetre and more where the membrane is stretched; the finest mesh says 2.25 N.
        self.assertAlmostEqual(max(force), 2.25, delta=0.25)
        self.assertLess(abs(force[-1]), 1e-9 * max(force))
        self.assertGreater(min(gap["lower"] for gap in contact["smallest_gap_mm"]), 0)
        self.assertLess(result["balance"]["force"], 1e-12)
        self.assertLess(max(abs(x) for x in result["probes"]["centre"]["displacement_mm"][-1]), 1e-9)


if __name__ == "__main__":
    unittest.main()
