#!/usr/bin/python3
"""Mean distance of the extracted surface to the true one, in voxels, by voxels' faces and smoothed, and what the steps that
are left cost the stress, as tables.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/bench/staircase_bench.py [--out docs/tables/staircase.md]

The phantoms' surfaces are known by formulas (`tunica-phantom --truth`); aneurysm and tube are open at the image's border.
"""
import argparse
import math
import tempfile
from pathlib import Path

from running import run_tool

CASES = (("aneurysm", 256, "1"), ("tube", 256, "1"), ("bladder", 128, "1"), ("capsule", 128, "1"), ("colon", 128, "1"),
         ("bladder", 96, "0.78,0.78,5"), ("colon", 48, "1"), ("colon", 48, "0.78,0.78,5"))
# Phantoms without ends, with the share of flipped border voxels.
CLOSED = (("sphere", 60, "1", 0), ("sphere", 60, "1,1,3", 0), ("sphere", 60, "1,1,5", 0), ("sphere", 60, "1,1,5", 0.02),
          ("bladder", 60, "1", 0), ("bladder", 60, "1,1,3", 0), ("bladder", 60, "1,1,5", 0), ("capsule", 80, "1,1,4", 0))
INTRODUCTION = """Mean distance of the surface to the true one, in voxels (the cube root of a voxel's volume).

| phantom | voxels | spacing, mm | without smoothing | `--smooth staircase` | ratio |
|---|---|---|---|---|---|"""
STRESS = """
Stress under 16 kPa, wall 1.5 mm, 3,000 shells of the smoothed surface against 3,000 of the true one, error in %: what the steps that are
left cost. Border voxels are flipped with the probability `noise`.

| phantom | voxels | spacing, mm | noise | mean membrane stress | its 99th percentile | 99th percentile at the faces |
|---|---|---|---|---|---|---|"""


def run(verb, *words):
    return run_tool(verb, *words, "--quiet", "--force").report["result"]


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


def wall(folder, surface):
    run("relax", surface, surface, folder / "shell.ply", "--shells", 3000, "--min-angle", 20)
    return run("simulate", folder / "shell.ply", folder / "result.hdf", "--static", "--imaged-at", "16kPa", "--poisson", 0.45,
               "--thickness", "1.5mm", "--fix", "rigid-motions")["wall"]


def stress_row(folder, name, size, spacing, noise):
    run("phantom", name, folder / "volume.nii", "--size", size, "--spacing", spacing, "--noise", noise, "--truth",
        folder / "truth.ply")
    run("extract", folder / "volume.nii", folder / "surface.ply", "--label", 1, "--smooth", "staircase", "--largest")
    found, truth = wall(folder, folder / "surface.ply"), wall(folder, folder / "truth.ply")
    errors = (f"{100 * (found[key] / truth[key] - 1):+.1f}" for key in ("membrane_mean_mpa", "membrane_p99_mpa", "stress_p99_mpa"))
    return f"| {name} | {size} | {spacing} | {noise:g} | {' | '.join(errors)} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out")
    options = parser.parse_args()
    lines = [INTRODUCTION]
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            lines.append(row(Path(folder), *case))
            print(lines[-1], flush=True)
        lines.append(STRESS)
        for case in CLOSED:
            lines.append(stress_row(Path(folder), *case))
            print(lines[-1], flush=True)
    if options.out:
        Path(options.out).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
