#!/usr/bin/python3
"""run.py NAME BIN OUT [--threads N]: meshes, result, pictures and curve of the scene NAME, made by the tools in BIN, into OUT.

Every command is printed as it is run in OUT. --own "VESSEL [DEPOSITS] KEY=VALUE ..." takes a vessel of your own into the
angioplasty, see angioplasty/own.py.
"""
import argparse
import json
import math
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import h5py
import numpy as np

HERE = Path(__file__).resolve().parent


class Folder:
    def __init__(self, given):
        self.source, self.threads, self.own = HERE / given.name, given.threads, shlex.split(given.own)
        self.tools, self.out = Path(given.tools).resolve(), Path(given.out).resolve()
        self.out.mkdir(parents=True, exist_ok=True)
        if self.own:
            self.python(self.source / "own.py", ".", *self.own)
            return
        for scene in self.source.glob("*.toml"):
            shutil.copy(scene, self.out)
        self.python(self.source / "mesh.py", ".")

    def run(self, command):
        print(shlex.join(str(word).replace(str(HERE), "examples/scenes") for word in command), flush=True)
        done = subprocess.run([str(word) for word in command], cwd=self.out, check=False)
        if done.returncode != 0:
            sys.exit(done.returncode)

    def python(self, *words):
        self.run(["/usr/bin/python3", "-B", *words])

    def simulate(self, scene="scene", picture=()):
        """@param picture  what moments.png shows"""
        drawn = ["--picture", "moments.png", "--colour", "stress", *picture] if picture else []
        threads = ["--threads", self.threads] if self.threads else []
        self.run([self.tools / "tunica-simulate", "--scene", f"{scene}.toml", f"{scene}.hdf", "--export", "pvd", "--report",
                  f"{scene}.json", *drawn, "--quiet", "--force", *threads])
        return json.loads((self.out / f"{scene}.json").read_text(encoding="utf-8"))["result"]

    def chart(self, series, *words):
        """@param series  {name: (x, y)}, each written as a report of its own"""
        for name, (x, y) in series.items():
            report = {"tool": "tunica-simulate", "ok": True, "seconds": {}, "result": {"x": list(x), "y": list(y)}}
            (self.out / f"{name}.json").write_text(json.dumps(report), encoding="utf-8")
        self.run([self.tools / "tunica-chart", *(f"{name}.json" for name in series), "-o", "curve.svg", "--csv", "curve.csv",
                  "--x", "result.x", "--y", "result.y", "--series", "file", "--lines", "--force", "--quiet",
                  "--x-scale", "linear", "--y-scale", "linear", *words])


def depth_and_force(result, touch):
    """Of the tool, which touches where its centre is at z = `touch` mm: mm below that, N."""
    tool = result["rigid"]["tool"]
    return [touch - p[2] for p in tool["position_mm"]], [f[2] if f else 0.0 for f in tool["force_n"]]


def membrane(folder):
    result = folder.simulate(picture=["--picture-at", "0 0.25 0.5 1", "--picture-cut=-y"])
    depth, force = depth_and_force(result, 5.5)
    deepest = int(np.argmax(depth))
    folder.chart({"pushed-in": (depth[:deepest + 1], force[:deepest + 1]), "drawn-back": (depth[deepest:], force[deepest:])},
                 "--title", "A membrane under a ball", "--x-label", "depth, mm", "--y-label", "force on the tool, N")
    gaps = result["contacts"]["tool-membrane"]["smallest_gap_mm"]
    half = float(np.interp(4, depth[:deepest + 1], force[:deepest + 1]))
    print(f"force at 4 mm: {half:.3f} N, at 8 mm: {force[deepest]:.3f} N, at the end: {abs(force[-1]):.1e} N; smallest gap: "
          f"{1000 * min(gap['lower'] for gap in gaps):.2f} um; balance of forces: {result['balance']['force']:.1e}")


def liver(folder):
    bare, covered = folder.simulate("bare"), folder.simulate(picture=["--picture-at", "0 0.25 0.5 1", "--picture-cut=-y"])
    curves = {}
    for name, result in (("with-capsule", covered), ("without", bare)):
        depth, force = depth_and_force(result, 35)
        deepest = int(np.argmax(depth)) + 1
        curves[name] = depth[:deepest], force[:deepest]
    folder.chart(curves, "--title", "A liver with and without its capsule", "--x-label", "depth, mm", "--y-label",
                 "force on the tool, N")
    for at in (4, 6, 8):
        with_it, without = (float(np.interp(at, *curves[name])) for name in ("with-capsule", "without"))
        print(f"force at {at} mm: {with_it:.3f} N with the capsule, {without:.3f} N without: {100 * (with_it / without - 1):+.0f} %")
    print(f"balance of forces: {covered['balance']['force']:.1e} with, {bare['balance']['force']:.1e} without")


def lengths(quantities):
    """mm, of what a scene says."""
    units = {"um": 1e-3, "mm": 1, "cm": 10, "m": 1000}
    parts = [re.fullmatch(r"\s*([-+0-9.eE]+?)\s*(um|mm|cm|m)\s*", text).groups() for text in quantities]
    return np.array([float(number) * units[unit] for number, unit in parts])


def drawn_surfaces(path):
    """What OUT.page draws (docs/results.md). @return [load factor, corners of the shells' triangles, of the solids' faces]"""
    header, _, numbers = path.read_bytes().partition(b"\n")
    count, at = json.loads(header), 0

    def take(kind, rows, columns=3):
        nonlocal at
        values = np.frombuffer(numbers, kind, rows * columns, at).reshape(rows, columns)
        at += values.nbytes
        return values

    shells, triangles = take("<f4", count["points"]), take("<u4", count["triangles"])
    solids, faces = take("<f4", count["solid_points"]), take("<u4", count["solid_triangles"])
    states = []
    for _, _, factor in count["states"]:
        moved = shells + take("<f4", count["points"])
        take("<f4", 2 * count["points"], 1)
        states.append((factor, moved[triangles].astype(float), (solids + take("<f4", count["solid_points"]))[faces].astype(float)))
    return states


def first_hit(triangles, point, direction):
    """How far a ray goes to the first triangle, mm; inf where it meets none (Moeller and Trumbore 1997)."""
    a, b, c = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    across = np.cross(direction, c)
    size = np.sum(b * across, axis=1)
    from_a = point - a
    turned = np.cross(from_a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v, distance = np.sum(from_a * across, axis=1) / size, turned @ direction / size, np.sum(c * turned, axis=1) / size
        hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (distance > 0)
    return distance[hit].min(initial=np.inf)


def radii_about(triangles, middle, axis, stations, directions):
    """Mean distance of the first triangles from an axis; inf where one direction meets none."""
    heights = (triangles - middle) @ axis

    def radius(station):
        near = triangles[(heights.min(axis=1) <= station) & (heights.max(axis=1) >= station)]
        return np.mean([first_hit(near, middle + station * axis, direction) for direction in directions])

    return np.array([radius(station) for station in stations])


def lumen(folder, balloon, wall, places):
    """Along the balloon's axis, mean over 36 directions, at the states nearest to the load factors.
    @return {name: (mm from the balloon's middle, radius of the lumen)}, {name: radius of the wall's middle surface}
    """
    start, end = lengths(balloon["from"]), lengths(balloon["to"])
    half, largest = np.linalg.norm(end - start) / 2, max(lengths([radius])[0] for _, radius in balloon["radius"])
    axis = (end - start) / (2 * half)
    stations = np.linspace(-4 / 3, 4 / 3, 57) * (half + largest)
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    angles = 2 * np.pi * (np.arange(36) + 0.5) / 36
    directions = np.outer(np.cos(angles), side) + np.outer(np.sin(angles), np.cross(axis, side))
    states = drawn_surfaces(folder.out / "scene.page")
    curves, middle = {}, {}
    for name, place in places.items():
        _, shells, deposits = min(states, key=lambda state: abs(state[0] - place))
        walls, inner = (radii_about(surface, (start + end) / 2, axis, stations, directions) for surface in (shells, deposits))
        seen = np.isfinite(walls)
        curves[name] = stations[seen], np.minimum(walls - wall / 2, inner)[seen]
        middle[name] = walls[seen]
    return curves, middle


def lengthwise(balloon):
    """Flags of a picture that is cut along the balloon, which lies across it."""
    start, end = lengths(balloon["from"]), lengths(balloon["to"])
    cut = 1 if np.argmax(np.abs(end - start)) != 1 else 2
    return ["--picture-at", "0 0.2 0.5 1", "--picture-cut=-%s=%.6gmm" % ("xyz"[cut], (start + end)[cut] / 2)]


def angioplasty(folder):
    scene = tomllib.loads((folder.out / "scene.toml").read_text(encoding="utf-8"))
    balloon, wall = scene["rigid"][0], lengths([scene["shell"][0]["thickness"]])[0]
    result = folder.simulate(picture=lengthwise(balloon))
    curves, middle = lumen(folder, balloon, wall, {"before": 0.2, "inflated": 0.5, "after": 1.0})
    folder.chart(curves, "--title", "The lumen along the vessel", "--x-label", "along the axis, mm", "--y-label",
                 "radius of the lumen, mm")
    for name, (stations, radius) in curves.items():
        print(f"{name}: radius of the lumen in the middle of the balloon {np.interp(0, stations, radius):.2f} mm, of the wall's middle "
              f"surface there {np.interp(0, stations, middle[name]):.2f} mm")
    say_inflated(folder, result)


def say_inflated(folder, result):
    """What presses on what where the balloon is largest."""
    with h5py.File(folder.out / "scene.hdf") as file:
        state = int(np.argmin(np.abs(file["tunica/history/load_factor"][:] - 0.5)))
        print(f"inflated: 99 % of the wall stay below {1000 * file['tunica/history/stress_p99'][state]:.0f} kPa")
        if "tetrahedra" in file["tunica"]:
            pressure = file["tunica/tetrahedra/solid_pressure"][state]
            print(f"inflated: the mean pressure in the deposit is {1000 * np.mean(pressure):.1f} kPa")
        for name, contact in file["tunica/contacts"].items():
            if contact["area"][state] > 0:
                force = ", ".join("%.2g" % (1000 * f) for f in contact["force"][state])
                print(f"inflated: {name} presses on {contact['area'][state]:.0f} mm2 (of the reference), its forces sum up to "
                      f"({force}) mN, smallest gap {1000 * contact['smallest_gap'][state][0]:.1f} um")
    print(f"balance of forces {result['balance']['force']:.1e}")


def lens(folder):
    result = folder.simulate(picture=["--picture-at", "0 0.25 0.5 1"])
    probe = result["probes"]["rim"]
    angle = [math.degrees(np.linalg.norm(r)) for r in probe["rotation_rad"]]
    moment = [2.2 * 2 * min(f, 1 - f) for f in probe["load_factor"]]
    top = int(np.argmax(moment)) + 1
    folder.chart({"folded": (moment[:top], angle[:top]), "let-go": (moment[top - 1:], angle[top - 1:])}, "--title",
                 "A lens, folded and let go", "--x-label", "moment on each wing, N um", "--y-label", "turn of the rim, degrees")
    print(f"the rims turn by {max(angle):.1f} degrees, each to its side, and are {np.linalg.norm(probe['displacement_mm'][-1]):.1e} mm "
          "from their places at the end")


def main():
    scenes = {"membrane": membrane, "liver": liver, "angioplasty": angioplasty, "lens": lens}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=scenes)
    parser.add_argument("tools", metavar="BIN")
    parser.add_argument("out", metavar="OUT")
    parser.add_argument("--threads", default="")
    parser.add_argument("--own", default="")
    given = parser.parse_args()
    if given.own and given.name != "angioplasty":
        parser.error(f"--own: {given.name} has no vessel")
    scenes[given.name](Folder(given))
    print(f"in {given.out}: scene.hdf, scene.json, moments.png, curve.svg, curve.csv")


if __name__ == "__main__":
    main()
