#!/usr/bin/python3
"""By how much fewer shells would do if they were split only where the error of the strain energy comes from, as a table.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/bench/refinement_bench.py [--data FOLDER]

What a shell's energy changes by when it is split in four and refitted stands for its error c_i, of the order of its area.
With n_i parts of shell i the whole error is sum(c_i / n_i): least, for a given sum of n_i, at n_i in proportion to the
roots of c_i, where it is sum(root(c_i))^2 against (number of shells) * sum(c_i) for equal parts. Their ratio is what the
best splits would save; "of neighbours" takes for c_i the mean of the nine nearest shells, as sizes that are graded have it.
"""
import argparse
import tempfile
from pathlib import Path

import h5py
import numpy as np
from load_bench import LOAD, bodies, run

YOUNG, POISSON = 1.0, 0.45  # as in LOAD


def energies(body, shell, wall, fix):
    """@return strain energy and centre of every shell"""
    result = body.folder / "result.hdf"
    run("simulate", shell, result, *LOAD, "--thickness", f"{wall}mm", "--fix", fix)
    with h5py.File(result) as file:
        elements = file["tunica/elements"]
        corners = file["tunica/nodes/position"][()][elements["nodes"][()]]
        stretch, bend = (elements[name][-1].astype(float) for name in ("membrane_force", "bending_moment"))

    def square(of):
        xx, yy, xy = of.T
        return xx**2 + yy**2 - 2 * POISSON * xx * yy + 2 * (1 + POISSON) * xy**2

    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    return area * (square(stretch) / wall + 12 * square(bend) / wall**3) / (2 * YOUNG), corners.mean(axis=1)


def nearest(points, of, count):
    return [np.argsort(((of - point)**2).sum(axis=1))[:count] for point in points]


def saved(errors):
    return len(errors) * errors.sum() / np.sqrt(errors).sum()**2


def row(body, wall):
    coarse, shell, finer = (body.folder / f"{name}.ply" for name in ("coarse", "shell", "finer"))
    run("decimate", body.surface, coarse, "--triangles", 800, "--min-angle", 20)
    report = run("relax", coarse, body.surface, shell, "--refine", "--max-iterations", 1)
    run("relax", coarse, body.surface, finer, "--refine", "--max-iterations", 2)
    fix = "boundary" if report["boundary_percent"] is not None else "rigid-motions"
    before, centres = energies(body, shell, wall, fix)
    after, centres_after = energies(body, finer, wall, fix)
    parents = [near[0] for near in nearest(centres_after, centres, 1)]
    errors = np.abs(before - np.bincount(parents, after, len(before)))
    graded = np.array([errors[near].mean() for near in nearest(centres, centres, 9)])
    return f"| {body.name} | {wall:g} | {saved(errors):.2f} | {saved(graded):.2f} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path)
    given = parser.parse_args()
    print("| body | wall, mm | best splits | of neighbours |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for body, walls in bodies(Path(folder), given.data, lambda name: name in ("aneurysm", "bladder", "capsule", "aorta")):
            print(row(body, walls[-1]), flush=True)


if __name__ == "__main__":
    main()
