"""Meshes of known shells, and how the tests run tunica-simulate."""
import json
import os
import shutil
import subprocess
import tempfile
import unittest

import numpy as np

from meshes import geodesic_sphere as sphere, write_ply_mm as write_ply

SIMULATE = os.path.join(os.environ["TUNICA_BIN"], "tunica-simulate")


def grid(columns, rows, length, width):
    """A flat rectangle from the origin, each cell cut in two; the diagonals alternate."""
    x, y = np.meshgrid(np.linspace(0, length, columns + 1), np.linspace(0, width, rows + 1))
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    triangles = []
    for j in range(rows):
        for i in range(columns):
            a = j * (columns + 1) + i
            b, c, d = a + 1, a + columns + 2, a + columns + 1
            triangles += [(a, b, c), (a, c, d)] if (i + j) % 2 == 0 else [(a, b, d), (b, c, d)]
    return vertices, np.array(triangles)


class SimulateTest(unittest.TestCase):
    """Each test has a folder of its own."""

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="tunica-simulate-")
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, text):
        with open(self.path(name), "w", encoding="utf-8") as file:
            file.write(text)
        return self.path(name)

    def run_tool(self, *arguments, expect=0, **options):
        """Runs the tool in the folder; returns its report (None where it wrote none)."""
        report = self.path("report.json")
        if os.path.exists(report):
            os.remove(report)
        command = [SIMULATE, *arguments]
        if "--check" not in arguments:
            command += ["--report", report]
        self.done = subprocess.run(command, cwd=self.folder, capture_output=True, text=True, timeout=300,
                                   check=False, **options)
        self.assertEqual(self.done.returncode, expect, self.done.stderr)
        if expect != 0:
            lines = self.done.stderr.strip().splitlines()
            self.assertTrue(lines[-1].startswith("tunica-simulate: "), lines)
        if not os.path.exists(report):
            return None
        with open(report, encoding="utf-8") as file:
            return json.load(file)

    def simulate(self, scene, expect=0):
        """Runs a scene given as text; returns the report's result."""
        self.write("scene.toml", scene)
        report = self.run_tool("--scene", "scene.toml", "out.hdf", "--force", "--quiet", expect=expect)
        return report["result"]
