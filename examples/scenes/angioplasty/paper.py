#!/usr/bin/python3
"""paper.py VESSEL.msh DEPOSITS.xml FOLDER: the vessel and the deposits of the paper's Fig. 7 as FOLDER/vessel.ply and
FOLDER/deposits.vtk, in mm.

Source of both: the authors' plugin SofaDefrost/Shell, June 2010: vesselScale.msh, triangles in GiD's text format, and
stenosis2.xml, tetrahedra in SOFA's, a thousandth in size.
The vessel is a tube about x, so its normals are radial.
"""
import re
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
import meshes


def read_gid(path):
    """@return points, triangles"""
    coordinates, elements = re.search(r"Coordinates\n(.*?)end coordinates.*?Elements\n(.*?)end elements",
                                      path.read_text(encoding="ascii"), re.DOTALL | re.IGNORECASE).groups()
    return (np.array([line.split()[1:4] for line in coordinates.splitlines()], float),
            np.array([line.split()[1:4] for line in elements.splitlines()], int) - 1)


def read_sofa(path):
    """@return points, tetrahedra"""
    text = path.read_text(encoding="ascii")
    points, corners = (re.search(rf'\b{key}="([^"]*)"', text)[1].split() for key in ("position", "tetrahedra"))
    return np.array(points, float).reshape(-1, 3), np.array(corners, int).reshape(-1, 4)


vessel, deposits, folder = map(Path, sys.argv[1:])
points, triangles = read_gid(vessel)
normals = points * [0, 1, 1]
normals /= np.linalg.norm(normals, axis=1)[:, None]
corners = points[triangles]
facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
if (facing * normals[triangles[:, 0]]).sum() < 0:
    triangles = triangles[:, ::-1]
meshes.write_shell(folder / "vessel.ply", points, triangles, normals)
points, tetrahedra = read_sofa(deposits)
meshes.write_tetrahedra(folder / "deposits.vtk", 1000 * points, tetrahedra)
