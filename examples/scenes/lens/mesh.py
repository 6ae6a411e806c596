#!/usr/bin/python3
"""mesh.py FOLDER [RINGS]: FOLDER/lens.ply, the mid-surface of an intraocular lens in the plane z = 0: an optic of radius 3 mm
in 6 RINGS^2 shells (RINGS 10: 600), 0.2 mm thick in the middle and 0.1 mm at its rim (property `wall`), and two flat
haptics, 1.5 mm wide, 0.1 mm thick, that reach 6 mm along y."""
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
import meshes

RADIUS, REACH = 3.0, 6.0
rings = int(sys.argv[2]) if len(sys.argv) > 2 else 10
points, triangles = meshes.disc(rings)
points = RADIUS * np.column_stack([-points[:, 1], points[:, 0]])  # a turn by 90 degrees: nodes along x = 0
triangles = triangles.tolist()
wall = 0.2 - 0.1 * (points**2).sum(axis=1) / RADIUS**2
points = points.tolist()
width = round(rings * 6 / 12 / 2)  # of a haptic, in edges of the rim to either side
rim = len(points) - 6 * rings
for side in (0, 3 * rings):
    row = [rim + (side + k) % (6 * rings) for k in range(-width, width + 1)]
    rows = round(rings * 0.8)
    roots = [points[i] for i in row]
    for j in range(1, rows + 1):
        first = len(points)
        for x, y in roots:
            points.append([x, y + (np.sign(y) * REACH - y) * j / rows])
        above = list(range(first, first + len(row)))
        for k in range(len(row) - 1):
            triangles += [[row[k], above[k], above[k + 1]], [row[k], above[k + 1], row[k + 1]]]
        row = above
points, triangles = np.array(points), np.array(triangles)
sides = points[triangles[:, 1:]] - points[triangles[:, :1]]
turned = np.linalg.det(sides) < 0
triangles[turned] = triangles[turned][:, [0, 2, 1]]
wall = np.append(wall, np.full(len(points) - len(wall), 0.1))
meshes.write_shell(Path(sys.argv[1]) / "lens.ply", np.column_stack([points, 0 * wall]), triangles,
                   np.tile([0, 0, 1], (len(points), 1)), wall=wall)
