"""Contact problems with known answers as scene files for tunica-simulate. Numbers: mm, N, MPa.

Answers: a ring between plates, the inextensible elastica; a sphere under a plate, axisymmetric Kirchhoff-Love theory by
160 cubic elements; a tube on a rigid cylinder, p r = E t (r / R - 1); a block on a slope, Coulomb's law.
"""
import json
import math

import numpy as np
from published import fix, grid, probe, run_lines, shell, write_ply

RING = {0.1: 1.17433, 0.2: 2.11530, 0.4: 3.98761}  # flattening D = (R - H) / R: P R^2 / EI
SPHERE = {0.4995: 1.063, 0.9995: 2.327, 1.498: 3.882}  # drop / t: F R / (E t^3)


def lengths(*values):
    return json.dumps([f"{float(value)!r}mm" for value in values])


def table(*rows):
    return "[" + ", ".join(f"[{factor!r}, {value}]" for factor, value in rows) + "]"


def plane(point, normal):
    return f"[[rigid]]\nname = \"p\"\nshape = \"plane\"\npoint = {point}\nnormal = {[float(x) for x in normal]}\n"


def contact(one, other, resolution="5%", more=""):
    return f"[[contact]]\nname = \"c\"\nbetween = [\"{one}\", \"{other}\"]\nresolution = \"{resolution}\"\n{more}"


def symmetric(points, planes):
    """Fixes of the shell "s" on planes through the origin: axis -> (translation, rotation) held."""
    return "".join(fix(np.where(abs(points[:, axis]) < 1e-9)[0], *held) for axis, held in planes.items())


def ring(bench, flattening, resolution="5%", steps=10):
    """A quarter of a ring of radius 10, 0.2 thick, pressed flat by a plate. @return P R^2 / EI, contact's record, result"""
    radius, wall = 10.0, 0.2
    points, triangles, normals = grid(24, 1, lambda u, v: (radius * np.cos(u * np.pi / 2), v,
                                                          radius * np.sin(u * np.pi / 2)),
                                      lambda p, u, v: (p[:, 0], 0 * u, p[:, 2]))
    if (points[:, [0, 2]] * normals[:, [0, 2]]).sum() < 0:
        normals, triangles = -normals, triangles[:, ::-1]
    write_ply(bench.path("mesh.ply"), points, triangles, normals)
    top, end = radius + wall / 2, radius * (1 - flattening) + wall / 2
    result = bench.run(run_lines(kind="static", load_steps=steps) + shell("mesh.ply", wall, 1.0, 0.0) +
                       symmetric(points, {0: ("x", "y"), 2: ("z", "y")}) + fix(range(len(points)), "y", "xz") +
                       plane(table((0.0, lengths(0, 0, top + 0.01)), (1.0, lengths(0, 0, end))), (0, 0, -1)) +
                       contact("s", "p", resolution))
    record = result["contacts"]["c"]
    return -2 * record["force_n"][-1][2] * radius**2 / (wall**3 / 12), record, result


def octant(frequency):
    """An eighth of the unit sphere, and its triangles, outward."""
    numbers, points, triangles = {}, [], []
    for i in range(frequency + 1):
        for j in range(frequency + 1 - i):
            numbers[i, j] = len(points)
            points.append((i, j, frequency - i - j))
    for i in range(frequency):
        for j in range(frequency - i):
            triangles.append((numbers[i, j], numbers[i + 1, j], numbers[i, j + 1]))
            if i + j + 1 < frequency:
                triangles.append((numbers[i + 1, j], numbers[i + 1, j + 1], numbers[i, j + 1]))
    points = np.array(points, float)
    return points / np.linalg.norm(points, axis=1)[:, None], np.array(triangles)


def sphere(bench, drop, frequency=16, resolution="5%", steps=8):
    """A sphere R / t = 50, its equator held by symmetry, under a plate. @return F R / (E t^3), record, result"""
    normals, triangles = octant(frequency)
    points = 50 * normals
    write_ply(bench.path("mesh.ply"), points, triangles, normals)
    result = bench.run(run_lines(kind="static", load_steps=steps) + shell("mesh.ply", 1.0, 1.0, 0.3) +
                       symmetric(points, {0: ("x", "yz"), 1: ("y", "xz"), 2: ("z", "xy")}) +
                       plane(table((0.0, lengths(0, 0, 50.6)), (1.0, lengths(0, 0, 50.5 - drop))), (0, 0, -1)) +
                       contact("s", "p", resolution) + probe("top", (0.0, 0.0, 50.0)))
    record = result["contacts"]["c"]
    return -4 * 50 * record["force_n"][-1][2], record, result


def tube(bench, resolution="5%", more=""):
    """A quarter of a tube of radius 10, widened to 11 by a rigid cylinder. @return force over its answer, record, result"""
    points, triangles, normals = grid(16, 4, lambda u, v: (10 * np.cos(u * np.pi / 2), 10 * np.sin(u * np.pi / 2), 10 * v),
                                      lambda p, u, v: (p[:, 0], p[:, 1], 0 * u))
    if (points[:, :2] * normals[:, :2]).sum() < 0:
        normals, triangles = -normals, triangles[:, ::-1]
    write_ply(bench.path("mesh.ply"), points, triangles, normals)
    radius = table((0.0, json.dumps("9.85mm")), (1.0, json.dumps("10.9mm")))
    result = bench.run(run_lines(kind="static", load_steps=5) + shell("mesh.ply", 0.2, 1.0, 0.0) +
                       symmetric(points, {0: ("x", "yz"), 1: ("y", "xz"), 2: ("z", "xy")}) +
                       f"[[rigid]]\nname = \"p\"\nshape = \"cylinder\"\nfrom = {lengths(0, 0, -20)}\n"
                       f"to = {lengths(0, 0, 40)}\nradius = {radius}\n" + contact("s", "p", resolution, more), check=False)
    record = result["contacts"]["c"] if bench.code == 0 else None
    return record and record["force_n"][-1][0] / (10 * 0.2 * 0.1), record, result


def block(n, size, origin):
    """Nodes and tetrahedra of a block of n cells each way."""
    i, j, k = np.meshgrid(*[np.arange(n + 1)] * 3, indexing="ij")
    points = np.stack([i.ravel(), j.ravel(), k.ravel()], axis=1) / n * size + origin
    corners = [(a * (n + 1) + b) * (n + 1) + c for a in (0, 1) for b in (0, 1) for c in (0, 1)]
    cells = [(a * (n + 1) + b) * (n + 1) + c for a in range(n) for b in range(n) for c in range(n)]
    paths = ((0, 4, 6, 7), (0, 4, 7, 5), (0, 5, 7, 1), (0, 1, 7, 3), (0, 3, 7, 2), (0, 2, 7, 6))
    return points, np.array([[cell + corners[p] for p in path] for cell in cells for path in paths])


def write_vtk(path, points, tetrahedra):
    with open(path, "w", encoding="ascii") as file:
        file.write(f"# vtk DataFile Version 3.0\nsolid\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {len(points)} double\n")
        file.writelines(f"{x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
        file.write(f"CELLS {len(tetrahedra)} {5 * len(tetrahedra)}\n")
        file.writelines("4 {} {} {} {}\n".format(*t) for t in tetrahedra.tolist())
        file.write(f"CELL_TYPES {len(tetrahedra)}\n" + "10\n" * len(tetrahedra))


def slope(bench, angle, friction, run):
    """A block of tetrahedra, 10 x 10 x 5, on a plane that is inclined by turning gravity. @return the result"""
    points, tetrahedra = block(2, np.array([10.0, 10.0, 5.0]), np.array([0, 0, 0.02]))
    write_vtk(bench.path("mesh.vtk"), points, tetrahedra)
    gravity = json.dumps([f"{9810 * math.sin(angle)!r}mm/s2", "0mm/s2", f"{-9810 * math.cos(angle)!r}mm/s2"])
    return bench.run(run + "[[solid]]\nname = \"b\"\nmesh = \"mesh.vtk\"\nunit = \"mm\"\nyoung = \"1MPa\"\npoisson = 0.3\n"
                     f"density = \"1000kg/m3\"\n[[load]]\nbody = \"b\"\nkind = \"gravity\"\nvalue = {gravity}\n" +
                     plane(lengths(0, 0, 0), (0, 0, 1)) + contact("b", "p", "5%", f"friction = {friction}\n"), check=False)
