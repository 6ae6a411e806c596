#!/usr/bin/python3
"""The fit against its bars: shells, certified distance, shape and seconds per target, as a table.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/bench/fit_bench.py [--targets SCRIPT] [--data FOLDER] [--only WORD,WORD]
        [--flat] [--out docs/tables/shells.md]
    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/bench/fit_bench.py --scaling docs/charts/fit-scaling.svg

Targets: shapes.py beside this file; SCRIPT, which writes aneurysm_tube.ply, liver_like.ply and bumpy.ply into its working
folder; the paper's meshes and organs (FOLDER/paper, FOLDER/volumes, FOLDER/meshes). What is not given is left out, and
said. Seconds are the processor's, of the whole run and of all its threads: one, but where two are said.
"""
import argparse
import dataclasses
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import shapes
from meshes import write_ply
from running import measure, run_tool

ANGLE = 20  # degrees, where a tolerance is asked for
ANGLE_OF_PAPER = 5  # its targets' rims ask for it
MILLIMETRES = ("--mesh-unit", "mm")


@dataclasses.dataclass
class Case:
    name: str
    target: Path
    percent: float | None  # the tolerance, or with a count the bar of the error
    shells: int  # the bar, or the count asked for
    is_count: bool = False
    seconds: float | None = None
    angle: float = ANGLE
    threads: int = 1
    unit: tuple = ()

    def asked(self):
        return [f"{self.shells:,} shells" if self.is_count else f"{self.percent:g} %"]

    def options(self):
        what = ("--shells", self.shells) if self.is_count else ("--tolerance", f"{self.percent}%")
        return [*what, "--min-angle", self.angle, *self.unit]


def run(verb, *words, threads=1):
    """@return the report, and seconds of the processor; a report without result when the tool failed"""
    done = measure(verb, *words, threads=threads, code=range(7))
    return done.report, done.processor_seconds


def known_shapes(folder):
    yield Case("bumpy ellipsoid", shapes.written(folder, "bumpy_ellipsoid"), 0.1, 260)
    yield Case("half a ball with its disc", shapes.written(folder, "half_ball"), 0.1, 100)


def scripted(folder, script):
    if not all((folder / f"{name}.ply").exists() for name in ("aneurysm_tube", "liver_like", "bumpy")):
        subprocess.run([sys.executable, script.resolve()], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    yield Case("open tube with a bulge", folder / "aneurysm_tube.ply", 0.1, 130)
    yield Case("smooth liver", folder / "liver_like.ply", 0.1, 330, seconds=10)
    yield Case("bumpy ball, a million facets, two threads", folder / "bumpy.ply", 0.1, 1500, threads=2)
    yield Case("open tube with a bulge", folder / "aneurysm_tube.ply", None, 772, is_count=True, seconds=1)


def organs(folder, data, wanted):
    for name, volume, label, shells, seconds in (
            ("aorta, true lumen", "ts_aorta_dissection.nii.gz", 1, 115, 4),
            ("urinary bladder", "nv_torso_5mm.nii.gz", 11, 110, None),
            ("gallbladder", "nv_torso_5mm.nii.gz", 4, 115, None),
            ("colon, 3 mm voxels", "ts_abdomen_multilabel.nii.gz", 20, 480, 20)):
        if wanted(name):
            path = folder / f"{name.replace(' ', '-')}.ply"
            if not path.exists():
                run("extract", data / "volumes" / volume, path, "--label", label, "--smooth", "staircase", "--largest",
                    "--fill-cavities")
            yield Case(name, path, 1, shells, seconds=seconds)
    yield Case("colon with a handle", data / "meshes" / "gca_colon_90_20k.obj", 1, 480, seconds=20, unit=MILLIMETRES)


def papers(data):
    for name, file, shells, percent in (("capsule", "liverHighRes", 1200, 0.3), ("capsule", "liverHighRes", 300, 0.9),
                                        ("aneurysm", "aneurysmHighRes", 772, 0.25),
                                        ("aneurysm", "aneurysmHighRes", 200, 0.8),
                                        ("cylinder", "cylinderHighRes", 48, 0.05)):
        yield Case(f"the paper's {name}", data / "paper" / f"{file}.obj", percent, shells, is_count=True,
                   angle=ANGLE_OF_PAPER, unit=MILLIMETRES)


def flat_count(case, folder):
    """Well-shaped flat triangles within the tolerance. @return their number; none where there are none"""
    report, _ = run("decimate", case.target, folder / "flat.ply", "--max-error", f"{case.percent}%", "--min-angle",
                    case.angle, *case.unit)
    return report.get("result", {}).get("triangles")


def told(value, bar, text):
    """A figure with its bar; bold where it misses it."""
    if bar is None:
        return text.format(value)
    return f"{text.format(value)} (≤ {text.format(bar)})" if value <= bar else f"**{text.format(value)}** (≤ {text.format(bar)})"


def row(case, folder, with_flat):
    report, seconds = run("relax", case.target, case.target, folder / "shell.ply", *case.options(), threads=case.threads)
    result = report.get("result", {})
    if not report["ok"]:
        return f"| {case.name} | {case.asked()[0]} | **{report['error'].split(': ', 1)[-1]}** |"
    flat = flat_count(case, folder) if with_flat and not case.is_count else None
    return "| " + " | ".join([
        case.name, *case.asked(), told(result["shells"], case.shells, "{:,}"), *([f"{flat or 0:,}"] if with_flat else []),
        told(result["hausdorff_percent"]["upper"], case.percent, "{:.3g}"), f"{result['min_angle_deg']:.1f}°",
        f"{result['size_ratio']:.1f}", str(result["self_intersections"]), told(seconds, case.seconds, "{:.3g}")]) + " |"


def levels(target, folder):
    """Seconds of splitting in four and refitting, with the certificate."""
    run("decimate", target, folder / "coarse.ply", "--triangles", 800)
    report, _ = run("relax", folder / "coarse.ply", target, folder / "levels.ply", "--refine", "--max-shells", 12800)
    for level, bar in zip(report["result"]["iterations"], (None, 1, 4)):
        yield (f"| {level['shells']:,} | {level['hausdorff_percent']['upper']:.2g} | "
               f"{told(level['seconds'], bar, '{:.3g}')} |")


def rule(data, folder):
    """The paper's rule from well-shaped decimated meshes, beside the paper's own published ones, flat and curved."""
    for name, target, published, count in (("cylinder (Fig. 3)", "cylinderHighRes", "cylinderLowRes", 48),
                                           ("capsule (Fig. 4)", "liverHighRes", None, 1200),
                                           ("capsule", "liverHighRes", "liverLowRes300", 300),
                                           ("aneurysm (Fig. 5)", "aneurysmHighRes", "aneurysm800", 772),
                                           ("aneurysm", "aneurysmHighRes", "aneurysm200", 200)):
        target = data / "paper" / f"{target}.obj"
        coarse, shell = folder / "rule-coarse.ply", folder / "rule.ply"

        def percent(mesh, *options):
            report, _ = run("compare", mesh, target, *MILLIMETRES, *options)
            return report["result"]["hausdorff_percent"]["upper"]

        theirs = f"{percent(data / 'paper' / f'{published}.obj'):.3g}" if published else "–"
        run("decimate", target, coarse, "--triangles", count, "--min-angle", ANGLE, *MILLIMETRES)
        report, _ = run("relax", coarse, target, shell, "--method", "barycentre", "--surface", "comas", "--max-iterations", 5,
                        *MILLIMETRES)
        ruled = (f"{report['result']['shells']:,} | {percent(shell):.3g} | {percent(shell, '--shell'):.3g}" if report["ok"]
                 else "refused: its nodes fold | – | –")
        yield f"| {name} | {theirs} | {percent(coarse):.3g} | {ruled} |"


def scaling(folder, chart):
    """One shape at four densities: processor seconds of a fit to 0.1 % and of its certificate, beside n log n."""
    reports = []

    def point(series, triangles, seconds):
        path = folder / f"scaling-{len(reports)}.json"
        path.write_text(json.dumps({"tool": "tunica-relax", "ok": True, "seconds": {"processor": seconds},
                                    "result": {"triangles": triangles, "series": series}}))
        reports.append(path)

    first = None
    for n in (36, 72, 144, 288):
        path, out = folder / f"density{n}.ply", folder / f"density{n}-shell.ply"
        if not path.exists():
            write_ply(path, *shapes.ball(n, shapes.bumps(7, 0.06, 6)))
        triangles = 12 * n * n
        report, seconds = run("relax", path, path, out, "--tolerance", "0.1%")
        _, certifying = run("compare", out, path, "--shell")
        first = first or seconds / (triangles * math.log(triangles))
        point("fit within 0.1 %", triangles, seconds)
        point("its certificate, 0.01 % wide", triangles, certifying)
        point("n log n", triangles, first * triangles * math.log(triangles))
        print(f"{triangles:9} triangles  shells {report.get('result', {}).get('shells')}  fit {seconds:.3g} s  "
              f"certificate {certifying:.3g} s", flush=True)
    chart = os.path.abspath(chart)
    run_tool("chart", *(path.name for path in reports), "-o", chart, "--x", "result.triangles", "--y", "seconds.processor",
             "--series", "result.series", "--x-label", "triangles of the target", "--y-label", "processor time (s)", "--title",
             "Fit and certificate of one shape at four densities", "--x-scale", "log", "--y-scale", "log", "--lines", "--csv",
             Path(chart).with_suffix(".csv"), "--force", "--quiet", folder=folder)


def cases(folder, given, wanted):
    yield from known_shapes(folder)
    if given.targets:
        yield from scripted(folder, given.targets)
    else:
        print("left out: the targets of a script (--targets)", file=sys.stderr)
    if given.data:
        yield from organs(folder, given.data, wanted)
        yield from papers(given.data)
    else:
        print("left out: organs and the paper's meshes (--data)", file=sys.stderr)


def table(folder, given):
    words = given.only.split(",")

    def wanted(name):
        return any(word in name for word in words)

    def say(line):
        print(line, flush=True)
        return line

    flat = ["well-shaped flat triangles"] if given.flat else []
    head = ["target", "asked", "shells", *flat, "certified, % of the diagonal", "smallest angle", "size ratio", "crossings",
            "processor time, s"]
    lines = [say("| " + " | ".join(head) + " |"), say("|---" * len(head) + "|")]
    lines += [say(row(case, folder, given.flat)) for case in cases(folder, given, wanted) if wanted(case.name)]
    target = folder / "aneurysm_tube.ply"
    if target.exists() and wanted("levels"):
        lines += ["", "The open tube by `--refine` without a tolerance: every shell split in four and refitted.", "",
                  say("| shells | certified, % | seconds with the certificate |"), say("|---|---|---|"),
                  *map(say, levels(target, folder))]
    if given.data and wanted("rule"):
        lines += ["", "The paper's rule (`--method barycentre`) on its own targets; two-sided distances, % of the diagonal.", "",
                  say("| target | the published mesh | decimated to its count | shells of the rule | their facets | their "
                      "curved surface |"), say("|---" * 6 + "|"), *map(say, rule(given.data, folder))]
    return lines


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--scaling", metavar="OUT.svg", help="only time against the target's density, as a chart")
    parser.add_argument("--targets", type=Path)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--only", default="", help="words of the targets' names, levels, rule")
    parser.add_argument("--flat", action="store_true", help="also the flat triangles of 20 degrees that hold a tolerance")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--folder", type=Path, help="keeps targets here")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.folder or Path(scratch)
        folder.mkdir(exist_ok=True)
        if given.scaling:
            scaling(folder, given.scaling)
            return
        lines = table(folder, given)
    if given.out:
        given.out.write_text("In brackets the bar, bold what misses it; angles of 20°, for the paper's targets of 5°.\n\n"
                             + "\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
