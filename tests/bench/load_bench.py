#!/usr/bin/python3
"""Whether shells serve a load: what 1 kPa does to them against what it does to very many.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/bench/load_bench.py [--data FOLDER] [--only WORD,WORD] [--out docs/tables/load.md]

Phantoms (true surfaces, two wall thicknesses each) and organs of FOLDER/volumes (left out without --data); Young's
modulus 1 MPa, Poisson's ratio 0.45, nonlinear; open surfaces are held at their boundaries, closed ones carry their own
pressure. The reference has 12,800 shells: 800 triangles of 20 degrees, twice split in four and refitted.
"""
import argparse
import sys
import tempfile
from pathlib import Path

from running import measure

COUNT, REFERENCE = 800, 12800
LOAD = ("--static", "--pressure", "1kPa", "--young", "1MPa", "--poisson", "0.45")
PHANTOMS = {"aneurysm": (1.5, 0.5), "tube": (1.5, 0.5), "bladder": (3, 1), "capsule": (3, 1)}
ORGANS = {"aorta": ("ts_aorta_dissection.nii.gz", 1), "urinary bladder": ("nv_torso_5mm.nii.gz", 11),
          "gallbladder": ("nv_torso_5mm.nii.gz", 4)}
ORGAN_WALL = 1.5
# Shells, and what their answers may be off, %: largest displacement and strain energy.
SHAPED = f"{COUNT}, from 20°"  # the coarse mesh has these angles already
WAYS = {"1 %": (25, 25), "0.3 %": (12, 12), str(COUNT): (3, 6), SHAPED: (3, 6)}
RULE = """The rule: where nodes resolve the bending, the error of the answer is about one to three times the mean distance
over the thickness of the wall, which the report of `tunica-relax` (`mean_distance_mm`) tells before anything is simulated;
below a mean of 1 % what is left is the elements' own error, about 1 % with 800.
A tube is another matter: it bends without stretching, and pressure rounds its section out, whatever error the shape has.
Its displacement is off by the order of (mean distance / wall) x (radius / wall) x 4 (1 - nu^2), until the section is round:
shells within 1 % of the diagonal may be off by a tenth of this tube's radius. More of them of the same error change nothing."""


def run(verb, *words, check=True):
    """@return the report's result; none when the tool failed"""
    done = measure(verb, *words, code=0 if check else range(7))
    if done.returncode != 0:
        print(done.stderr.strip(), file=sys.stderr, flush=True)
        return None
    return done.report["result"]


class Body:
    """A surface and its shells."""

    def __init__(self, folder, name):
        self.name, self.folder = name, folder / name.replace(" ", "-")
        self.folder.mkdir(exist_ok=True)
        self.surface = self.folder / "surface.ply"

    def fitted(self):
        """@return {way: (report, file)}, the reference as none"""
        coarse, shaped = self.folder / "coarse.ply", self.folder / "shaped.ply"
        run("decimate", self.surface, coarse, "--triangles", COUNT)
        run("decimate", self.surface, shaped, "--triangles", COUNT, "--min-angle", 20)
        starts = {way: (self.surface, ("--tolerance", way.replace(" ", ""))) for way in WAYS if "%" in way}
        starts[str(COUNT)] = (coarse, ("--refine", "--tolerance", "1%"))
        starts[SHAPED] = (shaped, ("--refine", "--tolerance", "1%"))
        starts[None] = (shaped, ("--refine", "--max-shells", REFERENCE))
        fits = {}
        for way, (start, options) in starts.items():
            out = self.folder / f"{len(fits)}.ply"
            report = run("relax", start, self.surface, out, *options, check=way is None)
            if report:
                fits[way] = report, out
        return fits

    def answer(self, shell, is_open, wall):
        """@return largest displacement, mm, and strain energy, mJ; none without an equilibrium"""
        result = run("simulate", shell, self.folder / "result.hdf", *LOAD, "--thickness", f"{wall}mm", "--fix",
                     "boundary" if is_open else "rigid-motions", check=False)
        return result and (result["max_displacement_mm"], result["strain_energy_mj"])


def bodies(folder, data, wanted):
    """@return bodies with their walls, mm"""
    for shape, walls in PHANTOMS.items():
        if wanted(shape):
            body = Body(folder, shape)
            run("phantom", shape, body.folder / "volume.nii.gz", "--size", 96, "--truth", body.surface)
            yield body, walls
    for name, (volume, label) in ORGANS.items():
        if data and wanted(name):
            body = Body(folder, name)
            run("extract", data / "volumes" / volume, body.surface, "--label", label, "--smooth", "staircase",
                "--largest", "--fill-cavities")
            yield body, (ORGAN_WALL,)


def shown(error, bar):
    text = f"{error:+.1f}"
    return f"**{text}**" if abs(error) > bar else text


def rows(body, walls):
    fits = body.fitted()
    is_open = fits[None][0]["boundary_percent"] is not None
    for wall in walls:
        truth = body.answer(fits[None][1], is_open, wall)
        if not truth:
            print(f"{body.name}, {wall} mm: no reference", file=sys.stderr)
            continue
        for way, bars in WAYS.items():
            if way not in fits:
                yield f"| {body.name} | {wall:g} | {way} | no fit | | | | |"
                continue
            report, shell = fits[way]
            mean = report["mean_distance_mm"]
            answer = body.answer(shell, is_open, wall)
            if answer:
                errors = [100 * (a / t - 1) for a, t in zip(answer, truth)]
                told = [shown(error, bar) for error, bar in zip(errors, bars)]
                told.append(f"{max(map(abs, errors)) / (100 * mean / wall):.1f}")
            else:
                told = ["**no equilibrium**", "", ""]
            yield f"| {body.name} | {wall:g} | {way} | {report['shells']:,} | {100 * mean / wall:.2f} | {' | '.join(told)} |"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--data", type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--folder", type=Path, help="keeps surfaces and shells here")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.folder or Path(scratch)
        folder.mkdir(exist_ok=True)
        words = given.only.split(",")
        lines = ["| body | wall, mm | shells for | shells | mean distance / wall, % | largest displacement off by, % |"
                 " strain energy off by, % | larger error / mean distance per wall |", "|---|---|---|---|---|---|---|---|"]
        print("\n".join(lines))
        for body, walls in bodies(folder, given.data, lambda name: any(word in name for word in words)):
            for row in rows(body, walls):
                lines.append(row)
                print(row, flush=True)
    if given.out:
        given.out.write_text(
            f"1 kPa on 1 MPa, against {REFERENCE:,} shells. Bold: beyond 25 % (1 %), 12 % (0.3 %), 3 and 6 % "
            f"({COUNT} shells).\n\n" + "\n".join(lines) + f"\n\n{RULE}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
