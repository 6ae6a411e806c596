#!/usr/bin/python3
"""mesh.py FOLDER [AROUND]: FOLDER/vessel.ply, a tube of radius 5 mm and length 30 mm about z, and FOLDER/deposit.vtk, a ring
of tetrahedra on its inner face, 12 mm long, up to 1.5 mm thick, thin at both ends. AROUND (default 18) counts shells around."""
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
import meshes

LENGTH, RADIUS, WALL = 30.0, 5.0, 1.0
RING, THICKEST, THINNEST = 12.0, 1.5, 0.5


def deposit(around, along, deep):
    """Cells of a ring, each cut into six tetrahedra about a diagonal; the same cut everywhere, so that faces meet."""
    points = []
    for k in range(along + 1):
        z = RING * (k / along - 0.5)
        thick = THINNEST + (THICKEST - THINNEST) * np.cos(np.pi * z / RING) ** 2
        for j in range(deep + 1):
            r = RADIUS - WALL / 2 - thick * j / deep
            points += [(r * np.cos(a), r * np.sin(a), z) for a in 2 * np.pi * np.arange(around) / around]

    def number(i, j, k):
        return (k * (deep + 1) + j) * around + i % around

    ways = [(1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1)]  # round the diagonal from corner 0 to corner 7
    tetrahedra = []
    for k in range(along):
        for j in range(deep):
            for i in range(around):
                corners = [number(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1)) for c in range(8)]
                tetrahedra += [(corners[0], corners[a], corners[b], corners[7]) for a, b in ways]
    return points, tetrahedra


around = int(sys.argv[2]) if len(sys.argv) > 2 else 18
folder = Path(sys.argv[1])
points, triangles, normals = meshes.tube(around, round(0.9 * around), RADIUS, LENGTH)
meshes.write_shell(folder / "vessel.ply", points, triangles, normals)
meshes.write_tetrahedra(folder / "deposit.vtk", *deposit(around, 2 * around // 3, 2))
