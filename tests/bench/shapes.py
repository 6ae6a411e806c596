#!/usr/bin/python3
"""Surfaces known by formulas: smooth and closed, open, with creases.

    PYTHONPATH=tests/support tests/bench/shapes.py FOLDER    writes them all
"""
import math
import sys
from pathlib import Path

import numpy as np
from meshes import write_ply


def grid(columns, rows, point, closed_rows=False):
    """A tube (or torus) of columns x rows cells from point(u, v), u around, v along, both in [0, 1)."""
    last = rows if closed_rows else rows + 1
    u, v = np.meshgrid(np.arange(columns) / columns, np.arange(last) / rows)
    vertices = np.stack(point(u, v), axis=-1).reshape(-1, 3)
    i = np.arange(columns)
    j = (i + 1) % columns
    faces = []
    for row in range(rows):
        a, b = row * columns, (row + 1) % last * columns
        faces += [np.c_[a + i, a + j, b + j], np.c_[a + i, b + j, b + i]]
    return vertices, np.vstack(faces)


def ball(n, radius):
    """A cube's surface of n x n squares per side blown up to radius(direction): closed, without poles."""
    index, vertices, faces = {}, [], []

    def at(p):
        if p not in index:
            index[p] = len(vertices)
            x = np.array(p) / n * 2 - 1
            vertices.append(np.tan(x * math.pi / 4))
        return index[p]

    for axis in range(3):
        for side in (0, n):
            for i in range(n):
                for j in range(n):
                    def corner(u, v):
                        p = [0, 0, 0]
                        p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3] = side, u, v
                        return at(tuple(p))
                    q = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]
                    if side == 0:
                        q.reverse()
                    k = (i + j) % 2
                    faces += [[q[k], q[k + 1], q[(k + 2) % 4]], [q[k], q[(k + 2) % 4], q[(k + 3) % 4]]]
    d = np.array(vertices)
    d /= np.linalg.norm(d, axis=1)[:, None]
    return radius(d), np.array(faces)


def bumps(seed, amplitude, waves):
    random = np.random.default_rng(seed)
    directions = random.normal(size=(waves, 3))
    directions *= (random.uniform(3, 9, waves) / np.linalg.norm(directions, axis=1))[:, None]
    phases, sizes = random.uniform(0, 6.28, waves), random.uniform(0.3, 1, waves) * amplitude

    def radius(d):
        return d * (50 * (1 + (np.sin(d @ directions.T + phases) * sizes).sum(axis=1)))[:, None]
    return radius


def open_cylinder(radius, length, around, along):
    return grid(around, along, lambda u, v: (radius * np.cos(2 * np.pi * u), radius * np.sin(2 * np.pi * u), length * v))


def bent_tube(u, v):
    a, r = 2 * np.pi * u, 5 + 2 * np.exp(-40 * (v - 0.6) ** 2) * (1 + 0.4 * np.cos(2 * np.pi * u))
    bend = 1.9 * v
    return ((30 + r * np.cos(a)) * np.cos(bend), (30 + r * np.cos(a)) * np.sin(bend), r * np.sin(a) + 6 * v)


def torus(u, v):
    a, b = 2 * np.pi * u, 2 * np.pi * v
    return ((30 + 10 * np.cos(a)) * np.cos(b), (30 + 10 * np.cos(a)) * np.sin(b), 10 * np.sin(a))


def on_curve(centre, radius, u, v):
    """A tube around a curve: centre(s) -> x, y, z; radius(s, angle). Its frame turns as little as it can."""
    s = v[:, 0]
    line = np.stack(centre(s), axis=-1)
    tangent = np.gradient(line, s, axis=0, edge_order=2)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    side, sides = np.array([0.1, 0.2, 1.0]), []
    for t in tangent:
        side = side - t * (side @ t)
        side /= np.linalg.norm(side)
        sides.append(side)
    one = np.array(sides)
    other = np.cross(tangent, one)
    a = 2 * np.pi * u
    r = radius(v, a)[..., None]
    points = line[:, None] + r * (np.cos(a)[..., None] * one[:, None] + np.sin(a)[..., None] * other[:, None])
    return points[..., 0], points[..., 1], points[..., 2]


def s_tube(u, v):
    return on_curve(lambda s: (60 * s, 9 * np.sin(2 * np.pi * s), 8 * np.cos(3 * s)),
                    lambda s, a: 6 + 1.5 * np.sin(7 * s) + 0.8 * np.cos(2 * a + 4 * s), u, v)


def half_torus(u, v):
    a, b = 2 * np.pi * u, np.pi * v
    r = 9 + 1.5 * np.sin(5 * b) * np.cos(a)
    return ((30 + r * np.cos(a)) * np.cos(b), (30 + r * np.cos(a)) * np.sin(b), r * np.sin(a))


def dumbbell(d):
    """Two lobes of different sizes and a neck."""
    x = d[:, 0]
    return d * (16 + 34 * x ** 2 + 7 * x ** 3 + 2 * np.sin(3 * d[:, 1] + 2 * d[:, 2]))[:, None] * [1.3, 1, 0.9]


def kidney(d):
    """An ellipsoid bent over one side."""
    p = d * [58, 30, 24]
    return np.c_[p[:, 0], p[:, 1] + 0.012 * p[:, 0] ** 2, p[:, 2] + 0.1 * p[:, 1] - 0.0015 * p[:, 0] * p[:, 1]]


def welded(vertices, faces):
    """One vertex per place, no triangles without area."""
    vertices, faces = np.asarray(vertices, float), np.asarray(faces)
    _, first, inverse = np.unique(np.round(vertices, 9), axis=0, return_index=True, return_inverse=True)
    faces = inverse.reshape(-1)[faces]
    return vertices[first], faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]


def straight(*stops):
    """A profile: (r, z, pieces to the next) and so on, without the last point."""
    points = []
    for (r, z, pieces), (next_r, next_z, *_) in zip(stops, stops[1:]):
        points += [(r + (next_r - r) * i / pieces, z + (next_z - z) * i / pieces) for i in range(pieces)]
    return points


def turned(profile, around=160):
    """The profile (r, z), from axis to axis, turned about z."""
    a = np.arange(around) * (2 * np.pi / around)
    vertices = [(r * np.cos(t), r * np.sin(t), z) for r, z in profile for t in a]
    faces = []
    for row in range(len(profile) - 1):
        for k in range(around):
            here, right = row * around + k, row * around + (k + 1) % around
            faces += [(here, right, right + around), (here, right + around, here + around)]
    return welded(vertices, faces)


def pillow(n=24):
    """A box with bulging faces: three curved creases meet at each corner."""
    size = np.array([30.0, 20.0, 15.0])
    vertices, faces = [], []
    for axis, (one, other) in enumerate(((2, 1), (0, 2), (1, 0))):
        for level, (first, second) in ((0.0, (one, other)), (1.0, (other, one))):
            base = len(vertices)
            for i in range(n + 1):
                for j in range(n + 1):
                    p = np.zeros(3)
                    p[axis], p[first], p[second] = level, i / n, j / n
                    vertices.append(p * size)
            for i in range(n):
                for j in range(n):
                    a, b = base + i * (n + 1) + j, base + (i + 1) * (n + 1) + j
                    faces += [(a, b, b + 1), (a, b + 1, a + 1)]
    vertices = np.array(vertices)
    q = 2 * vertices / size - 1
    rest = np.stack([1 - 0.5 * q[:, (k + 1) % 3] ** 2 - 0.5 * q[:, (k + 2) % 3] ** 2 for k in range(3)], axis=1)
    return welded(vertices + 2 * q * rest, faces)


def folded_sheet(n=96):
    """An open curved sheet whose fold fades out in its middle."""
    x, y = np.meshgrid(np.linspace(-20, 20, n + 1), np.linspace(-20, 20, n + 1), indexing="ij")
    s = np.clip((8 - x) / 20, 0, 1)
    vertices = np.stack([x, y, -0.35 * s * s * (3 - 2 * s) * np.abs(y) - (x * x + y * y) / 120], -1).reshape(-1, 3)
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    b = a + n + 1
    return vertices, np.vstack([np.c_[a, b, b + 1], np.c_[a, b + 1, a + 1]])


def sheet(columns, rows, point):
    """Open on all sides, of columns x rows cells from point(u, v), both in [0, 1]."""
    u, v = np.meshgrid(np.arange(columns + 1) / columns, np.arange(rows + 1) / rows)
    vertices = np.stack(point(u, v), axis=-1).reshape(-1, 3)
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    above = first + columns + 1
    return vertices, np.vstack([np.c_[first, first + 1, above + 1], np.c_[first, above + 1, above]])


def wavy_cap(u, v):
    a = 2 * np.pi * u
    r = (3 + 27 * v) * (1 + 0.08 * v * np.sin(7 * a))
    return r * np.cos(a), r * np.sin(a), 12 * np.cos(r / 14) + r / 15 * np.sin(3 * a)


def ribbon(u, v):
    a, across, turn = 2 * np.pi * u, 10 * (v - 0.5), 3 * np.pi * u
    r = 20 + across * np.cos(turn)
    return r * np.cos(a), r * np.sin(a), across * np.sin(turn) + 15 * u


def saddle(u, v):
    x, y = 2 * u - 1, 2 * v - 1
    return 50 * x, 40 * y, 30 * (x ** 2 - y ** 2) + 4 * np.sin(6 * u + 3 * v)


def saddle_sector(u, v):
    """Seven tenths of a ring: its rims curve within the surface, which no patch from positions and normals does."""
    r, a = 0.2 + 0.8 * u, 4.5 * v
    return 50 * r * np.cos(a), 50 * r * np.sin(a), 10 * r ** 2 * np.cos(2 * a)


def half_ball():
    quarter = np.linspace(0, np.pi / 2, 40)
    return turned(straight((0, 0, 24), (20, 0)) + [(20 * np.cos(t), 20 * np.sin(t)) for t in quarter[:-1]] + [(0, 20)])


def lens():
    cap = np.linspace(0, np.pi / 4, 32)
    low = 20 * np.cos(np.pi / 4)
    return turned([(20 * np.sin(t), low - 20 * np.cos(t)) for t in cap]
                  + [(20 * np.sin(t), 20 * np.cos(t) - low) for t in cap[-2::-1]])


SHAPES = {
    "ellipsoid": lambda: ball(60, lambda d: d * [60, 35, 22]),
    "bumps7": lambda: ball(80, bumps(7, 0.06, 6)),
    "bumps23": lambda: ball(80, bumps(23, 0.03, 14)),
    "bumpy_ellipsoid": lambda: ball(80, lambda d: bumps(5, 0.04, 7)(d) * [1.3, 0.7, 0.55]),
    "dumbbell": lambda: ball(80, dumbbell),
    "kidney": lambda: ball(80, kidney),
    "torus": lambda: grid(120, 240, torus, closed_rows=True),
    "s_tube": lambda: grid(128, 400, s_tube),
    "half_torus": lambda: grid(144, 280, half_torus),
    "bent_tube": lambda: grid(96, 240, bent_tube),
    "cylinder": lambda: open_cylinder(20, 80, 256, 200),
    "wavy_cap": lambda: grid(140, 40, wavy_cap),
    "ribbon": lambda: sheet(240, 20, ribbon),
    "saddle": lambda: sheet(90, 80, saddle),
    "sector": lambda: sheet(100, 360, saddle_sector),
    "closed_cylinder": lambda: turned(straight((0, 0, 16), (15, 0, 48), (15, 40, 16), (0, 40)) + [(0, 40)]),
    "frustum": lambda: turned(straight((0, 0, 20), (20, 0, 40), (8, 30, 8), (0, 30)) + [(0, 30)]),
    "half_ball": half_ball,
    "lens": lens,
    "pillow": pillow,
    "folded_sheet": folded_sheet,
}


def written(folder, name):
    """@return the file of a shape, made where it is not there yet"""
    path = Path(folder) / f"{name}.ply"
    if not path.exists():
        write_ply(path, *SHAPES[name]())
    return path


if __name__ == "__main__":
    for shape in SHAPES:
        written(sys.argv[1], shape)
