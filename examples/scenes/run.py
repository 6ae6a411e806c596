#!/usr/bin/python3
"""run.py NAME BIN OUT [THREADS]: meshes, result, pictures and curve of the scene NAME, made by the tools in BIN, into OUT.

Every command is printed as it is run in OUT.
"""
import json
import math
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np

HERE = Path(__file__).resolve().parent


class Folder:
    def __init__(self, name, tools, out, threads):
        self.source, self.tools, self.out, self.threads = HERE / name, tools, out, threads
        out.mkdir(parents=True, exist_ok=True)
        for scene in self.source.glob("*.toml"):
            shutil.copy(scene, out)
        self.python(self.source / "mesh.py", ".")

    def run(self, command):
        print(shlex.join(str(word).replace(str(HERE), "examples/scenes") for word in command), flush=True)
        done = subprocess.run([str(word) for word in command], cwd=self.out, check=False)
        if done.returncode != 0:
            sys.exit(done.returncode)

    def python(self, *words):
        self.run(["/usr/bin/python3", "-B", *words])

    def simulate(self, scene="scene"):
        threads = ["--threads", self.threads] if self.threads else []
        self.run([self.tools / "tunica-simulate", "--scene", f"{scene}.toml", f"{scene}.hdf", "--export", "pvd", "--report",
                  f"{scene}.json", "--quiet", "--force", *threads])
        return json.loads((self.out / f"{scene}.json").read_text(encoding="utf-8"))["result"]

    def draw(self, *words):
        self.python(HERE / "draw.py", "scene.hdf", "moments.png", *words)

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
    result = folder.simulate()
    folder.draw("--at", 0, 0.25, 0.5, 1, "--cut", "y")
    depth, force = depth_and_force(result, 5.5)
    deepest = int(np.argmax(depth))
    folder.chart({"pushed-in": (depth[:deepest + 1], force[:deepest + 1]), "drawn-back": (depth[deepest:], force[deepest:])},
                 "--title", "A membrane under a ball", "--x-label", "depth, mm", "--y-label", "force on the tool, N")
    gaps = result["contacts"]["tool-membrane"]["smallest_gap_mm"]
    half = float(np.interp(4, depth[:deepest + 1], force[:deepest + 1]))
    print(f"force at 4 mm: {half:.3f} N, at 8 mm: {force[deepest]:.3f} N, at the end: {abs(force[-1]):.1e} N; smallest gap: "
          f"{1000 * min(gap['lower'] for gap in gaps):.2f} um; balance of forces: {result['balance']['force']:.1e}")


def liver(folder):
    bare, covered = folder.simulate("bare"), folder.simulate()
    folder.draw("--at", 0, 0.25, 0.5, 1, "--cut", "y")
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


def lumen(path, places):
    """Radius of the lumen along z at the states nearest to the load factors: {name: (z, radius)}; and of the wall's middle."""
    with h5py.File(path) as file:
        factors = file["tunica/history/load_factor"][:]
        rest, moved = file["tunica/nodes/position"][:], file["tunica/nodes/displacement"][:]
        wall = np.unique(file["tunica/elements/nodes"][:])
        deposit = np.unique(file["tunica/tetrahedra/nodes"][:])
    stations = np.linspace(-14, 14, 57)
    curves, middle = {}, {}
    for name, place in places.items():
        now = rest + moved[int(np.argmin(np.abs(factors - place)))]
        radius = np.hypot(now[:, 0], now[:, 1])

        def along(nodes, of, smallest):
            rings = np.unique(rest[nodes, 2].round(6))
            some = [nodes[np.abs(rest[nodes, 2] - z) < 1e-5] for z in rings]
            mean = [np.sort(of[s])[:len(s) // smallest].mean() for s in some]
            return np.interp(stations, [now[s, 2].mean() for s in some], mean, left=np.inf, right=np.inf)

        middle[name] = along(wall, radius, 1)
        inner = along(deposit, radius, 3)  # the innermost of three layers
        curves[name] = stations, np.minimum(middle[name] - 0.5, inner)
    return curves, middle


def angioplasty(folder):
    result = folder.simulate()
    folder.draw("--at", 0, 0.2, 0.5, 1, "--cut", "y", "--up", 1, 0, 0, "--view", 0.25, 1, 0.35)
    curves, middle = lumen(folder.out / "scene.hdf", {"before": 0.2, "inflated": 0.5, "after": 1.0})
    folder.chart(curves, "--title", "The lumen along the vessel", "--x-label", "along the axis, mm", "--y-label",
                 "radius of the lumen, mm")
    for name, (stations, radius) in curves.items():
        centre = len(stations) // 2
        print(f"{name}: radius of the lumen in the middle {radius[centre]:.2f} mm, of the wall's middle surface there "
              f"{middle[name][centre]:.2f} mm")
    with h5py.File(folder.out / "scene.hdf") as file:
        state = int(np.argmin(np.abs(file["tunica/history/load_factor"][:] - 0.5)))
        pressure = file["tunica/tetrahedra/solid_pressure"][state]
        stress = file["tunica/history/stress_p99"][state]
        area = file["tunica/contacts/balloon-deposit/area"][state]
        gap = file["tunica/contacts/balloon-deposit/smallest_gap"][state]
    print(f"inflated: the balloon presses on {area:.0f} mm2 (of the reference), the mean pressure in the deposit is "
          f"{1000 * np.mean(pressure):.1f} kPa, 99 % of the wall stay below {1000 * stress:.0f} kPa, smallest gap {1000 * gap[0]:.1f} um; "
          f"balance of forces {result['balance']['force']:.1e}")


def lens(folder):
    result = folder.simulate()
    folder.draw("--at", 0, 0.25, 0.5, 1, "--view", 0.5, -1, 0.6)
    probe = result["probes"]["rim"]
    angle = [math.degrees(np.linalg.norm(r)) for r in probe["rotation_rad"]]
    moment = [2.2 * 2 * min(f, 1 - f) for f in probe["load_factor"]]
    top = int(np.argmax(moment)) + 1
    folder.chart({"folded": (moment[:top], angle[:top]), "let-go": (moment[top - 1:], angle[top - 1:])}, "--title",
                 "A lens, folded and let go", "--x-label", "moment on each wing, N um", "--y-label", "turn of the rim, degrees")
    print(f"the rims turn by {max(angle):.1f} degrees, each to its side, and are {np.linalg.norm(probe['displacement_mm'][-1]):.1e} mm "
          "from their places at the end")


if __name__ == "__main__":
    scenes = {"membrane": membrane, "liver": liver, "angioplasty": angioplasty, "lens": lens}
    if len(sys.argv) not in (4, 5) or sys.argv[1] not in scenes:
        sys.exit(f"{__doc__}NAME is one of: {', '.join(scenes)}")
    target = Path(sys.argv[3]).resolve()
    scenes[sys.argv[1]](Folder(sys.argv[1], Path(sys.argv[2]).resolve(), target, sys.argv[4] if len(sys.argv) > 4 else ""))
    print(f"in {sys.argv[3]}: scene.hdf, scene.json, moments.png, curve.svg, curve.csv")
