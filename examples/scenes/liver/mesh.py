#!/usr/bin/python3
"""mesh.py FOLDER [SPLITS]: FOLDER/capsule.ply, an ellipsoid of 8 x 4^SPLITS curved shells (SPLITS 3: 512), half axes 60, 45
and 25 mm. Tetrahedra fill the same file (scene.toml)."""
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
import meshes

half_axes = np.array([60.0, 45.0, 25.0])
unit, triangles = meshes.ball(int(sys.argv[2]) if len(sys.argv) > 2 else 3)
normals = unit / half_axes
normals /= np.linalg.norm(normals, axis=1)[:, None]
meshes.write_shell(Path(sys.argv[1]) / "capsule.ply", half_axes * unit, triangles, normals)
