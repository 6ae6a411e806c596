#!/usr/bin/python3
"""Decimation against CGAL's Garland-Heckbert planes at the same counts, as a table; triangles for a certified error.

    cmake --build --preset release --target bench_decimate
    PYTHONPATH=tests/support tests/bench/decimate_bench.py build/release [--targets SCRIPT] [--paper FOLDER] [--out docs/tables/decimation.md]

Targets: shapes.py beside this file; SCRIPT, which writes aneurysm_tube.ply, liver_like.ply and bumpy.ply into its working
folder; the paper's meshes (FOLDER). What is not given is left out. Times are the processor's, on one thread, in turns.
"""
import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import shapes
from running import run_tool

ANGLE = 20
INTRODUCTION = f"""Two-sided certified errors in % of the target's diagonal, processor time of one thread in turns, each with its ratio to that of
CGAL's Garland-Heckbert planes; the last three columns: `--min-angle {ANGLE}`.

| target | to triangles | error, % | over CGAL's | ms | CGAL / tunica | error, % | smallest angle | mean quality |
|---|---|---|---|---|---|---|---|---|"""


def targets(folder, script, paper):
    """@return name, file, counts, and whether angles and errors are asked for as well"""
    yield "wavy cap", shapes.written(folder, "wavy_cap"), (200,), True
    yield "twisted ribbon", shapes.written(folder, "ribbon"), (100,), True
    yield "capped cylinder", shapes.written(folder, "closed_cylinder"), (138,), True
    yield "kidney", shapes.written(folder, "kidney"), (300, 3000), True
    if script:
        subprocess.run([sys.executable, Path(script).resolve()], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        yield "open tube with a bulge", folder / "aneurysm_tube.ply", (300, 1200), True
        yield "open tube with a bulge", folder / "aneurysm_tube.ply", (14000, 24000), False
        yield "smooth liver", folder / "liver_like.ply", (300, 2400), True
        yield "bumpy ball", folder / "bumpy.ply", (10000, 300000), False
    if paper:
        yield "the paper's liver", Path(paper) / "liverHighRes.obj", (300, 1200), True
        yield "the paper's aneurysm", Path(paper) / "aneurysmHighRes.obj", (200, 772), True


def rows(build, name, path, counts, is_small):
    for count in counts:
        told = subprocess.run([os.path.join(build, "tests/bench/bench_decimate"), f"{path}:{count}",
                               *(("--angle", str(ANGLE)) if is_small else ("--rounds", "1"))],
                              check=True, capture_output=True, text=True).stdout
        size = int(re.search(r"(\d+) triangles to", told)[1])
        lines = {line.split()[0]: line.split() for line in told.splitlines()[1:]}
        own, shaped = lines["tunica"], lines.get("shaped")
        error, speed = re.search(r"error ([\d.]+) x CGAL's, speed ([\d.]+) x", told).groups()
        yield "| " + " | ".join([f"{name}, {size:,}", f"{count:,}", f"{float(own[3]):.3g}", f"{float(error):.2f}",
                                 f"{float(own[-2]):.3g}", speed,
                                 *([f"{float(shaped[3]):.3g}", f"{float(shaped[5]):.1f}°", shaped[7]] if shaped
                                   else ["", "", ""])]) + " |"


def triangles_within(path, percent):
    with tempfile.TemporaryDirectory() as folder:
        return run_tool("decimate", path, Path(folder, "out.ply"), "--max-error", f"{percent}%").report["result"]["triangles"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build")
    parser.add_argument("--targets")
    parser.add_argument("--paper")
    parser.add_argument("--out")
    options = parser.parse_args()
    lines, within = [INTRODUCTION], []
    with tempfile.TemporaryDirectory() as folder:
        for name, path, counts, is_small in targets(Path(folder), options.targets, options.paper):
            for line in rows(options.build, name, path, counts, is_small):
                lines.append(line)
                print(line, flush=True)
            if is_small:
                numbers = [f"{triangles_within(path, percent):,}" for percent in (1, 0.5, 0.1)]
                within.append(f"| {name} | {' | '.join(numbers)} |")
                print(within[-1], flush=True)
    lines += ["", "Triangles for a certified error of at most that part of the diagonal (`--max-error`):", "",
              "| target | 1 % | 0.5 % | 0.1 % |", "|---|---|---|---|", *within]
    if options.out:
        Path(options.out).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
