#!/usr/bin/python3
"""Mean distance of the extracted surface to the true one, in voxels, by voxels' faces and smoothed, as a table.

    TUNICA_BIN=build/release/bin tests/bench/staircase_bench.py [--out docs/tables/staircase.md]

The phantoms' surfaces are known by formulas (`tunica-phantom --truth`); aneurysm and tube are open at the image's border.
"""
import argparse
import json
import math
import os
import subprocess
import tempfile
from pathlib import Path

BIN = os.path.abspath(os.environ.get("TUNICA_BIN", "build/release/bin"))
CASES = (("aneurysm", 256, "1"), ("tube", 256, "1"), ("bladder", 128, "1"), ("capsule", 128, "1"), ("colon", 128, "1"),
         ("bladder", 96, "0.78,0.78,5"), ("colon", 48, "1"), ("colon", 48, "0.78,0.78,5"))
INTRODUCTION = """Mean distance of the surface to the true one, in voxels (the cube root of a voxel's volume).

| phantom | voxels | spacing, mm | without smoothing | `--smooth staircase` | ratio |
|---|---|---|---|---|---|"""


def run(tool, *arguments):
    with tempfile.TemporaryDirectory() as folder:
        report = os.path.join(folder, "report.json")
        subprocess.run([os.path.join(BIN, "tunica-" + tool), *map(str, arguments), "--report", report, "--quiet", "--force"],
                       check=True)
        with open(report, encoding="utf-8") as file:
            return json.load(file)["result"]


def mean_distance(folder, name, smoothing):
    opened = ("--open-border",) if name in ("aneurysm", "tube") else ()
    run("extract", folder / "volume.nii", folder / "surface.ply", "--label", 1, "--smooth", smoothing, *opened)
    compared = run("compare", folder / "surface.ply", folder / "truth.ply", "--tolerance", "1%")
    return compared["mean_percent"] / 100 * compared["diagonal_mm"]


def row(folder, name, size, spacing):
    edges = [float(edge) for edge in spacing.split(",")]
    run("phantom", name, folder / "volume.nii", "--size", size, "--spacing", spacing, "--truth", folder / "truth.ply")
    voxel = math.prod(edges * 3 if len(edges) == 1 else edges) ** (1 / 3)
    before, after = (mean_distance(folder, name, smoothing) / voxel for smoothing in ("none", "staircase"))
    return f"| {name} | {size} | {spacing} | {before:.3f} | {after:.3f} | {after / before:.2f} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out")
    options = parser.parse_args()
    lines = [INTRODUCTION]
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            lines.append(row(Path(folder), *case))
            print(lines[-1], flush=True)
    if options.out:
        Path(options.out).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
