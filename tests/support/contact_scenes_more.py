"""More contact problems with known answers as scene files for tunica-simulate. Numbers: mm, N, MPa.

Answers: a clamped plate on a flat, plate theory; an inflated membrane on a flat, equilibrium; a belt on a cylinder,
Euler and Eytelwein; balls, Hertz; balls in a capsule, spheres and a plaque in its wall, Lame; a tube that closes, the
inextensible elastica; impacts, the balance of momentum; a hoop on a slope, rigid mechanics.
"""
import json
import math
import os
import re

import numpy as np
from contact_meshes import (arc, belt, eighth_of_a_ball, extruded, hoop_of_shells, mirrored, positive, quarter_disc,
                            shell_masses, solid_masses, whole_ball, whole_sphere)
from contact_scenes import block, contact, lengths, octant, plane, symmetric, table, write_vtk
from meshes import Ply
from published import LINEAR, Bench, fix, grid, load, probe, run_lines, shell, write_ply

PLAQUE = {0.3: (0.136993, 3.3932e-3), 0.45: (0.160984, 3.4214e-3)}  # widened by .3: outward way of the wall, pressure
BALL = {(0.0, 0.3): -0.651852, (10.0, 0.3): -0.733333, (10.0, 0.45): -0.486232}  # inner radius, nu: way of the capsule
# Of the inextensible elastica under a pressure in EI / R^3. Before it closes: half gap of the waist over R. Closed, its
# waist R / 50 high: half width and half height over R.
WAIST = {3.6: 0.446617, 4.4: 0.175330}
CLOSED = {6.0: (1.375788, 0.280929), 8.0: (1.389191, 0.264971)}


def solid(name, mesh, young, poisson, more=""):
    return (f"[[solid]]\nname = \"{name}\"\nmesh = \"{mesh}\"\nunit = \"mm\"\nyoung = \"{young!r}MPa\"\n"
            f"poisson = {poisson!r}\n{more}")


def held(body, nodes, translation, displacement=None):
    """Holds or moves nodes of a solid."""
    text = (f"[[fix]]\nbody = \"{body}\"\nwhere = {{nodes = {[int(n) for n in nodes]}}}\n"
            f"translation = \"{translation}\"\nrotation = \"\"\n")
    return text + (f"displacement = {lengths(*displacement)}\n" if displacement is not None else "")


def mirror_planes(body, points, axes, where=True):
    """Fixes of a solid that is cut by planes through the origin."""
    return "".join(held(body, np.flatnonzero((abs(points[:, axis]) < 1e-9) & where), "xyz"[axis]) for axis in axes)


def carried(body, nodes):
    """Attaches nodes of a body to the middle of the shell."""
    return (f"[[attach]]\nbody = \"{body}\"\nwhere = {{nodes = {[int(n) for n in nodes]}}}\nto = \"s\"\n"
            "side = \"middle\"\n")


def flat_disc(bench, radius, segments):
    """Writes a quarter of a disc. @return its points, the nodes of its rim"""
    points, triangles = quarter_disc(radius, segments)
    write_ply(bench.path("mesh.ply"), points, triangles, np.tile([0.0, 0.0, 1.0], (len(points), 1)))
    return points, np.flatnonzero(np.hypot(points[:, 0], points[:, 1]) > radius - 1e-9)


def plate_on_a_flat(bench, m, gap, resolution, segments=16, rim="xyz"):
    """A clamped circular plate, a / t = 50, under q = m 64 D g / a^4, g = `gap` walls above a flat. `rim`: held there.

    @return b / a, force on the flat / load, contact's record, result. Within b the flat bears q, and at b a force V per
    length. Per angle that is F = q b^2 / 2 + V b, with the moment q b^3 / 3 + V b^2 = F b - q b^3 / 6.
    """
    radius, wall, poisson = 10.0, 0.2, 0.3
    points, border = flat_disc(bench, radius, segments)
    pressure = m * 64 * wall**3 / 12 / (1 - poisson**2) * gap * wall / radius**4
    result = bench.run(run_lines(kind="static") + shell("mesh.ply", wall, 1.0, poisson) + fix(border, rim) +
                       symmetric(points, {0: ("x", "yz"), 1: ("y", "xz")}) +
                       load("area", (0.0, 0.0, -pressure), "MPa") +
                       plane(lengths(0, 0, -wall / 2 - gap * wall), (0, 0, 1)) + contact("s", "p", resolution))
    record = result["contacts"]["c"]
    force, moment = record["force_n"][-1][2] / (math.pi / 2), -record["moment_n_mm"][-1][1]
    b = moment / force
    for _ in range(50):
        b = (moment + pressure * b**3 / 6) / force
    return b / radius, 2 * force / (pressure * radius**2), record, result


def membrane_on_a_flat(bench, pressure, resolution, segments=12):
    """A clamped disc, a / t = 200, blown against a flat a tenth of its radius away.

    @return force / (p x area), record, result. The area is that of the force's moment about the edges of the quarter,
    which is p b^3 / 3.
    """
    radius, wall = 10.0, 0.05
    points, rim = flat_disc(bench, radius, segments)
    result = bench.run(run_lines(kind="static") + shell("mesh.ply", wall, 1.0, 0.3) + fix(rim) +
                       symmetric(points, {0: ("x", "yz"), 1: ("y", "xz")}) + load("pressure", f"{pressure!r}MPa") +
                       plane(lengths(0, 0, radius / 10), (0, 0, -1)) + contact("s", "p", resolution))
    record = result["contacts"]["c"]
    b = (3 * record["moment_n_mm"][-1][1] / pressure)**(1 / 3)
    return -record["force_n"][-1][2] / (pressure * math.pi / 4 * b**2), record, result


def blown_ring(bench, height, resolution, cells=24):
    """A quarter of a ring of radius 10, R / t = 200, blown up by 1 %, then pressed to `height` by a plate.

    @return force / (p x flat), record, result. The free part is a quarter of a circle of tension N = p x height, and
    what is left of the stretched length is flat.
    """
    radius, wall = 10.0, 0.05
    points, triangles, normals = arc(radius, 0, math.pi / 2, cells, 0.5)
    write_ply(bench.path("mesh.ply"), points, triangles, normals)
    pressure = 0.01 * wall / height
    top = lengths(0, 0, radius * 1.02 + wall / 2)
    way = table((0.0, top), (0.1, top), (1.0, lengths(0, 0, height + wall / 2)))
    result = bench.run(run_lines(kind="static", load_steps=10) + shell("mesh.ply", wall, 1.0, 0.0) +
                       symmetric(points, {0: ("x", "y"), 2: ("z", "y")}) + fix(range(len(points)), "y", "xz") +
                       load("pressure", f"{pressure!r}MPa", more="ramp = [[0.0, 0.0], [0.1, 1.0], [1.0, 1.0]]\n") +
                       plane(way, (0, 0, -1)) + contact("s", "p", resolution))
    record = result["contacts"]["c"]
    flat = 1.01 * radius * math.pi / 2 - height * math.pi / 2
    return -record["force_n"][-1][2] / (pressure * flat / 2), record, result


def capstan(bench, friction, degrees, resolution="5%", cells=20):
    """A belt, R / t = 200, made as it lies on a rigid cylinder, drawn over it against a constant force.

    @return ratio of the tensions at its ends, record, result
    """
    radius, wall, angle, slack = 10.0, 0.05, math.radians(degrees), 0.005
    points, triangles, normals, tangent = belt(radius + wall / 2 + 0.001, angle, 4.0, cells, 8)
    write_ply(bench.path("mesh.ply"), points, triangles, normals)
    drawn = f"displacement = {lengths(*(0.5 * tangent))}\nramp = [[0.0, 0.0], [0.1, 0.0], [1.0, 1.0]]\n"
    result = bench.run(run_lines(kind="static", load_steps=10) + shell("mesh.ply", wall, 100.0, 0.0) +
                       fix(range(len(points)), "y", "xz") +
                       fix([len(points) - 2, len(points) - 1], "xyz", "xz") + drawn +
                       load("force", (0.0, 0.0, -slack), "N", [0, 1],
                            "ramp = [[0.0, 0.0], [0.1, 1.0], [1.0, 1.0]]\n") +
                       f"[[rigid]]\nname = \"p\"\nshape = \"cylinder\"\nfrom = {lengths(0, -5, 0)}\n"
                       f"to = {lengths(0, 6, 0)}\nradius = \"{radius}mm\"\n" +
                       contact("s", "p", resolution, f"friction = {friction}\n"))
    record = result["contacts"]["c"]
    pulled = [0.0, 0.0, slack] - np.array(record["force_n"][-1])
    return pulled @ tangent / slack, record, result


def boussinesq(points, force, young, poisson):
    """Displacements of a half-space z < 0 under a force along -z at the origin (Boussinesq 1885)."""
    r, depth = np.hypot(points[:, 0], points[:, 1]), -points[:, 2]
    far = np.hypot(r, depth)
    scale = force * (1 + poisson) / (2 * math.pi * young * far)
    outward = scale * (r * depth / far**2 - (1 - 2 * poisson) * r / (far + depth)) / np.where(r > 0, r, 1)
    down = scale * (2 * (1 - poisson) + depth**2 / far**2)
    return np.column_stack([outward * points[:, 0], outward * points[:, 1], -down])


def below_a_ball(points, radius):
    """The points, lowered so that the plane z = 0 becomes the top of a ball."""
    return points - np.outer(radius - np.sqrt(radius**2 - (points[:, :2]**2).sum(axis=1)), [0, 0, 1])


def hertz(bench, rigid, cells, resolution="0.02%"):
    """A quarter of an elastic body, E 20000, nu .3, pressed by a rigid one, to a contact radius of 1.

    `rigid`: "plane" on a ball of R 50, or "ball" of R 50 on a half-space: the same answer. Balls of these that approach
    by 4 have the force 586081 and the radius 10 (code_aster V6.04.104). A hundredth of the approach is a tenth of the
    radius and a thousandth of the force. The far face, 25 away, moves as that of a half-space under this force does.
    @return force and radius over Hertz's, record, result. The radius is that of the force's moment, 3/8 a of a quarter.
    """
    young, poisson, force, approach, radius = 20000.0, 0.3, 586.081, 0.02, 50.0
    points, tetrahedra, far = eighth_of_a_ball(cells, 1.2 / cells, 25.0)
    moved = boussinesq(points[far], force, young, poisson)
    if rigid == "plane":
        points = below_a_ball(points, radius)
    write_vtk(bench.path("mesh.vtk"), points, tetrahedra)
    scene = solid("a", "mesh.vtk", young, poisson) + mirror_planes("a", points, (0, 1), ~far)
    scene += "".join(held("a", [node], "xyz", u) for node, u in zip(np.flatnonzero(far), moved))
    up = radius if rigid == "ball" else 0
    way = table((0.0, lengths(0, 0, up + 1e-4)), (1.0, lengths(0, 0, up - approach)))
    if rigid == "ball":
        scene += f"[[rigid]]\nname = \"p\"\nshape = \"sphere\"\ncentre = {way}\nradius = \"{radius}mm\"\n"
    else:
        scene += plane(way, (0, 0, -1))
    result = bench.run(run_lines(kind="static") + scene + contact("p", "a", resolution))
    record = result["contacts"]["c"]
    pressing, moment = record["force_n"][-1][2], abs(record["moment_n_mm"][-1][1])
    return 4 * pressing / force, 8 / 3 * moment / pressing, record, result


def two_caps(bench, pair, cells=3, approach=0.2, resolution="0.2%"):
    """A cap of a ball of R 50 pressed on its mirror image ("caps"), or on the rigid plane between ("plane").

    @return force, record, result. Both must say the same.
    """
    points, tetrahedra, far = eighth_of_a_ball(cells, 1.0, 15.0)
    for axis in (0, 1):
        points, tetrahedra = mirrored(points, tetrahedra, axis)
    far = np.linalg.norm(points, axis=1) > 15 - 1e-9
    points = below_a_ball(points, 50)
    scene = ""
    for name, side in (("a", 1), ("p", -1)) if pair == "caps" else (("a", 1),):
        placed = points * [1, 1, side] - [0, 0, side * 1e-3]
        write_vtk(bench.path(name + ".vtk"), placed, positive(placed, tetrahedra))
        scene += solid(name, name + ".vtk", 1.0, 0.3)
        scene += held(name, np.flatnonzero(far), "xyz", (0, 0, side * approach / 2))
    if pair == "plane":
        scene += plane(lengths(0, 0, 0), (0, 0, -1))
    result = bench.run(run_lines(kind="static") + scene + contact("p", "a", resolution))
    return result["contacts"]["c"]["force_n"][-1][2], result["contacts"]["c"], result


def stacked_blocks(bench, resolution, cells=(3, 4), pressed=0.05):
    """A block, 10 x 10 x 5, nu 0, pressed on one just as wide, with these numbers of cells each way.

    @return force over E A d / L, record, result. The stress is uniform: a patch test of contact.
    """
    between = 0.001
    scene = ""
    for name, n, origin in (("a", cells[0], between), ("b", cells[1], -5.0)):
        points, tetrahedra = block(n, np.array([10.0, 10.0, 5.0]), np.array([-5.0, -5.0, origin]))
        write_vtk(bench.path(name + ".vtk"), points, tetrahedra)
        far = np.flatnonzero(abs(points[:, 2] - (5 + between if name == "a" else -5)) < 1e-9)
        scene += solid(name, name + ".vtk", 1.0, 0.0) + held(name, far, "xyz", (0, 0, -pressed - between) if name == "a" else None)
    result = bench.run(run_lines(kind="static") + scene + contact("a", "b", resolution))
    record = result["contacts"]["c"]
    return record["force_n"][-1][2] / (100 * pressed / 10), record, result


def plaque(bench, poisson, widened=0.03, around=48, through=16, resolution="0.2%"):
    """A quarter of a ring, 6 to 10, 60 kPa, in a wall of 1 MPa, t 1, R 10, in plane strain, widened by a cylinder.

    @return outward way of the wall and pressure of the cylinder, both times .3 / `widened`; record, result. Answer:
    Lame's ring in a membrane. That is linear, so `widened` is small.
    """
    height, half = 0.5, math.pi / 4 / around
    flat, triangles, _ = grid(around, through, lambda u, v: ((6 + 4 * v) * np.cos(u * math.pi / 2),
                                                             (6 + 4 * v) * np.sin(u * math.pi / 2), 0 * u))
    points, tetrahedra = extruded(triangles, [flat, flat + [0, 0, height]])
    write_vtk(bench.path("plaque.vtk"), points, tetrahedra)
    wall, shells, normals = grid(around, 1, lambda u, v: (10 * np.cos(u * math.pi / 2), 10 * np.sin(u * math.pi / 2),
                                                          height * v), lambda p, u, v: (p[:, 0], p[:, 1], 0 * u))
    if (wall[:, :2] * normals[:, :2]).sum() < 0:
        normals, shells = -normals, shells[:, ::-1]
    write_ply(bench.path("mesh.ply"), wall, shells, normals)
    free = np.hypot(points[:, 0], points[:, 1]) < 10 - 1e-9
    # The cylinder touches the facets, whose middles are nearer to the axis than the nodes.
    radius = table((0.0, json.dumps(f"{6 * math.cos(half) - 1e-3!r}mm")),
                   (1.0, json.dumps(f"{(6 + widened) * math.cos(half)!r}mm")))
    result = bench.run(run_lines(kind="static") + shell("mesh.ply", 1.0, 1.0, 0.45) +
                       solid("k", "plaque.vtk", 0.06, poisson) + carried("k", np.flatnonzero(~free)) +
                       fix(range(len(wall)), "z", "xy") + symmetric(wall, {0: ("x", ""), 1: ("y", "")}) +
                       held("k", np.flatnonzero(free), "z") + mirror_planes("k", points, (0, 1), free) +
                       f"[[rigid]]\nname = \"p\"\nshape = \"cylinder\"\nfrom = {lengths(0, 0, -5)}\n"
                       f"to = {lengths(0, 0, 5)}\nradius = {radius}\n" + contact("k", "p", resolution) +
                       probe("wall", (10.0, 0.0, 0.0)))
    record = result["contacts"]["c"]
    moved, force = result["probes"]["wall"]["displacement_mm"][-1][0], record["force_n"][-1][0]
    return moved * 0.3 / widened, force / (6 * height) * 0.3 / widened, record, result


def ball_in_a_capsule(bench, inner, poisson, cells=16):
    """A ball of R 20, 5 kPa, hollow from `inner` on, in a capsule of .1 mm, 1 MPa, nu .45, under 1 kPa outside, linear.

    @return the mean outward way of the capsule. Answer: p / (k + 2 E t / ((1 - nu) R^2)), k that of the ball (Lame).
    """
    normals, triangles = octant(cells)
    if inner == 0:
        points, tetrahedra, _ = eighth_of_a_ball(cells, 20 / cells, 20.0)
        points = points * [1, 1, -1]
        tetrahedra = positive(points, tetrahedra)
    else:
        points, tetrahedra = extruded(triangles, [normals * r for r in np.linspace(inner, 20, cells * 2 // 3 + 1)])
    write_vtk(bench.path("ball.vtk"), points, tetrahedra)
    write_ply(bench.path("mesh.ply"), 20 * normals, triangles, normals)
    free = np.linalg.norm(points, axis=1) < 20 - 1e-9
    bench.run(LINEAR + shell("mesh.ply", 0.1, 1.0, 0.45) + solid("b", "ball.vtk", 0.005, poisson) +
              carried("b", np.flatnonzero(~free)) + load("pressure", "-1kPa") +
              symmetric(normals, {0: ("x", "yz"), 1: ("y", "xz"), 2: ("z", "xy")}) +
              mirror_planes("b", points, range(3), free))
    return (bench.displacements()[-1][:len(normals)] * normals).sum(axis=1).mean()


def thick_sphere(bench, poisson, cells=16):
    """A sphere, 10 to 20, 60 kPa, under 1 kPa inside, linear. @return mean outward ways inside, outside over Lame's"""
    directions, triangles = octant(cells)
    points, tetrahedra = extruded(triangles, [directions * 10 * 2**(k / cells) for k in range(cells + 1)])
    write_vtk(bench.path("ball.vtk"), points, tetrahedra)
    a, b, c = (10 * directions[triangles[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a) / 2
    areas *= np.sign((areas * a).sum(axis=1))[:, None]
    forces = np.zeros_like(directions)
    np.add.at(forces, triangles.ravel(), np.repeat(areas / 3 * 1e-3, 3, axis=0))
    loads = "".join(load("force", force, "N", [node]) for node, force in enumerate(forces.tolist()))
    loads = loads.replace("\"s\"", "\"b\"")
    bench.run(LINEAR + solid("b", "ball.vtk", 0.06, poisson) + mirror_planes("b", points, range(3)) + loads)
    moved, count = bench.displacements()[-1], len(directions)

    def exact(r):
        return ((1 - 2 * poisson) * r + (1 + poisson) * 8000 / (2 * r * r)) * 1e-3 * 1000 / (0.06 * 7000)

    return ((moved[:count] * directions).sum(axis=1).mean() / exact(10),
            (moved[-count:] * directions).sum(axis=1).mean() / exact(20))


def closing_tube(bench, pressure, resolution="5%", cells=64):
    """The right half of a ring, R / t = 50, under pressure from outside in EI / R^3, in contact with itself.

    Two small forces lead it to an upright waist; they are gone at the end.
    @return positions of its nodes over R, two by two from the top on, record, result
    """
    radius, wall = 10.0, 0.2
    points, triangles, normals = arc(radius, math.pi / 2, -math.pi / 2, cells)
    write_ply(bench.path("mesh.ply"), points, triangles, normals)
    rigidity = wall**3 / 12
    top, side, low = [0, 1], [cells, cells + 1], [2 * cells, 2 * cells + 1]
    push = "ramp = [[0.0, 0.0], [0.1, 1.0], [0.3, 1.0], [0.5, 0.0], [1.0, 0.0]]\n"
    first = min(3.6 / pressure, 1)
    force = 0.2 * rigidity / radius**2
    result = bench.run(run_lines(kind="static", load_steps=20) + shell("mesh.ply", wall, 1.0, 0.0) +
                       fix(range(len(points)), "y", "xz") + fix(top + low, "x", "y") + fix(side, "z", "") +
                       load("pressure", f"{-pressure * rigidity / radius**3!r}MPa",
                            more=f"ramp = [[0.0, 0.0], [0.4, {first!r}], [0.5, {first!r}], [1.0, 1.0]]\n") +
                       load("force", (0.0, 0.0, -force), "N", top, push) +
                       load("force", (0.0, 0.0, force), "N", low, push) + contact("s", "s", resolution))
    return (points + bench.displacements()[-1]) / radius, result["contacts"]["c"], result


def falling_body(bench, kind):
    """The body "s" at the origin: its lumped masses, its lowest point, and the scene's text."""
    if kind == "ball":
        points, tetrahedra = whole_ball(3, 10.0)
        write_vtk(bench.path("s.vtk"), points, tetrahedra)
        return (solid_masses(points, tetrahedra, 0.2e-9), -10.0,
                solid("s", "s.vtk", 0.1, 0.3, "density = \"200kg/m3\"\n"))
    normals, triangles = whole_sphere(2)
    points, wall, low = 10 * normals, 0.5, -10.0
    write_ply(bench.path("mesh.ply"), points, triangles, normals)
    return (shell_masses(points, triangles, wall, 1e-9), low,
            shell("mesh.ply", wall, 1.0, 0.3, density="1000kg/m3"))


def impact(bench, pair, off=2.0, steps=60, step=1e-3):
    """A free body gets 1 m/s within 20 ms and meets a free ball ("ball-ball") or a plane ("ball-plane").

    A ball is of tetrahedra, R 10; a "sphere" is a curved shell, R 10. `off`: how far beside its middle. The masses of
    balls are exact; of a sphere they are those of its facets.
    @return momenta after each step (steps x 3), the momentum given, record, result
    """
    first, other = pair.split("-")
    masses, low, scene = falling_body(bench, first)
    given = np.array([0.0, 0.0, -1000.0]) * masses.sum()
    scene += ("[[load]]\nbody = \"s\"\nkind = \"gravity\"\nvalue = [\"0m/s2\", \"0m/s2\", \"-50m/s2\"]\n"
              "ramp = [[\"0s\", 1.0], [\"20ms\", 1.0], [\"20.1ms\", 0.0]]\n")
    if other == "ball":
        points, tetrahedra = whole_ball(3, 10.0)
        write_vtk(bench.path("p.vtk"), points + [off, 0, low - 22], tetrahedra)
        masses = np.concatenate([masses, solid_masses(points, tetrahedra, 0.2e-9)])
        scene += solid("p", "p.vtk", 0.1, 0.3, "density = \"200kg/m3\"\n")
    else:
        scene += plane(lengths(0, 0, low - 12), (0, 0, 1))
    result = bench.run(run_lines(kind="dynamic", duration=f"{steps * step!r}s", step=f"{step!r}s") + scene +
                       contact("s", "p"))
    momenta = np.einsum("n,snk->sk", masses, np.diff(bench.displacements(), axis=0)) / step
    return momenta, given, result["contacts"]["c"], result


def hoop(bench, surface, wall=0.1, degrees=10.0, steps=50, step=0.002):
    """A hoop of 12 shells, R = 10, one of them undermost, on a slope that is inclined by turning gravity.

    @return way of its middle down the slope, that of a hoop that rolls on its outer face at Rc, result. Backward Euler
    moves by a step^2 n (n + 1) / 2, and a = g sin / (1 + R^2 / Rc^2).
    """
    radius, width = 10.0, 2.0
    points, triangles, normals = hoop_of_shells(12, radius, width)
    write_ply(bench.path("mesh.ply"), points, triangles, normals)
    low = -wall / 2 - 0.002 - radius * (math.cos(math.pi / 12) if surface == "facets" else 1)
    slope = math.radians(degrees)
    gravity = (9810 * math.sin(slope), 0.0, -9810 * math.cos(slope))
    result = bench.run(run_lines(kind="dynamic", duration=f"{steps * step!r}s", step=f"{step!r}s") +
                       shell("mesh.ply", wall, 1e5, 0.0, density="1000kg/m3") + fix(range(24), "y", "xz") +
                       load("gravity", gravity, "mm/s2") + plane(lengths(0, 0, low), (0, 0, 1)) +
                       contact("s", "p", "5%", f"friction = 0.5\nsurface = \"{surface}\"\n"))
    acceleration = gravity[0] / (1 + (radius / (radius + wall / 2))**2)
    return bench.displacements()[-1][:, 0].mean(), acceleration * step**2 * steps * (steps + 1) / 2, result


class InMetres(Bench):
    """Runs scenes written in millimetres after saying all lengths, those of the meshes too, in metres."""

    def run(self, scene, name="run", **more):
        for file in os.listdir(self.folder):
            if file.endswith(".ply"):
                ply_in_metres(self.path(file))
            elif file.endswith(".vtk"):
                vtk_in_metres(self.path(file))
        scene = re.sub(r'"(-?[0-9.e+-]+)mm"', lambda found: f"\"{float(found[1]) / 1000!r}m\"", scene)
        return super().run(scene.replace("unit = \"mm\"", "unit = \"m\""), name, **more)


def ply_in_metres(path):
    ply = Ply(path)
    more = {name: ply.fields[name] for name in ply.fields.dtype.names[3:]}
    write_ply(path, ply.vertices / 1000, ply.triangles, comments=["units m"], **more)


def vtk_in_metres(path):
    with open(path, encoding="ascii") as file:
        lines = file.readlines()
    count = int(lines[4].split()[1])
    for k in range(5, 5 + count):
        lines[k] = " ".join(repr(float(x) / 1000) for x in lines[k].split()) + "\n"
    with open(path, "w", encoding="ascii") as file:
        file.writelines(lines)
