"""Published shell problems as scene files for tunica-simulate, and what their answers are. Numbers: mm, N, MPa."""
import json
import math
import os

import h5py
import numpy as np

from meshes import geodesic, rows_around, write_ply_mm as write_ply
from running import run_tool

MEMBRANES = ("cst", "opt", "adapt")
BENDINGS = ("comas", "comas-consistent", "dkt", "dkt-comas")


def grid(nx, ny, surface, normal=None, first=0):
    """nx x ny cells of the unit square, each cut by one diagonal, mapped by `surface`; `first` renames the corners."""
    u, v = np.meshgrid(np.linspace(0, 1, nx + 1), np.linspace(0, 1, ny + 1), indexing="ij")
    points = np.stack(np.broadcast_arrays(*surface(u.ravel(), v.ravel())), axis=1).astype(float)
    a = (np.arange(nx)[:, None] * (ny + 1) + np.arange(ny)[None]).ravel()
    triangles = np.concatenate([np.stack([a, a + ny + 1, a + ny + 2], axis=1), np.stack([a, a + ny + 2, a + 1], axis=1)])
    normals = None
    if normal is not None:
        normals = np.stack(np.broadcast_arrays(*normal(points, u.ravel(), v.ravel())), axis=1).astype(float)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        sides = points[triangles[0]]
        if np.cross(sides[1] - sides[0], sides[2] - sides[0]) @ normals[triangles[0][0]] < 0:
            normals = -normals
    return points, np.roll(triangles, first, axis=1), normals


def vessel(around, along):
    """An open vessel with an aneurysm: radius 10 + 10 exp(-((z - 30)/10)^2) ((1 + cos a)/2)^2, length 60."""
    def point(angle, z):
        r = 10 + 10 * np.exp(-((z - 30) / 10)**2) * ((1 + np.cos(angle)) / 2)**2
        return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=-1)

    angle, part, triangles = rows_around(around, along)
    z = 60 * part
    d = 1e-5
    normals = np.cross(point(angle + d, z) - point(angle - d, z), point(angle, z + d) - point(angle, z - d))
    return point(angle, z), triangles, normals / np.linalg.norm(normals, axis=1)[:, None]


def organ(frequency):
    """A closed bumpy organ of mean radius 10 over a geodesic sphere, 20 x frequency^2 triangles, with its normals."""
    def surface(directions):
        d = directions / np.linalg.norm(directions, axis=1)[:, None]
        x, y, z = d.T
        return d * (10 * (1 + 0.12 * np.sin(3 * x + 1) * np.cos(4 * y) + 0.08 * np.sin(5 * z + 2 * x)))[:, None]

    d, triangles = geodesic(frequency)
    a = np.cross(d, np.where(np.abs(d[:, :1]) < 0.7, [(1.0, 0, 0)], [(0, 1.0, 0)]))
    a *= 1e-5 / np.linalg.norm(a, axis=1)[:, None]
    b = np.cross(d, a)
    normals = np.cross(surface(d + a) - surface(d - a), surface(d + b) - surface(d - b))
    return surface(d), triangles, normals / np.linalg.norm(normals, axis=1)[:, None]


def run_lines(**keys):
    return "[run]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items())


def shell(mesh, thickness, young, poisson, membrane="adapt", bending="dkt-comas", rest="curved", density=None):
    text = (f"[[shell]]\nname = \"s\"\nmesh = \"{mesh}\"\nthickness = \"{thickness}mm\"\nyoung = \"{young!r}MPa\"\n"
            f"poisson = {poisson!r}\nmembrane = \"{membrane}\"\nbending = \"{bending}\"\nrest = \"{rest}\"\n")
    return text + (f"density = \"{density}\"\n" if density else "")


def fix(nodes, translation="xyz", rotation="xyz"):
    return (f"[[fix]]\nbody = \"s\"\nwhere = {{nodes = {[int(n) for n in nodes]}}}\ntranslation = \"{translation}\"\n"
            f"rotation = \"{rotation}\"\n")


def load(kind, value, unit="", nodes=None, more=""):
    quantities = json.dumps([f"{x!r}{unit}" for x in value]) if not isinstance(value, str) else json.dumps(value)
    where = f"where = {{nodes = {[int(n) for n in nodes]}}}\n" if nodes is not None else ""
    return f"[[load]]\nbody = \"s\"\nkind = \"{kind}\"\nvalue = {quantities}\n{where}{more}"


def probe(name, point):
    return f"[[probe]]\nname = \"{name}\"\nbody = \"s\"\nnearest = {json.dumps([f'{x!r}mm' for x in point])}\n"


LINEAR = run_lines(kind="static", geometry="linear", load_steps=1)


class Bench:
    """Runs scenes in a folder."""

    def __init__(self, folder):
        self.folder = folder
        self.code, self.error = 0, ""

    def path(self, name):
        return os.path.join(self.folder, name)

    def run(self, scene, name="run", threads=None, check=True):
        """@return the report's result; its exit code and message stay in `code` and `error`"""
        with open(self.path(name + ".toml"), "w", encoding="utf-8") as file:
            file.write(scene)
        done = run_tool("simulate", "--scene", name + ".toml", name + ".hdf", "--force", "--quiet",
                        *(["--threads", threads] if threads else []), folder=self.folder, report=name + ".json",
                        code=0 if check else range(7))
        self.code, self.error = done.returncode, done.stderr.strip()
        return done.report["result"]

    def displacements(self, name="run"):
        """Of every written state: states x nodes x 3."""
        with h5py.File(self.path(name + ".hdf")) as file:
            return file["tunica/nodes/displacement"][()]

    def solve(self, mesh, scene, **more):
        """A scene of one shell in mesh.ply; the displacements of its last state."""
        write_ply(self.path("mesh.ply"), *mesh)
        self.run(scene, **more)
        return self.displacements()[-1]

    # Each of these gives the ratio of the deflection to the reference.

    def plate(self, n, simply=False, first=0, **elements):
        """A square plate under a uniform load (Timoshenko)."""
        mesh = grid(n, n, lambda u, v: (u, v, 0 * u), first=first)
        edge = np.flatnonzero((mesh[0][:, :2] < 1e-9).any(axis=1) | (mesh[0][:, :2] > 1 - 1e-9).any(axis=1))
        u = self.solve(mesh, LINEAR + shell("mesh.ply", 0.01, 12 * (1 - 0.09), 0.3, **elements) +
                       fix(edge, "xyz", "z" if simply else "xyz") + load("area", (0.0, 0.0, 1e-6), "MPa"))
        middle = n // 2 * (n + 1) + n // 2
        return u[middle, 2] / (0.00406235 if simply else 0.00126532)

    def roof(self, n, **elements):
        """Scordelis and Lo's roof; the thin-shell limit 0.3006."""
        half = math.radians(40)
        mesh = grid(n, n, lambda u, v: (25 * u, 25 * np.sin(half * v), 25 * np.cos(half * v)),
                    lambda p, u, v: (0, p[:, 1], p[:, 2]))
        x, y = mesh[0][:, 0], mesh[0][:, 1]
        u = self.solve(mesh, LINEAR + shell("mesh.ply", 0.25, 4.32e8, 0.0, **elements) +
                       fix(np.flatnonzero(x > 25 - 1e-9), "yz", "x") + fix(np.flatnonzero(x < 1e-9), "x", "yz") +
                       fix(np.flatnonzero(np.abs(y) < 1e-9), "y", "xz") + load("area", (0.0, 0.0, -90.0), "MPa"))
        return u[n, 2] / -0.3006

    def cylinder(self, n, **elements):
        """The pinched cylinder with diaphragms; thin-shell limit 1.003 x 1.8248e-5."""
        mesh = grid(n, n, lambda u, v: (300 * u, 300 * np.sin(math.pi / 2 * v), 300 * np.cos(math.pi / 2 * v)),
                    lambda p, u, v: (0, p[:, 1], p[:, 2]))
        x, y, z = mesh[0].T
        u = self.solve(mesh, LINEAR + shell("mesh.ply", 3, 3e6, 0.3, **elements) +
                       fix(np.flatnonzero(x > 300 - 1e-6), "yz", "x") + fix(np.flatnonzero(x < 1e-6), "x", "yz") +
                       fix(np.flatnonzero(np.abs(y) < 1e-6), "y", "xz") +
                       fix(np.flatnonzero(np.abs(z) < 1e-6), "z", "xy") + load("force", (0.0, 0.0, -0.25), "N", [0]))
        return u[0, 2] / (-1.8248e-5 * 1.003)

    def hemisphere(self, n, **elements):
        """A quarter of the pinched hemisphere with an 18 degree hole; thin-shell limit 0.9945 x 0.0940."""
        def point(u, v):
            latitude, longitude = math.radians(72) * v, math.pi / 2 * u
            return (10 * np.cos(latitude) * np.cos(longitude), 10 * np.cos(latitude) * np.sin(longitude),
                    10 * np.sin(latitude))

        mesh = grid(n, n, point, lambda p, u, v: (p[:, 0], p[:, 1], p[:, 2]))
        x, y = mesh[0][:, 0], mesh[0][:, 1]
        u = self.solve(mesh, LINEAR + shell("mesh.ply", 0.04, 6.825e7, 0.3, **elements) +
                       fix(np.flatnonzero(np.abs(y) < 1e-9), "y", "xz") +
                       fix(np.flatnonzero(np.abs(x) < 1e-9), "x", "yz") + fix([0], "z", "") +
                       load("force", (1.0, 0.0, 0.0), "N", [0]) +
                       load("force", (0.0, -1.0, 0.0), "N", [n * (n + 1)]))
        return u[0, 0] / (0.0940 * 0.9945)

    def beam(self, n, **elements):
        """The thin beam twisted by 90 degrees, n x n/6: the worse of the two loads."""
        def point(u, v):
            angle = math.pi / 2 * u
            return 12 * u, 1.1 * (v - 0.5) * np.cos(angle), 1.1 * (v - 0.5) * np.sin(angle)

        mesh = grid(n, n // 6, point, lambda p, u, v: (1.1 * (v - 0.5) * math.pi / 24, np.sin(math.pi / 2 * u),
                                                       -np.cos(math.pi / 2 * u)))
        tip = n * (n // 6 + 1) + n // 12
        ratios = []
        for axis, reference in ((1, 0.001294), (2, 0.005256)):
            force = [0.0, 0.0, 0.0]
            force[axis] = 1e-6
            u = self.solve(mesh, LINEAR + shell("mesh.ply", 0.0032, 29e6, 0.22, **elements) +
                           fix(np.flatnonzero(mesh[0][:, 0] < 1e-9)) + load("force", force, "N", [tip]))
            ratios.append(u[tip, axis] / reference)
        return max(ratios, key=lambda ratio: abs(ratio - 1))

    def organ_energy(self, frequency, thickness, **elements):
        """Strain energy of the closed bumpy organ under a small pressure."""
        write_ply(self.path("mesh.ply"), *organ(frequency))
        return self.run(LINEAR + shell("mesh.ply", thickness, 1.0, 0.3, **elements) +
                        "[[fix]]\nbody = \"s\"\nwhere = {rigid_motions = true}\n" +
                        load("pressure", "1e-3Pa"))["strain_energy_mj"]

    def bending_patch(self, **elements):
        """A rectangle of irregular triangles bent by a constant moment, its exact deflection a parabola: the largest
        error of a node, relative to the largest deflection."""
        points, triangles, _ = grid(4, 3, lambda u, v: (4 * u, 3 * v, 0 * u))
        inner = (points[:, 0] > 0.5) & (points[:, 0] < 3.5) & (points[:, 1] > 0.5) & (points[:, 1] < 2.5)
        shift = np.random.default_rng(1).uniform(-0.2, 0.2, (len(points), 2))
        points[inner, :2] += shift[inner]
        young, t, poisson, moment = 1200.0, 0.1, 0.3, 1e-6  # moment per length
        rigidity = young * t**3 / 12 / (1 - poisson**2)
        loads = ""
        for x, sign in ((0, 1.0), (4, -1.0)):  # positive about y lifts the middle
            edge = np.flatnonzero(np.abs(points[:, 0] - x) < 1e-9)
            corners = [n for n in edge if points[n, 1] < 1e-9 or points[n, 1] > 3 - 1e-9]
            others = [n for n in edge if n not in corners]
            loads += load("moment", (0.0, -sign * moment * 1.0, 0.0), "N*mm", corners)
            loads += load("moment", (0.0, -sign * moment * 2.0, 0.0), "N*mm", others)
        # Held so that it can bend freely: three corners, and no rotation about z.
        corner = {(x, y): int(np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - y))) for x in (0, 4) for y in (0, 3)}
        held = fix([corner[0, 0]], "xyz", "z") + fix([corner[4, 0]], "yz", "") + fix([corner[0, 3]], "z", "")
        u = self.solve((points, triangles, None), LINEAR + shell("mesh.ply", t, young, poisson, **elements) + held + loads)
        kx = moment / (rigidity * (1 - poisson**2))
        x, y = points[:, 0], points[:, 1]
        exact = kx / 2 * (x * (x - 4) - poisson * y * (y - 3))
        return np.abs(np.abs(u[:, 2]) - np.abs(exact)).max() / np.abs(exact).max()

    def roll_up(self, columns=16, **elements):
        """A strip bent by M = 2 pi E I / L: how far it is from closing, relative to its length; none without equilibrium
        (then `error` says why)."""
        mesh = grid(columns, 1, lambda u, v: (12 * u, v, 0 * u))
        end = [2 * columns, 2 * columns + 1]
        write_ply(self.path("mesh.ply"), *mesh)
        self.run(run_lines(kind="static", load_steps=20) + shell("mesh.ply", 0.1, 1.2e6, 0.0, **elements) + fix([0, 1]) +
                 load("moment", (0.0, -50 * math.pi / 3, 0.0), "N*mm", end), check=False)
        return np.linalg.norm(self.displacements()[-1, end[0]] + [12, 0, 0]) / 12 if self.code == 0 else None
