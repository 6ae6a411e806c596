#!/usr/bin/python3
"""How exact contact is, against known answers, and what it costs: steps of 40 ms of a clamped disc under pressure, free,
with a ball that slides over it, and with one at rest.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/bench/contact_bench.py
"""
import tempfile

import numpy as np
from contact_scenes import RING, SPHERE, contact, ring, sphere, tube
from contact_scenes_more import plate_on_a_flat
from meshes import disc
from published import Bench, fix, grid, run_lines, shell, write_ply

PLATE = 0.13146  # force on the flat over the load, at twice the load of first touch; plate theory
BALL = ('[[rigid]]\nname = "ball"\nshape = "sphere"\ncentre = ["-2mm", "0mm", "6mm"]\nradius = "5mm"\nmotion = [["0s", '
        '["0mm", "0mm", "0mm"]], ["1s", ["0mm", "0mm", "-1.5mm"]], ["3s", ["{way}mm", "0mm", "-1.5mm"]]]\n')


def exactness(bench):
    print("| checked against | resolution | error, % |\n|---|---|---|")
    for resolution in ("5%", "1%", "0.1%"):
        cases = [(f"ring, flattened by {100 * d:.0f} %", ring(bench, d, resolution)[0] / answer) for d, answer in RING.items()]
        cases += [(f"sphere, {d} walls deep", sphere(bench, d, resolution=resolution)[0] / answer)
                  for d, answer in SPHERE.items()]
        cases.append(("tube on a rigid cylinder", tube(bench, resolution)[0]))
        cases.append(("plate a tenth of a wall above a flat, force", plate_on_a_flat(bench, 2, 0.1, resolution, rim="z")[1] / PLATE))
        for name, ratio in cases:
            print(f"| {name} | {resolution} | {100 * (ratio - 1):.2f} |", flush=True)


def cost(bench):
    print("\n| shells | ball | points | ms per step, median | longest | Newton |\n|---|---|---|---|---|---|")
    for rings in (13, 41):
        points, triangles = disc(rings, 20.0)
        write_ply(bench.path("mesh.ply"), points, triangles, np.tile([0, 0, 1.0], (len(points), 1)))
        scene = (shell("mesh.ply", 1.0, 1.0, 0.45, density="1100kg/m3") +
                 fix(np.flatnonzero(np.hypot(*points.T[:2]) > 20 - 1e-6)) +
                 '[[load]]\nbody = "s"\nkind = "pressure"\nvalue = "1kPa"\nramp = [["0s", 0.0], ["1s", 1.0]]\n')
        for name, way, duration in (("none, the disc moves", None, "1s"), ("none, at rest", None, "3s"), ("slides", 8, "3s"),
                                    ("rests", 0, "3s")):
            more = "" if way is None else BALL.format(way=way) + contact("s", "ball")
            result = bench.run(run_lines(kind="dynamic", duration=duration, step="40ms") + scene + more)
            median, longest = (result["ms_per_step"][key] for key in ("median", "max"))
            touching = result["contacts"]["c"]["points"][-1] if way is not None else 0
            print(f"| {result['shells']} | {name} | {touching} | {median:.0f} | {longest:.0f} "
                  f"| {result['newton_iterations']} |", flush=True)


def candidates(bench):
    """Two held plates apart from each other, at rest: what it takes to find that nothing is near."""
    print("\n| triangles of both plates | ms per step, contact | without |\n|---|---|---|")
    for cells in (16, 50, 158):
        points, triangles, _ = grid(cells, cells, lambda u, v: (100 * u, 100 * v, 0 * u))
        scene, rim = run_lines(kind="dynamic", duration="0.2s", step="40ms"), range(len(points))
        for name, height in (("s", 0.0), ("t", 12.0)):
            write_ply(bench.path(name + ".ply"), points + [0, 0, height], triangles, np.tile([0, 0, 1.0], (len(points), 1)))
            scene += (shell(name + ".ply", 1.0, 1.0, 0.45, density="1100kg/m3") + fix(rim)).replace('"s"', f'"{name}"')
        scene += '[[load]]\nbody = "s"\nkind = "pressure"\nvalue = "1Pa"\n'
        times = [bench.run(scene + more)["ms_per_step"]["median"] for more in (contact("s", "t"), "")]
        print(f"| {4 * cells**2} | {times[0]:.1f} | {times[1]:.1f} |", flush=True)


def main():
    with tempfile.TemporaryDirectory() as folder:
        exactness(Bench(folder))
        cost(Bench(folder))
        candidates(Bench(folder))


if __name__ == "__main__":
    main()
