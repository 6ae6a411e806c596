"""Meshes of known shells, and how the tests run tunica-simulate."""
import numpy as np

from meshes import geodesic_sphere as sphere, write_ply_mm as write_ply
from running import ToolTest


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


class SimulateTest(ToolTest):
    verb = "simulate"

    def run_tool(self, *words, **options):
        return super().run_tool(*words, **{"report": "--check" not in words, **options})

    def simulate(self, scene, code=0):
        """Runs a scene given as text; returns the report's result."""
        self.write("scene.toml", scene)
        return self.run_tool("--scene", "scene.toml", "out.hdf", "--force", "--quiet", code=code)["result"]
