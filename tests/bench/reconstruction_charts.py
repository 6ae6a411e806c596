#!/usr/bin/python3
"""Draws the charts and error maps of docs/reconstruction.md from the tools' own reports.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/bench/reconstruction_charts.py OUT_FOLDER [--only PART,PART] [--paper FOLDER]

Parts: `counts` (error against shells and against time, on the true surface of tunica-phantom's aneurysm), `rule` (every
iteration of the paper's rule with its splits, beside the fit), `maps` (the paper's Fig. 3 to 5). The paper's meshes are
in the history of the authors' plugin (SofaDefrost/Shell, June 2010); without --paper what needs them is left out. One
thread; times are the part of the reports' that the processor was at work for the run.
"""
import argparse
import json
import os
import tempfile

from running import run_tool

COUNTS = (60, 120, 240, 480, 960)
RULE = ("--method", "barycentre", "--surface", "comas")  # the paper's patch
FIT = {"fit, comas patches": ("--surface", "comas"), "fit, watertight patches": ("--surface", "watertight")}
# Figure, target, the paper's own mesh, shells, a unit that makes a plausible organ of it (percentages do not change), the
# range of both pictures.
FIGURES = ((3, "cylinderHighRes", "cylinderLowRes", 48, "m", "3%"),
           (4, "liverHighRes", "liverLowRes300_iteration1", 1200, "mm", "2%"),
           (5, "aneurysmHighRes", "aneurysm800", 772, "cm", "0.7%"))


class Study:
    def __init__(self, folder, out):
        self.folder, self.out, self.count = folder, os.path.abspath(out), 0

    def path(self, name):
        return os.path.join(self.folder, name)

    def run(self, tool, *arguments, check=True):
        """Runs a tool on one thread. @return its report, with `study.seconds` of the processor; none when it failed"""
        done = run_tool(tool, *arguments, "--threads", 1, "--force", folder=self.folder, code=0 if check else range(7))
        if done.returncode != 0:
            print(f"{tool}: exit {done.returncode}: {done.report['error']}", flush=True)
            return None
        return {**done.report, "study": {"seconds": done.processor_seconds}}

    def keep(self, record, **study):
        """A mark of a chart. @return its file"""
        self.count += 1
        name = f"mark{self.count}.json"
        with open(self.path(name), "w", encoding="utf-8") as file:
            json.dump({**record, "study": {**record["study"], **study}}, file)
        print(study, flush=True)
        return name

    def chart(self, name, marks, *options):
        run_tool("chart", *marks, "-o", os.path.join(self.out, name + ".svg"), "--csv", os.path.join(self.out, name + ".csv"),
                 "--force", "--series", "study.series", *options, folder=self.folder)


def error_of(record):
    return record["result"]["hausdorff_percent"]["upper"]


def relaxed(study, start, target, *options, out="shell.ply", unit="mm", **more):
    return study.run("relax", start, target, out, "--mesh-unit", unit, *options, **more)


def counts(study):
    study.run("phantom", "aneurysm", "p.nii.gz", "--size", 96, "--truth", "target.ply")
    marks = []

    def keep(record, series, shells):
        marks.append(study.keep(record, series=series, shells=shells, error=error_of(record),
                                seconds=record["study"]["seconds"]))

    for n in COUNTS:
        for factor in (1, 4):
            flat = study.run("decimate", "target.ply", "coarse.ply", "--triangles", factor * n)
            if factor == 1 or n == COUNTS[-1]:
                keep(flat, "flat triangles (tunica-decimate)", flat["result"]["triangles"])
        study.run("decimate", "target.ply", "coarse.ply", "--triangles", n, "--min-angle", 15)
        rule = relaxed(study, "coarse.ply", "target.ply", *RULE, check=False)
        if rule:
            keep(rule, "the paper's rule (barycentre)", rule["result"]["shells"])
        for series, options in FIT.items():
            fit = relaxed(study, "target.ply", "target.ply", "--shells", n, *options)
            keep(fit, series, fit["result"]["shells"])
    common = ("--y", "study.error", "--y-label", "two-sided distance, certified, % of the diagonal")
    study.chart("error-count", marks, *common, "--lines", "--x", "study.shells", "--x-label", "triangles or shells", "--title",
                "Saccular aneurysm: error against count")
    study.chart("error-time", marks, *common, "--label", "study.shells", "--x", "study.seconds", "--x-label",
                "processor time of the whole run, s, one thread", "--title", "The same runs: error against time")


def rule(study, paper):
    marks, steps = [], []
    targets = []
    for shape, series in (("aneurysm", "aneurysm"), ("colon", "colon")):
        study.run("phantom", shape, "p.nii.gz", "--size", 96, "--truth", shape + ".ply")
        targets.append((series, shape + ".ply", 150))
    if paper:
        targets.append(("the paper's capsule", os.path.join(paper, "liverHighRes.obj"), 300))
    for series, target, start in targets:
        flat = study.run("decimate", target, "coarse.ply", "--mesh-unit", "mm", "--triangles", start)
        settled = relaxed(study, "coarse.ply", target, *RULE, check=False)
        errors = [error_of(flat)]
        if settled:
            errors += [i["hausdorff_percent"]["upper"] for i in settled["result"]["iterations"]]
        for i, error in enumerate(errors):
            steps.append(study.keep(flat, series=f"{series}, {start} shells", iteration=i, error=error))
        split = relaxed(study, "coarse.ply", target, *RULE, "--refine", "--max-shells", 17 * start,
                        "--max-iterations", 30, check=False)
        if split:
            print(series, "with splits:", split["result"]["stopped"], flush=True)
        for iteration in split["result"]["iterations"] if split else ():
            marks.append(study.keep(split, series=series + ": rule", shells=iteration["shells"],
                                    error=iteration["hausdorff_percent"]["upper"]))
        for n in (start, 4 * start):
            fit = relaxed(study, target, target, "--shells", n, check=False)
            if not fit:
                continue
            marks.append(study.keep(fit, series=series + ": fit", shells=fit["result"]["shells"], error=error_of(fit)))
    common = ("--lines", "--y", "study.error", "--y-label", "two-sided distance, certified, % of the diagonal")
    study.chart("rule-splits", marks, *common, "--x", "study.shells", "--x-label", "shells", "--title",
                "The paper's rule, all shells split 1:4 in every iteration")
    study.chart("rule-settles", steps, *common, "--x", "study.iteration", "--x-label",
                "iteration (0: the flat decimated mesh)", "--x-scale", "linear", "--title",
                "The paper's rule without splits")


def maps(study, paper):
    for figure, target, mesh, shells, unit, colours in FIGURES:
        for name, file in (("target.obj", target), ("paper.obj", mesh)):
            if os.path.lexists(study.path(name)):
                os.remove(study.path(name))
            os.symlink(os.path.join(paper, file + ".obj"), study.path(name))
        own = study.run("compare", "paper.obj", "target.obj", "--mesh-unit", unit, "--picture",
                        os.path.join(study.out, f"figure-{figure}-paper.png"), "--picture-range", colours)
        print(figure, "the paper's mesh", own["result"]["triangles_a"], error_of(own), own["result"]["mean_percent"])
        fit = relaxed(study, "target.obj", "target.obj", "--shells", shells, "--min-angle", 5, out="fit.ply",
                      unit=unit)
        study.run("compare", "fit.ply", "target.obj", "--shell", "--mesh-unit", unit, "--picture",
                  os.path.join(study.out, f"figure-{figure}-fit.png"), "--picture-range", colours)
        print(figure, "fit", fit["result"]["shells"], error_of(fit), fit["result"]["mean_percent"],
              fit["result"]["min_angle_deg"], fit["study"], flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--only", default="counts,rule,maps")
    parser.add_argument("--paper")
    given = parser.parse_args()
    os.makedirs(given.out, exist_ok=True)
    paper = os.path.abspath(given.paper) if given.paper else None
    parts = given.only.split(",")
    with tempfile.TemporaryDirectory() as folder:
        study = Study(folder, given.out)
        if "counts" in parts:
            counts(study)
        if "rule" in parts:
            rule(study, paper)
        if "maps" in parts and paper:
            maps(study, paper)


if __name__ == "__main__":
    main()
