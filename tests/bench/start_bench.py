#!/usr/bin/python3
"""What a small run pays before and beside its work, as tables: start-up of 1,000 shells under pressure (medians, one
thread), and seconds per stage of the chain over a small organ.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/bench/start_bench.py [--out docs/tables/start.md]
"""
import argparse
import statistics
import tempfile
from pathlib import Path

from running import measure

REPEATED = 15
MATERIAL = ("--young", "1MPa", "--poisson", "0.45", "--thickness", "1.5mm", "--pressure", "1kPa", "--fix", "rigid-motions")
BARS = (60, 60)  # ms, MiB


def chain(folder):
    """@return stages of every tool"""
    measure("phantom", "bladder", "volume.nii.gz", "--size", 64, folder=folder)
    steps = (("extract", "volume.nii.gz", "surface.ply", "--label", 1, "--smooth", "staircase"),
             ("decimate", "surface.ply", "coarse.ply", "--triangles", 1000),
             ("relax", "coarse.ply", "surface.ply", "shell.ply", "--refine", "--tolerance", "1%"),
             ("simulate", "shell.ply", "result.hdf", "--static", *MATERIAL))
    for tool, *arguments in steps:
        done = measure(tool, *arguments, folder=folder)
        yield tool, done.seconds, {name: seconds for name, seconds in done.report["seconds"].items() if name != "total"}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        stages = list(chain(folder))
        check = ("simulate", "shell.ply", "--check", "--static", *MATERIAL)
        start = 1e3 * statistics.median(measure(*check, folder=folder).seconds for _ in range(REPEATED))
        report = measure("simulate", "shell.ply", "result.hdf", "--static", *MATERIAL, folder=folder).report
        shells, memory = report["result"]["shells"], report["peak_mib"]
    lines = ["| shells | from the start of the process to the first step, ms | whole run, peak memory, MiB |", "|---|---|---|",
             f"| {shells} | {start:.0f} (≤ {BARS[0]}) | {memory:.0f} (≤ {BARS[1]}) |", "",
             "Seconds per stage of the chain over a small organ (64 voxels, 1,000 shells); loading is what is in no stage.", "",
             "| tool | stages | loading |", "|---|---|---|"]
    for tool, wall, parts in stages:
        told = ", ".join(f"{part} {seconds:.3f}" for part, seconds in parts.items())
        lines.append(f"| tunica-{tool} | {told} | {wall - sum(parts.values()):.3f} |")
    print("\n".join(lines))
    if given.out:
        given.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
