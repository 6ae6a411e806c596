"""Meshes of known shells, and how the tests run tunica-simulate."""
import json
import os
import shutil
import subprocess
import tempfile
import unittest

import numpy as np

SIMULATE = os.path.join(os.environ["TUNICA_BIN"], "tunica-simulate")


def write_ply(path, vertices, triangles, normals=None, **properties):
    """`properties`: further numbers per vertex."""
    vertices = np.asarray(vertices, float)
    header = ["ply", "format binary_little_endian 1.0", "comment units mm", f"element vertex {len(vertices)}"]
    header += [f"property double {name}" for name in ("x", "y", "z")]
    if normals is not None:
        header += [f"property double {name}" for name in ("nx", "ny", "nz")]
        vertices = np.hstack([vertices, normals])
    for name, values in properties.items():
        header.append(f"property double {name}")
        vertices = np.column_stack([vertices, values])
    header += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header\n"]
    faces = np.zeros(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"] = 3
    faces["corners"] = triangles
    with open(path, "wb") as file:
        file.write("\n".join(header).encode() + np.ascontiguousarray(vertices, "<f8").tobytes() + faces.tobytes())


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


def sphere(splits, radius):
    """A geodesic sphere: 20 x 4^splits triangles and their unit normals."""
    p = (1 + 5**0.5) / 2
    corners = [(-1, p, 0), (1, p, 0), (-1, -p, 0), (1, -p, 0), (0, -1, p), (0, 1, p),
               (0, -1, -p), (0, 1, -p), (p, 0, -1), (p, 0, 1), (-p, 0, -1), (-p, 0, 1)]
    triangles = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
                 (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5),
                 (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    normals = [np.array(c) / np.linalg.norm(c) for c in corners]
    for _ in range(splits):
        middle_of, finer = {}, []

        def middle(a, b):
            key = (min(a, b), max(a, b))
            if key not in middle_of:
                between = normals[a] + normals[b]
                normals.append(between / np.linalg.norm(between))
                middle_of[key] = len(normals) - 1
            return middle_of[key]

        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        triangles = finer
    normals = np.array(normals)
    return radius * normals, np.array(triangles), normals


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
