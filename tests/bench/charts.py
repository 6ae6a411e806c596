#!/usr/bin/python3
"""Draws the charts of docs/accuracy.md from the tools' own reports: time against TRUE error.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/bench/charts.py OUT_FOLDER [FOLDER_OF_THE_PAPERS_MESHES]

True error: of the elements the largest difference at the probes to a run with 46,000 shells (tunica-chart --reference);
of solvers the largest difference of any node in any state to the converged run on the same mesh, relative to the
largest displacement, which is added to the reports as `study`. Times are the reports' with one thread, times the part of
them that the processor was at work for this run, so that what else the machine does counts little. The paper's meshes aneurysm200.obj ... aneurysm1000.obj
are in the history of the authors' plugin (SofaDefrost/Shell, June 2010); without them Fig. 6 is left out.
"""
import json
import math
import os
import resource
import subprocess
import sys
import tempfile

import numpy as np

from published import Bench, fix, load, probe, run_lines, shell, vessel, write_ply

CHART = os.path.join(os.environ["TUNICA_BIN"], "tunica-chart")
ENDS = "[[fix]]\nbody = \"s\"\nwhere = {boundary = true}\ntranslation = \"xyz\"\nrotation = \"xyz\"\n"
PROBES = (probe("neck", (10 + 10 * math.exp(-2.25), 0.0, 15.0)) + probe("top", (20.0, 0.0, 30.0)) +
          probe("back", (-10.0, 0.0, 30.0)))
RAMP = "ramp = [[\"0s\", 0.0], [\"1s\", 1.0]]\n"
PAPER = {"membrane": "cst", "bending": "comas", "rest": "flat"}


class Study(Bench):
    def __init__(self, folder, out):
        super().__init__(folder)
        self.out = out
        self.failed = []

    def chart(self, name, reports, *options):
        """Draws the reports; what tunica-chart left out is said."""
        done = subprocess.run([CHART, *[report + ".json" for report in reports], "-o", os.path.join(self.out, name),
                               "--force", "--series", "study.series", *options], cwd=self.folder, capture_output=True,
                              text=True, check=False)
        print(name, done.stderr.strip())
        if done.returncode != 0:
            sys.exit(done.returncode)

    def measured(self, scene, name, series, exact=None, **more):
        """Runs on one thread; adds the series and, against `exact`, the true error. @return all displacements, or none
        where the run failed"""
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        result = self.run(scene, name, threads=1, check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        with open(self.path(name + ".json"), encoding="utf-8") as file:
            report = json.load(file)
        busy = (after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime) / report["seconds"]["total"]
        report["study"] = {"series": series, **more}
        u = None
        if self.code != 0:
            print(f"{name}: exit {self.code}: {self.error}")
            self.failed.append(name)
        else:
            u = self.displacements(name)
            report["study"]["ms_per_step"] = busy * result["ms_per_step"]["median"]
            report["study"]["seconds"] = busy * report["seconds"]["solve"]
            if exact is not None:
                error = 100 * np.linalg.norm(u - exact, axis=2).max() / np.linalg.norm(exact, axis=2).max()
                report["study"]["true_error_percent"] = error
                print(f"{name}\t{series}\t{more}\t{report['study']['ms_per_step']:.2f} ms\t{error:.3g} %", flush=True)
        with open(self.path(name + ".json"), "w", encoding="utf-8") as file:
            json.dump(report, file)
        return u


def elements(study):
    """1 kPa on a wall of 0.5 mm, nonlinear statics, 128 to 10,000 shells."""
    kinds = {"cst + comas (the paper's)": PAPER, "cst + dkt-comas, flat": {"membrane": "cst", "rest": "flat"},
             "adapt + dkt-comas, flat": {"rest": "flat"}, "adapt + dkt-comas, curved (default)": {}}

    def scene(n, more):
        write_ply(study.path(f"vessel{n}.ply"), *vessel(n, n))
        return (run_lines(kind="static", load_steps=1, solver="direct") +
                shell(f"vessel{n}.ply", 0.5, 1.0, 0.45, **more) + ENDS + load("pressure", "1kPa") + PROBES)

    study.measured(scene(152, {}), "finest", "reference")
    names = []
    for series, more in kinds.items():
        for n in (8, 16, 24, 32, 48, 72):
            names.append(f"e{len(names)}")
            study.measured(scene(n, more), names[-1], series)
    study.chart("elements.svg", [name for name in names if name not in study.failed], "--reference", "finest.json",
                "--lines", "--title", "Vessel, 1 kPa, 128 to 10,368 shells: the error of the elements", "--x",
                "study.seconds", "--x-label", "solving, s, one thread", "--csv", os.path.join(study.out, "elements.csv"))


def solvers(study):
    """A ramp to 1 kPa over 1 s in steps of 40 ms, 5,000 shells: what a setting costs and what it leaves."""
    write_ply(study.path("vessel.ply"), *vessel(50, 50))

    def scene(**keys):
        return (run_lines(kind="dynamic", duration="1s", step="40ms", **keys) +
                shell("vessel.ply", 1, 1.0, 0.45, density="1100kg/m3") + ENDS + load("pressure", "1kPa", more=RAMP))

    exact = study.measured(scene(solver="direct"), "exact", "reference")
    names = []
    settings = [("CG to a residual", {"cg_tolerance": t, "newton_max": 1}) for t in ("50%", "20%", "5%", "1%", "0.1%")]
    settings += [("CG, fixed iterations", {"cg_iterations": n}) for n in (10, 30, 100, 300)]
    settings += [("direct, one linearisation", {"solver": "direct", "newton_max": 1}),
                 ("direct, Newton to 1e-6", {"solver": "direct", "converge": 1e-6})]
    for series, keys in settings:
        names.append(f"s{len(names)}")
        study.measured(scene(**keys), names[-1], series, exact,
                       setting=keys.get("cg_tolerance") or str(keys.get("cg_iterations", "")))
    study.chart("solvers.svg", [name for name in names if name not in study.failed], "--x", "study.ms_per_step", "--y",
                "study.true_error_percent", "--label", "study.setting", "--title", "A step of 40 ms on 5,000 shells: what a solver's setting leaves",
                "--x-label", "time of a step, ms, one thread", "--y-label", "true error, % of the largest displacement",
                "--csv", os.path.join(study.out, "solvers.csv"))


def sizes(study):
    """One linear solve to 1e-8 from scratch: time and memory against the number of shells."""
    names = []
    for series, keys, most in (("direct", {"solver": "direct"}, 500_000),
                               ("CG to 1e-8", {"solver": "cg", "cg_tolerance": 1e-8}, 20_000)):
        for shells in (1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000, 250_000, 500_000):
            if shells > most:
                break
            n = round(math.sqrt(shells / 2))
            write_ply(study.path("vessel.ply"), *vessel(n, n))
            names.append(f"n{len(names)}")
            study.measured(run_lines(kind="static", geometry="linear", load_steps=1, **keys) +
                           shell("vessel.ply", 1, 1.0, 0.45) + ENDS + load("pressure", "1kPa"), names[-1], series)
    names = [name for name in names if name not in study.failed]
    common = ("--lines", "--x", "result.shells", "--x-label", "shells")
    study.chart("sizes-time.svg", names, *common, "--y", "study.seconds", "--y-label", "assembly and solve, s, one thread",
                "--title", "Vessel: time of one linear static solve from scratch", "--csv", os.path.join(study.out, "sizes-time.csv"))
    study.chart("sizes-memory.svg", names, *common, "--y", "peak_mib", "--y-label", "largest memory of the process, MiB",
                "--title", "Vessel: memory of one linear static solve from scratch", "--csv", os.path.join(study.out, "sizes-memory.csv"))


def paper_mesh(folder, count):
    vertices, triangles = [], []
    with open(os.path.join(folder, f"aneurysm{count}.obj"), encoding="utf-8") as file:
        for line in file:
            words = line.split()
            if words[:1] == ["v"]:
                vertices.append([float(x) for x in words[1:4]])
            elif words[:1] == ["f"]:
                triangles.append([int(word.split("/")[0]) - 1 for word in words[1:4]])
    return 1000 * np.array(vertices), np.array(triangles)  # metres


def split(vertices, triangles, held):
    """Every triangle into four in its own plane; a middle is held where its edge is."""
    middles, points, finer = {}, list(vertices), []
    held = set(held)

    def middle(a, b):
        key = (min(a, b), max(a, b))
        if key not in middles:
            middles[key] = len(points)
            points.append((vertices[a] + vertices[b]) / 2)
            if a in held and b in held:
                held.add(middles[key])
        return middles[key]

    for a, b, c in triangles:
        ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
        finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.array(points), np.array(finer), sorted(held)


def figure_6(study, folder):
    """The paper's Fig. 6: its meshes, its steps of 40 ms, its settings of CG, its element; E 5 MPa, nu 0.45, t 50 mm and
    0.3 kg per node as in its scene, a uniform pressure of 10 kPa that grows over 1 s. The true answer is that of the
    same flat facets, each cut into 16."""
    names = []
    for count in (200, 400, 600, 800, 1000):
        vertices, triangles = paper_mesh(folder, count)
        write_ply(study.path("aneurysm.ply"), vertices, triangles)
        sides = vertices[triangles]
        area = np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1).sum() / 2
        density = f"{0.3 * len(vertices) / (area * 50) * 1e9:.6g}kg/m3"
        boxes = (((-200, -1000, -200), (200, -800, 200)), ((400, 300, -800), (800, 700, -700)))
        held = [i for i, p in enumerate(vertices) if any((p >= box[0]).all() and (p <= box[1]).all() for box in boxes)]

        def scene(mesh, nodes, elements, **keys):
            return (run_lines(kind="dynamic", duration="1s", step="40ms", **keys) +
                    shell(mesh, 50, 5.0, 0.45, density=density, **elements) + fix(nodes) +
                    load("pressure", "10kPa", more=RAMP))

        fine, finer, fine_held = split(*split(vertices, triangles, held))
        write_ply(study.path("fine.ply"), fine, finer)
        exact = study.measured(scene("fine.ply", fine_held, {}, solver="direct"), f"f{count}", "reference", shells=count)
        for name, series, elements, keys in (
                ("x", "the paper's element, converged", PAPER, {"solver": "direct"}),
                ("i", "100 CG iterations (the paper's)", PAPER, {"cg_iterations": 100}),
                ("c", "CG to 5 % (the paper's)", PAPER, {"cg_tolerance": "5%", "newton_max": 1}),
                ("o", "tunica's default, converged", {}, {})):
            u = study.measured(scene("aneurysm.ply", held, elements, **keys), f"{name}{count}", series,
                               exact[:, :len(vertices)], shells=count)
            names.append(f"{name}{count}")
            if name == "x":
                converged = u
            elif elements is PAPER and u is not None and converged is not None:
                left = np.linalg.norm(u - converged, axis=2).max() / np.linalg.norm(converged, axis=2).max()
                print(f"\tof which CG leaves {100 * left:.2g} %")
    names = [name for name in names if name not in study.failed]
    common = ("--lines", "--x", "study.shells", "--x-scale", "linear", "--x-label", "shells")
    study.chart("figure-6-time.svg", names, *common, "--y", "study.ms_per_step", "--y-label",
                "time of a step, ms, one thread", "--title", "The paper's Fig. 6 again: time of a step of 40 ms",
                "--csv", os.path.join(study.out, "figure-6-time.csv"))
    study.chart("figure-6-error.svg", names, *common, "--y",
                "study.true_error_percent", "--y-label", "true error, % of the largest displacement", "--title",
                "The paper's Fig. 6 again: the error its settings leave", "--csv", os.path.join(study.out, "figure-6-error.csv"))


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as folder:
        study = Study(folder, os.path.abspath(sys.argv[1]))
        elements(study)
        solvers(study)
        sizes(study)
        if len(sys.argv) == 3:
            figure_6(study, sys.argv[2])


if __name__ == "__main__":
    main()
