#!/usr/bin/python3
"""mesh.py FOLDER [RINGS]: FOLDER/membrane.ply, a flat disc of radius 20 mm in 6 RINGS^2 shells (RINGS 14: 1,176)."""
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
import meshes

rings = int(sys.argv[2]) if len(sys.argv) > 2 else 14
points, triangles = meshes.disc(rings)
vertices = np.column_stack([20 * points, np.zeros(len(points))])
meshes.write_shell(Path(sys.argv[1]) / "membrane.ply", vertices, triangles, np.tile([0, 0, 1], (len(points), 1)))
