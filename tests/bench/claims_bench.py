#!/usr/bin/python3
"""What `tunica-simulate --accuracy` claims against the truth, as a table.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/bench/claims_bench.py [--data FOLDER] [--only WORD,WORD]
        [--truth 51200] [--out docs/tables/claims.md] [--json claims.json]

Bodies and loads are those of load_bench.py, and published benchmarks. The run starts from 190 well-shaped shells; the
truth comes from another decimation, to 800 triangles, split in four and refitted up to the number given, and once before:
by how much these two differ is told; where that is more than a fifth of what is asked, nothing is decided. The truth of a benchmark is its published limit. One thread; the careful fixed
setting beside which the time of a claim stands is 12,800 shells, refitted, and ten load steps.
"""
import argparse
import json
import math
import statistics
import sys
import tempfile
from pathlib import Path

import load_bench
import numpy as np
from load_bench import LOAD, bodies
from meshes import geodesic
from published import LINEAR, grid, load, probe, run_lines, shell, write_ply
from running import measure

ASKED = {"displacement": (5, 2, 1), "energy": (5, 2, 1), "volume": (5, 2, 1), "membrane": (5, 2), "stress": (5,)}
CAREFUL = 12_800
HEADER = """| body | wall, mm | of | asked, % | shells | model | Newton | estimate, % | true error, % | truth known to, % | seconds | careful, seconds |
|---|---|---|---|---|---|---|---|---|---|---|---|"""


def run(verb, *words):
    """@return the report, also of a run that failed, and seconds"""
    done = measure(verb, *words, code=(0, 4))
    return done.report, done.seconds


def answers(result):
    volume = None
    if result["volume_before_mm3"] is not None:
        volume = result["volume_after_mm3"] - result["volume_before_mm3"]
    return {"displacement": result["max_displacement_mm"], "energy": result["strain_energy_mj"], "volume": volume,
            "membrane": result["wall"]["membrane_p99_mpa"], "stress": result["wall"]["stress_p99_mpa"]}


class Organ:
    """A surface under 1 kPa, with its coarsest level and its truth."""

    def __init__(self, body, walls, finest):
        self.name, self.walls, self.body = body.name, walls, body
        start, other = body.folder / "start.ply", body.folder / "other.ply"
        run("decimate", body.surface, start, "--triangles", 190, "--min-angle", 20)
        run("decimate", body.surface, other, "--triangles", 800, "--min-angle", 20)
        self.coarsest = body.folder / "coarsest.ply"
        report, self.start = run("relax", start, body.surface, self.coarsest, "--shells", 190, "--max-iterations", 4)
        self.fix = "boundary" if report["result"]["boundary_percent"] is not None else "rigid-motions"
        self.fine, self.seconds = [], {}
        for count in sorted({CAREFUL, finest // 4, finest}):
            self.fine.append(body.folder / f"{count}.ply")
            _, self.seconds[count] = run("relax", other, body.surface, self.fine[-1], "--refine", "--max-shells", count)

    def solve(self, mesh, wall, *options):
        return run("simulate", mesh, self.body.folder / "result.hdf", *LOAD, "--thickness", f"{wall}mm", "--fix", self.fix,
                   *options)

    def cases(self):
        """@return wall, quantity, per cent asked, truth, how well it is known (%), seconds of the careful setting, run"""
        for wall in self.walls:
            _, careful = self.solve(self.fine[0], wall, "--load-steps", 10)
            before, truth = (answers(self.solve(mesh, wall)[0]["result"]) for mesh in self.fine[-2:])
            for of, requests in ASKED.items():
                for asked in requests if truth[of] is not None else ():
                    known = 100 * abs(before[of] / truth[of] - 1)
                    yield (wall, of, asked, truth[of], known, careful + self.seconds[CAREFUL],
                           lambda asked=asked, of=of, wall=wall: self.chain(asked, of, wall))

    def chain(self, asked, of, wall):
        report, seconds = self.solve(self.coarsest, wall, "--accuracy", f"{asked}%", "--of", of, "--target",
                                     self.body.surface)
        return report, seconds + self.start


class Benchmark:
    """A published problem on an analytic surface, the target a fine mesh of it."""

    def __init__(self, folder, name, make, scene, of, truth):
        self.name, self.folder, self.scene, self.of, self.truth = name, folder, scene, of, truth
        write_ply(folder / "mesh.ply", *make(8))
        write_ply(folder / "target.ply", *make(256)[:2])

    def cases(self):
        for asked in (5, 2, 1):
            text = f"{self.scene}[accuracy]\nwithin = \"{asked}%\"\nof = {self.of}\ntarget = {{s = \"target.ply\"}}\n"
            of = "probe" if "probe" in self.of else json.loads(self.of)
            yield None, of, asked, self.truth, None, None, lambda text=text: self.solve(text)

    def solve(self, text):
        path = self.folder / "scene.toml"
        path.write_text(text, encoding="utf-8")
        return run("simulate", "--scene", path, self.folder / "result.hdf")


def fix(where, translation, rotation):
    return (f"[[fix]]\nbody = \"s\"\nwhere = {{{where}}}\ntranslation = \"{translation}\"\nrotation = \"{rotation}\"\n")


def plane(side, axis, at):
    return f"{side} = {{axis = \"{axis}\", at = \"{at}mm\"}}"


def force(point, value):
    return load("force", value, "N", None, f"where = {{nearest = {json.dumps([f'{x}mm' for x in point])}}}\n")


def benchmarks(folder, wanted):
    def add(name, make, scene, of, truth):
        if wanted(name):
            place = folder / name.replace(" ", "-")
            place.mkdir(exist_ok=True)
            yield Benchmark(place, name, make, scene, of, truth)

    half, at_z = math.radians(40), '{probe = "p", axis = "z"}'
    yield from add(
        "Scordelis-Lo roof", lambda n: grid(n, n, lambda u, v: (25 * u, 25 * np.sin(half * v), 25 * np.cos(half * v)),
                                  lambda p, u, v: (0, p[:, 1], p[:, 2])),
        LINEAR + shell("mesh.ply", 0.25, 4.32e8, 0.0) + fix(plane("above", "x", 25), "yz", "x") +
        fix(plane("below", "x", 0), "x", "yz") + fix(plane("below", "y", 0), "y", "xz") +
        load("area", (0.0, 0.0, -90.0), "MPa") + probe("p", (0.0, 25 * math.sin(half), 25 * math.cos(half))), at_z, -0.3006)
    yield from add(
        "pinched cylinder", lambda n: grid(n, n, lambda u, v: (300 * u, 300 * np.sin(math.pi / 2 * v), 300 * np.cos(math.pi / 2 * v)),
                                 lambda p, u, v: (0, p[:, 1], p[:, 2])),
        LINEAR + shell("mesh.ply", 3, 3e6, 0.3) + fix(plane("above", "x", 300), "yz", "x") +
        fix(plane("below", "x", 0), "x", "yz") + fix(plane("below", "y", 0), "y", "xz") +
        fix(plane("below", "z", 0), "z", "xy") + force((0, 0, 300), (0.0, 0.0, -0.25)) + probe("p", (0.0, 0.0, 300.0)),
        at_z, -1.8248e-5 * 1.003)

    def hemisphere(u, v):
        latitude, longitude = math.radians(72) * v, math.pi / 2 * u
        return (10 * np.cos(latitude) * np.cos(longitude), 10 * np.cos(latitude) * np.sin(longitude), 10 * np.sin(latitude))

    yield from add(
        "pinched hemisphere", lambda n: grid(n, n, hemisphere, lambda p, u, v: (p[:, 0], p[:, 1], p[:, 2])),
        LINEAR + shell("mesh.ply", 0.04, 6.825e7, 0.3) + fix(plane("below", "y", 0), "y", "xz") +
        fix(plane("below", "x", 0), "x", "yz") + fix('nearest = ["10mm", "0mm", "0mm"]', "z", "") +
        force((10, 0, 0), (1.0, 0.0, 0.0)) + force((0, 10, 0), (0.0, -1.0, 0.0)) + probe("p", (10.0, 0.0, 0.0)),
        '{probe = "p", axis = "x"}', 0.0940 * 0.9945)

    def sphere(n):
        points, triangles = geodesic(n // 2)
        return 10 * points, triangles, points

    yield from add(
        "geodesic sphere", sphere,
        run_lines(kind="static") + shell("mesh.ply", 0.1, 1.0, 0.3) + "[[fix]]\nbody = \"s\"\nwhere = {rigid_motions = true}\n" +
        load("pressure", "1Pa"), '"displacement"', 1e-6 * 100 * 0.7 / (2 * 0.1))


def row(name, case, ratios, verdicts, times):
    """@return the line of the table, and what was measured"""
    wall, of, asked, truth, known, careful, solve = case
    report, seconds = solve()
    claim = report["result"]["accuracy"]
    error = 100 * abs(claim["value"] / truth - 1)
    is_known = known is None or known <= asked / 5
    verdict = "refused" if not report["ok"] else "undecided" if not is_known else "right" if error <= asked else "wrong"
    verdicts.setdefault(of, []).append(verdict)
    estimate = claim["estimate_percent"]
    if verdict in ("right", "wrong"):
        ratios.setdefault(of, []).append(estimate / error)
        if careful:
            times.append(seconds / careful)
    model = next((choice["chosen"] for choice in claim["choices"] if choice["part"] == "model"), "")
    newton = " ".join(str(level["newton_iterations"]) for level in claim["levels"])
    cells = [name, "" if wall is None else f"{wall:g}", of, asked,
             f"{claim['levels'][-1]['shells']:,}" + (" (refused)" if verdict == "refused" else ""), model, newton,
             "" if estimate is None else f"{estimate:.2f}", f"**{error:.2f}**" if verdict == "wrong" else f"{error:.2f}",
             "published" if known is None else f"{known:.2f}", f"{seconds:.1f}", f"{careful:.1f}" if careful else ""]
    return "| " + " | ".join(map(str, cells)) + " |", {"name": name, "wall": wall, "of": of, "asked": asked, "truth": truth,
                                                       "known": known, "seconds": seconds, "careful": careful,
                                                       "claim": claim}


def told(ratios, verdicts, times):
    lines = []
    for of, found in verdicts.items():
        some = ratios.get(of)
        spread = f"; estimate over true error {statistics.median(some):.1f} in the median, {min(some):.2f} at least" if some else ""
        counts = ", ".join(f"{found.count(verdict)} {verdict}" for verdict in ("right", "wrong", "refused", "undecided"))
        lines.append(f"{of}: {counts}{spread}.")
    if times:
        lines.append(f"Time over that of the careful setting: {statistics.median(times):.2f} in the median, {max(times):.2f} at most.")
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--truth", type=int, default=51_200)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--json", type=Path, help="all claims with their levels")
    given = parser.parse_args()
    load_bench.PHANTOMS["colon"] = (3, 1)
    words = given.only.split(",")
    lines, measured, ratios, verdicts, times = [HEADER], [], {}, {}, []

    def wanted(name):
        return any(word in name for word in words)

    with tempfile.TemporaryDirectory() as folder:
        problems = list(benchmarks(Path(folder), wanted))
        organs = (Organ(body, walls, given.truth) for body, walls in bodies(Path(folder), given.data, wanted))
        for part in (problems, organs):
            for problem in part:
                for case in problem.cases():
                    line, found = row(problem.name, case, ratios, verdicts, times)
                    lines.append(line)
                    measured.append(found)
                    print(line, flush=True)
    summary = "\n".join(f"* {line}" for line in told(ratios, verdicts, times))
    print(summary, file=sys.stderr)
    if given.json:
        given.json.write_text(json.dumps(measured, indent=1), encoding="utf-8")
    if given.out:
        given.out.write_text(f"1 kPa on 1 MPa; the truth by {given.truth:,} shells of another decimation, or published.\n\n"
                             f"{summary}\n\n" + "\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
