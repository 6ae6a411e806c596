#!/usr/bin/python3
"""Sweeps the choices of the tools on scenes whose answer is known and draws time against TRUE error (docs/charts.md).

    make -f Makefile.pipeline charts [REPORTS=FOLDER] [CHARTS=FOLDER] [DATA=FOLDER] [PAPER=FOLDER]

REPORTS keeps every run's report, with its command, and the files it read: a second sweep runs what is missing. `cd`
there and paste a command to run a point again; what it reads as NAME.ply was written by the command in NAME.json.
CHARTS gets an SVG and a CSV per chart. DATA holds volumes/ with organs, PAPER the meshes aneurysm200.obj to
aneurysm1000.obj of the authors' plugin (SofaDefrost/Shell, June 2010); what needs them is left out otherwise. Needs
TUNICA_BIN and PYTHONPATH=tests/support, which the makefile sets.

Times are the median of three runs (one, where it takes more than a second) on one thread, without reading and writing
files, as far as the processor worked for the run. The truth of an organ is the answer of 12,800 shells of another
decimation, that of a published problem its limit.
"""
import argparse
import json
import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np
from meshes import geodesic
from published import LINEAR, Bench, fix, grid, load, run_lines, shell, vessel, write_ply
from running import run_tool

ENDS = "[[fix]]\nbody = \"s\"\nwhere = {boundary = true}\ntranslation = \"xyz\"\nrotation = \"xyz\"\n"
FREE = "[[fix]]\nbody = \"s\"\nwhere = {rigid_motions = true}\n"
RAMP = "ramp = [[\"0s\", 0.0], [\"1s\", 1.0]]\n"
PAPER = {"membrane": "cst", "bending": "comas", "rest": "flat"}
FLAT = {"rest": "flat"}
ELEMENTS = {"default, curved": {}, "default elements, flat": FLAT, "cst + dkt-comas, flat": {"membrane": "cst", **FLAT},
            "opt + dkt-comas, flat": {"membrane": "opt", **FLAT}, "cst + comas, the paper's": PAPER}
# Shape, wall in mm. All under 1 kPa on 1 MPa.
PHANTOMS = {"aneurysm": 0.5, "tube": 1.5, "bladder": 3, "capsule": 1, "colon": 3}
ORGANS = {"aorta": ("ts_aorta_dissection.nii.gz", 1), "urinary-bladder": ("nv_torso_5mm.nii.gz", 11),
          "gallbladder": ("nv_torso_5mm.nii.gz", 4)}
COUNTS, FEW = (200, 400, 800, 1600, 3200), (200, 800, 3200)
TRUTH = 12_800
LONG = 1  # s; a run that takes longer is not repeated
REQUESTS = {"displacement": (10, 5, 2, 1), "energy": (5, 1), "membrane": (5, 2), "stress": (10, 5)}
TIME = ("--x", "study.seconds", "--x-label", "time, s, one thread", "--x-scale", "log")
ERROR = ("--y", "study.error_percent", "--y-scale", "log", "--failed", "study.exit")
OF_DISPLACEMENT = ("--y-label", "true error of the largest displacement, %")


class Study:
    """Runs tools in a folder and draws their reports."""

    def __init__(self, folder, out, repeats):
        self.folder, self.out, self.repeats = folder, out, repeats

    def run(self, name, tool, *arguments, repeats=None):
        """Runs a tool, or takes the report that is there of this very command.
        @return the report of the median run, with `study.seconds` of the processor and `study.exit`"""
        arguments = [str(word) for word in arguments]
        path = self.folder / f"{name}.json"
        if path.exists():
            record = json.loads(path.read_text(encoding="utf-8"))
            study = record.get("study", {})
            enough = study.get("runs", 1) >= (repeats or self.repeats) or study.get("seconds", 0) > LONG
            if study.get("arguments") == arguments and enough:
                return record
        path.parent.mkdir(parents=True, exist_ok=True)
        threads = () if tool == "phantom" else ("--threads", 1)
        records = []
        for _ in range(repeats or self.repeats):
            done = run_tool(tool, *arguments, "--force", "--quiet", *threads, folder=self.folder, report=f"{name}.json",
                            code=range(-64, 7))
            worked = done.processor_seconds
            record = done.report or {"tool": f"tunica-{tool}", "ok": False, "error": "no report", "command": " ".join(done.args[1:]),
                                     "seconds": {"total": worked}, "result": {}}  # ended by a signal
            stages = record["seconds"]
            busy = min(1, worked / stages["total"])
            seconds = busy * (stages["total"] - stages.get("read", 0) - stages.get("write", 0))
            records.append({**record, "study": {"seconds": seconds, "arguments": arguments, "exit": f"exit {done.returncode}"}})
            if seconds > LONG:
                break
        records.sort(key=lambda record: record["study"]["seconds"])
        record = records[len(records) // 2]
        record["study"]["runs"] = len(records)
        path.write_text(json.dumps(record), encoding="utf-8")
        print(f"{name}: {record['study']['exit']}, {record['study']['seconds']:.3g} s", flush=True)
        return record

    def scene(self, name, text, **more):
        """Simulates a scene; its result stays in NAME.hdf."""
        path = self.folder / f"{name}.toml"
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            (self.folder / f"{name}.json").unlink(missing_ok=True)
        return self.run(name, "simulate", "--scene", f"{name}.toml", f"{name}.hdf", **more)

    def mesh(self, name, *parts):
        """Writes a mesh where there is none."""
        path = self.folder / f"{name}.ply"
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            write_ply(path, *parts)

    def states(self, name):
        """Displacements of every written state: states x nodes x 3."""
        with h5py.File(self.folder / f"{name}.hdf") as file:
            return file["tunica/nodes/displacement"][()]

    def mark(self, chart, name, record, setting, **study):
        """A mark of a chart. @return its file"""
        path = self.folder / "marks" / chart / f"{name.replace('/', '-')}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({**record, "study": {**record["study"], **study, series_of(chart): setting}}),
                        encoding="utf-8")
        return str(path.relative_to(self.folder))

    def draw(self, name, title, marks, *options):
        run_tool("chart", *marks, "-o", self.out / f"{name}.svg", "--csv", self.out / f"{name}.csv", "--force", "--quiet",
                 "--series", f"study.{series_of(name)}", "--title", title, *options, folder=self.folder)


def series_of(chart):
    """What the series of a chart are, the head of its legend."""
    named = {"elements": "elements", "estimates": "answer_and_level", "figure-6": "element_and_solver", "load-steps": "method",
             "organ": "mesh_and_elements", "profile": "mesh_and_elements", "requested": "answer", "shape": "method",
             "sizes": "solver", "solvers": "solver", "time-steps": "integrator", "certificate": "surface"}
    return next(series for start, series in named.items() if chart.startswith(start))


def key_of(setting):
    """The setting as a part of a file's name."""
    return "-".join("".join(sign if sign.isalnum() or sign == "." else " " for sign in setting).split())


def answers(record):
    """@return the answers that an accuracy can be asked of; none where the run failed"""
    result = record["result"] if record["ok"] else None
    return result and {"displacement": result["max_displacement_mm"], "energy": result["strain_energy_mj"],
                       "membrane": result["wall"]["membrane_p99_mpa"], "stress": result["wall"]["stress_p99_mpa"]}


def off(value, truth):
    return 100 * abs(value / truth - 1)


class Body:
    """An organ or phantom under pressure: its shells by every way, their answers and the truth."""

    def __init__(self, study, name, wall, source):
        self.study, self.name, self.wall = study, name, wall
        self.target = f"{name}/target.ply"
        if source:
            study.run(f"{name}/target", "extract", source[0], self.target, "--label", source[1], "--smooth",
                      "staircase", "--largest", "--fill-cavities", repeats=1)
        else:
            study.run(f"{name}/target", "phantom", name, f"{name}/volume.nii.gz", "--size", 48, "--truth", self.target,
                      repeats=1)
        study.run(f"{name}/other", "decimate", self.target, f"{name}/other.ply", "--triangles", 800, "--min-angle", 25,
                  repeats=1)
        fits = [study.run(f"{name}/other{count}", "relax", f"{name}/other.ply", self.target, f"{name}/other{count}.ply",
                          "--refine", "--max-shells", count, repeats=1) for count in (TRUTH // 4, TRUTH)]
        self.is_open = fits[-1]["result"]["boundary_percent"] is not None
        coarse, self.truth = (answers(self.solved(f"truth{count}", f"other{count}", repeats=1))
                              for count in (TRUTH // 4, TRUTH))
        self.known = {of: off(coarse[of], self.truth[of]) for of in self.truth}  # by second order a third of that
        self.ways = {}  # (way, size) to (report's name, report, seconds with the making of the shells)
        self.claims = {}

    def solved(self, name, shells, geometry="nonlinear", repeats=None, elements=None, **run):
        text = run_lines(kind="static", geometry=geometry, **run) + shell(f"{shells}.ply", self.wall, 1.0, 0.45,
                                                                         **(elements or {}))
        text += (ENDS if self.is_open else FREE) + load("pressure", "1kPa")
        return self.study.scene(f"{self.name}/{name}", text, repeats=repeats)

    def way(self, way, size, shells, makers, **more):
        """One way to an answer: `makers` made the shells."""
        name = f"{key_of(way)}-{shells}"
        if not all(maker["ok"] for maker in makers):
            record = makers[-1]
        else:
            record = self.solved(name, shells, **more)
        seconds = sum(maker["study"]["seconds"] for maker in makers)
        seconds += record["study"]["seconds"] if record is not makers[-1] else 0
        self.ways[way, size] = f"{self.name}/{name}", record, seconds

    def sweep(self):
        run, name = self.study.run, self.name
        self.flat, self.fits, self.rules = {}, {}, {}
        for n in COUNTS:
            flat = self.flat[n] = run(f"{name}/flat{n}", "decimate", self.target, f"{name}/flat{n}.ply",
                                      "--triangles", n, "--min-angle", 20)
            fit = self.fits[n] = run(f"{name}/fit{n}", "relax", f"{name}/flat{n}.ply", self.target,
                                     f"{name}/fit{n}.ply", "--refine", "--tolerance", "5%")
            self.way("fit, curved (default)", n, f"fit{n}", (flat, fit))
            if n not in FEW:
                continue
            rule = self.rules[n] = run(f"{name}/rule{n}", "relax", f"{name}/flat{n}.ply", self.target,
                                       f"{name}/rule{n}.ply", "--method", "barycentre", "--surface", "comas")
            self.way("flat facets, fit", n, f"fit{n}", (flat, fit), elements=FLAT)
            self.way("decimated, not fitted", n, f"flat{n}", (flat,))
            self.way("paper, rule and element", n, f"rule{n}", (flat, rule), elements=PAPER)
            self.way("linear, fit, curved", n, f"fit{n}", (flat, fit), geometry="linear")
            needles = run(f"{name}/needles{n}", "decimate", self.target, f"{name}/needles{n}.ply", "--triangles", n)
            fit = run(f"{name}/plain{n}", "relax", f"{name}/needles{n}.ply", self.target, f"{name}/plain{n}.ply",
                      "--refine", "--tolerance", "5%")
            self.way("plain decimation, fit, curved", n, f"plain{n}", (needles, fit))
        made = self.flat[200]["study"]["seconds"] + self.fits[200]["study"]["seconds"]
        for of, requests in REQUESTS.items():
            for asked in requests:
                claim = f"{name}/accuracy-{of}-{asked}"
                record = run(claim, "simulate", f"{name}/fit200.ply", f"{claim}.hdf", "--static", "--pressure", "1kPa",
                             "--young", "1MPa", "--poisson", "0.45", "--thickness", f"{self.wall}mm", "--fix",
                             "boundary" if self.is_open else "rigid-motions", "--accuracy", f"{asked}%", "--of", of,
                             "--target", self.target)
                self.claims[of, asked] = claim, record
                if of == "displacement":
                    self.ways["--accuracy", asked] = claim, record, made + record["study"]["seconds"]
        return self

    def error(self, record, of="displacement"):
        return off(answers(record)[of], self.truth[of]) if record["ok"] else None

    def marks(self, chart, ways):
        """A mark per way and size."""
        for (way, size), (name, record, seconds) in self.ways.items():
            if way in ways:
                label = f"{size} %" if way == "--accuracy" else f"{size:,}"
                yield self.study.mark(chart, name, record, way, seconds=seconds, error_percent=self.error(record),
                                      size=label)


def bodies(study, data):
    with ThreadPoolExecutor(2) as pool:
        made = [pool.submit(lambda name=name, wall=wall: Body(study, name, wall, None).sweep())
                for name, wall in PHANTOMS.items()]
        if data:
            made += [pool.submit(lambda name=name, source=(data / "volumes" / file, label):
                                 Body(study, name, 1.5, source).sweep()) for name, (file, label) in ORGANS.items()]
        else:
            print("organs: left out, DATA names no folder")
        swept = [one.result() for one in made]
    for body in swept:
        changes = ", ".join(f"{of} {change:.2g}" for of, change in body.known.items())
        print(f"{body.name}: last change of the truth, %: {changes}", flush=True)
    return swept


def whole_runs(study, swept):
    """A chart per organ: from the surface to the answer."""
    for body in swept:
        chart = f"organ-{body.name}"
        ways = dict.fromkeys(way for way, _ in body.ways)
        study.draw(chart, f"{body.name.capitalize()}, wall {body.wall:g} mm: from surface to largest displacement",
                   list(body.marks(chart, ways)), *TIME, *ERROR, *OF_DISPLACEMENT, "--lines", "--label", "study.size")


def requested(study, swept):
    marks = [study.mark("requested", name, record, of, requested=asked, error_percent=body.error(record, of))
             for body in swept for (of, asked), (name, record) in body.claims.items()]
    study.draw("requested", "--accuracy: what was asked for and what came. Below the line it was kept", marks, "--x",
               "study.requested", "--x-label", "error asked for, %", "--x-scale", "log", *ERROR, "--y-label",
               "true error, %", "--guide", "diagonal", "--guide-label", "as asked for")
    right = sum(body.error(record, of) <= asked for body in swept for (of, asked), (_, record) in body.claims.items()
                if record["ok"])
    refused = sum(not record["ok"] for body in swept for _, record in body.claims.values())
    print(f"requested: {len(marks)} runs, {right} within the request, {refused} refused", flush=True)


def estimates(study, swept):
    """The claim of every level of the runs for 1 %: max(|D_k|, |D_(k-1)| / 4), against the error of that level."""
    marks, ratios, dropped = [], [], 0
    for of in ("displacement", "energy"):
        for body in swept:
            name, record = body.claims[of, 1]
            levels = record["result"].get("accuracy", {}).get("levels", ()) if record["ok"] else ()
            change = 0
            for k in range(1, len(levels)):
                value, before = levels[k]["value"], change
                change = off(levels[k - 1]["value"], value)
                error = off(value, body.truth[of])
                if error < body.known[of]:
                    dropped += 1
                    continue
                ratios.append(max(change, before / 4) / error)
                marks.append(study.mark("estimates", f"{name}-level{k + 1}", record, f"{of}, level {k + 1}",
                                        ratio=ratios[-1], shells=levels[k]["shells"], organ=body.name))
    study.draw("estimates", "--accuracy: estimate over true error, level by level. Above 1 it is on the safe side",
               marks, "--x", "study.shells", "--x-label", "shells", "--x-scale", "log", "--y", "study.ratio",
               "--y-label", "estimate / true error", "--y-scale", "log", "--guide", "1", "--guide-label",
               "estimate = true error", "--label", "study.organ")
    print(f"estimates: {len(marks)} levels, {sum(ratio < 1 for ratio in ratios)} below 1; {dropped} left out, whose "
          "error is below the last change of the truth", flush=True)


def profiles(study, swept):
    """The share of scenes that a setting answers within n % in time tau."""
    everything = [seconds for body in swept for _, _, seconds in body.ways.values()]
    for within in (5, 1):
        chart, marks = f"profile-{within}", []
        settings = [("fit, curved (default)", n) for n in FEW]
        settings += [(way, 800) for way in ("flat facets, fit", "decimated, not fitted", "paper, rule and element")]
        settings.append(("--accuracy", within))
        for way, size in settings:
            runs = [body.ways[way, size] + (body,) for body in swept]
            times = sorted(seconds for _, record, seconds, body in runs
                           if record["ok"] and body.error(record) <= within)
            tau, solved = [min(everything)], [0.0]
            for i, seconds in enumerate(times):
                tau += [seconds, seconds]
                solved += [100 * i / len(runs), 100 * (i + 1) / len(runs)]
            tau.append(max(everything))
            solved.append(solved[-1])
            setting = f"--accuracy {size}%" if way == "--accuracy" else f"{size:,} {way}"
            marks.append(study.mark(chart, key_of(setting), runs[0][1], setting, tau=tau,
                                    solved=solved, runs=[name for name, *_ in runs]))
        study.draw(chart, f"Scenes answered within {within} % of the true displacement, of {len(swept)}. Further up "
                   "and left is better", marks, "--lines", "--x", "study.tau", "--x-label",
                   "in at most this time, s, one thread", "--x-scale", "log", "--y", "study.solved", "--y-label",
                   "scenes answered, %", "--y-scale", "linear")


def shapes(study, body):
    """Decimation and relaxation: the shape alone, and what a narrower certificate costs."""
    marks = []
    for way, made in (("decimated, flat", body.flat), ("the paper's rule", body.rules), ("fit (default)", body.fits)):
        for n, record in made.items():
            seconds = record["study"]["seconds"] + (body.flat[n]["study"]["seconds"] if made is not body.flat else 0)
            error = record["result"]["hausdorff_percent"]["upper"] if record["ok"] else None
            marks.append(study.mark("shape", f"{key_of(way)}{n}", record, way, seconds=seconds, error_percent=error,
                                    size=f"{n:,}"))
    study.draw("shape", "Aneurysm, 200 to 3,200 triangles or shells: time against the error of the shape", marks, *TIME,
               *ERROR, "--y-label", "two-sided distance, certified, % of the diagonal", "--lines", "--label",
               "study.size")
    widths = ("3%", "1%", "0.3%", "0.1%", "0.03%", "0.01%", "0.003%", "0.001%")
    name, marks = body.name, []
    for kind, flags in (("fit800", ("--shell",)), ("flat800", ())):
        def measured(width, kind=kind, flags=flags, **more):
            return study.run(f"{name}/width-{kind}-{width[:-1]}", "compare", f"{name}/{kind}.ply", body.target, *flags,
                             "--tolerance", width, **more)

        best = measured("0.0001%", repeats=1)["result"]["hausdorff_percent"]["lower"]
        for width in widths:
            record = measured(width)
            over = record["result"]["hausdorff_percent"]["upper"] - best if record["ok"] else None
            marks.append(study.mark("certificate", f"{kind}-{width[:-1]}", record, "curved shells" if flags else "flat",
                                    error_percent=over, size=width))
    study.draw("certificate", "Aneurysm, 800 shells: what a narrower certificate of the distance costs", marks, *TIME,
               *ERROR, "--y-label", "bound above the true distance, % of the diagonal", "--lines", "--label",
               "study.size")


def load_steps(study, body):
    """One static answer by load steps, by one linearisation per step, and by the linear model."""
    marks = []
    for setting, keys in (("Newton's method (default)", {}), ("one linearisation per step", {"newton_max": 1})):
        for steps in (1, 2, 5, 10, 20):
            name = f"steps{'-once' if keys else ''}-{steps}"
            record = body.solved(name, "fit800", load_steps=steps, **keys)
            marks.append(study.mark("load-steps", name, record, setting, error_percent=body.error(record),
                                    size=str(steps)))
    record = body.solved("steps-linear", "fit800", geometry="linear")
    marks.append(study.mark("load-steps", "linear", record, "linear model", error_percent=body.error(record), size="1"))
    study.draw("load-steps", "Aneurysm, 800 shells: the same load in 1 to 20 steps", marks, *TIME, *ERROR,
               *OF_DISPLACEMENT, "--lines", "--label", "study.size")


class Problems(Bench):
    """The published linear problems, and a sphere; each method gives answer / limit."""

    def __init__(self, study):
        super().__init__(study.folder)
        self.study, self.name, self.record, self.triangles = study, None, None, 0

    def solve(self, mesh, scene, **_):
        self.triangles = len(mesh[1])
        stem = self.name.split("-")[0]
        self.study.mesh(f"elements/{stem}", *mesh)
        name = f"elements/{self.name}"
        self.record = self.study.scene(name, scene.replace("\"mesh.ply\"", f"\"{stem}.ply\""))
        return self.study.states(name)[-1] if self.record["ok"] else np.full((len(mesh[0]), 3), np.nan)

    def sphere(self, n, **elements):
        """The node that errs most of a sphere under pressure, t = R / 100; p R^2 (1 - nu) / (2 E t)."""
        unit, triangles = geodesic(n)
        u = self.solve((10 * unit, triangles, unit), LINEAR + shell("mesh.ply", 0.1, 1.0, 0.3, **elements) + FREE +
                       load("pressure", "1Pa"))
        exact = 1e-6 * 10 ** 2 * 0.7 / (2 * 1.0 * 0.1)
        return 1 + np.abs(np.linalg.norm(u, axis=1) / exact - 1).max()


def elements(study, swept):
    problems, divisions = Problems(study), (4, 8, 16, 32, 64)
    for name, title, sizes in (("roof", "Scordelis-Lo roof", divisions), ("cylinder", "Pinched cylinder", divisions),
                               ("hemisphere", "Pinched hemisphere with a hole", divisions),
                               ("sphere", "Sphere under pressure, largest node", (2, 4, 8, 16))):
        chart, marks, triangles = f"elements-{name}", [], []
        for setting, kind in ELEMENTS.items():
            for n in sizes:
                problems.name = f"{name}{n}-{key_of(setting)}"
                error = 100 * abs(getattr(problems, name)(n, **kind) - 1)
                triangles.append(problems.triangles)
                marks.append(study.mark(chart, problems.name, problems.record, setting,
                                        error_percent=error if problems.record["ok"] else None))
        study.draw(chart, f"{title}: elements, {min(triangles)} to {max(triangles):,} triangles", marks, *TIME, *ERROR,
                   "--y-label", "true error of the displacement, %", "--lines")
    body, marks = swept[0], []
    for setting, kind in ELEMENTS.items():
        for n in FEW:
            name = f"element{n}-{key_of(setting)}"
            record = body.solved(name, f"fit{n}", elements=kind)
            marks.append(study.mark("elements-aneurysm", name, record, setting, error_percent=body.error(record)))
    study.draw("elements-aneurysm", "Aneurysm, wall 0.5 mm, nonlinear: elements, 200, 800 and 3,200 shells", marks,
               *TIME, *ERROR, *OF_DISPLACEMENT, "--lines")


def from_exact(study, name, record, exact):
    """The largest difference of any node in any state, in % of the largest displacement."""
    if not record["ok"]:
        return None
    u = study.states(name)
    return 100 * np.linalg.norm(u - exact, axis=2).max() / np.linalg.norm(exact, axis=2).max()


def per_step(record):
    """The mean time of a step, ms, with its share of setting up."""
    return 1000 * record["study"]["seconds"] / record["result"]["steps"] if record["ok"] else None


def solvers(study):
    """A ramp to 1 kPa over 1 s in steps of 40 ms, 2,000 shells: what a setting costs and what it leaves."""
    study.mesh("solvers/vessel", *vessel(32, 32))

    def solved(name, **keys):
        return study.scene(f"solvers/{name}", run_lines(kind="dynamic", duration="1s", step="40ms", **keys) +
                           shell("vessel.ply", 1, 1.0, 0.45, density="1100kg/m3") + ENDS +
                           load("pressure", "1kPa", more=RAMP))

    solved("exact", solver="direct")
    exact, marks = study.states("solvers/exact"), []
    settings = [("CG to a residual", f"{t}%", {"cg_tolerance": f"{t}%", "newton_max": 1}) for t in (50, 20, 5, 1, 0.1)]
    settings += [("CG, fixed iterations", str(n), {"cg_iterations": n}) for n in (10, 30, 100, 300)]
    settings += [("direct, one linearisation", "", {"solver": "direct", "newton_max": 1}),
                 ("direct, Newton's method", "1e-6", {"solver": "direct", "converge": 1e-6})]
    for setting, label, keys in settings:
        name = key_of(f"{setting} {label}")
        record = solved(name, **keys)
        marks.append(study.mark("solvers", name, record, setting, ms_per_step=per_step(record), size=label,
                                error_percent=from_exact(study, f"solvers/{name}", record, exact)))
    study.draw("solvers", "A step of 40 ms on 2,000 shells: what a solver's setting leaves", marks, "--x",
               "study.ms_per_step", "--x-label", "time of a step, ms, one thread", "--x-scale", "log", *ERROR,
               "--y-label", "true error, % of the largest displacement", "--label", "study.size", "--lines")


def time_steps(study):
    """A strip of 30 mm, held at one end, is let go under its own weight, 200 ms: integrators and steps."""
    mesh = grid(12, 4, lambda u, v: (30 * u, 10 * v, 0 * u))
    study.mesh("steps/strip", *mesh)
    held = fix(np.flatnonzero(mesh[0][:, 0] < 1e-9))

    def solved(name, step, repeats=None, **keys):
        return study.scene(f"steps/{name}", run_lines(kind="dynamic", duration="200ms", step=f"{step}ms",
                                                      every=round(20 / step), **keys) +
                           shell("strip.ply", 1, 1.0, 0.45, density="1100kg/m3") + held +
                           load("gravity", (0.0, 0.0, -9.81), "m/s2"), repeats=repeats)

    alpha = {"integrator": "generalised-alpha"}
    solved("exact", 0.05, repeats=1, spectral_radius=1.0, **alpha)
    exact, marks = study.states("steps/exact"), []
    settings = [(name, f"{step:g} ms", step, keys)
                for name, keys in (("backward-euler (default)", {}), ("generalised-alpha", alpha),
                                   ("backward-euler, one linearisation", {"newton_max": 1}),
                                   ("generalised-alpha, one linearisation", {"newton_max": 1, **alpha}))
                for step in (20, 10, 5, 2, 1, 0.5)]
    settings += [("generalised-alpha, adaptive", f"{within} %", 20, {**alpha, "adaptive": f"{within}%"})
                 for within in (1, 0.1, 0.01, 0.001)]
    for setting, label, step, keys in settings:
        name = key_of(f"{setting} {label}")
        record = solved(name, step, **keys)
        marks.append(study.mark("time-steps", name, record, setting, size=label,
                                error_percent=from_exact(study, f"steps/{name}", record, exact)))
    study.draw("time-steps", "A strip let go under its weight, 200 ms: integrators and time steps", marks, *TIME,
               *ERROR, "--y-label", "true error, % of the largest displacement", "--label", "study.size", "--lines")


def sizes(study):
    """One linear solve to 1e-8 from scratch: time and memory against the number of shells."""
    marks = {"sizes-time": [], "sizes-memory": []}
    for setting, keys, most in (("direct", {"solver": "direct"}, 50_000),
                                ("CG to 1e-8", {"solver": "cg", "cg_tolerance": 1e-8}, 20_000)):
        for shells in (1000, 2000, 5000, 10_000, 20_000, 50_000):
            if shells <= most:
                n = round(math.sqrt(shells / 2))
                study.mesh(f"sizes/vessel{n}", *vessel(n, n))
                name = f"{setting.split()[0]}{shells}"
                record = study.scene(f"sizes/{name}", run_lines(kind="static", geometry="linear", **keys) +
                                     shell(f"vessel{n}.ply", 1, 1.0, 0.45) + ENDS + load("pressure", "1kPa"))
                for chart, found in marks.items():
                    found.append(study.mark(chart, name, record, setting))
    common = ("--lines", "--failed", "study.exit", "--x", "result.shells", "--x-label", "shells")
    study.draw("sizes-time", "Vessel: time of one linear static solve from scratch", marks["sizes-time"], *common,
               "--y", "study.seconds", "--y-label", "assembly and solve, s, one thread")
    study.draw("sizes-memory", "Vessel: memory of one linear static solve from scratch", marks["sizes-memory"], *common,
               "--y", "peak_mib", "--y-label", "largest memory of the process, MiB")


def paper_mesh(folder, count):
    vertices, triangles = [], []
    for line in (folder / f"aneurysm{count}.obj").read_text(encoding="utf-8").splitlines():
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
    """The paper's Fig. 6: its meshes, its steps of 40 ms, its settings of CG, its element; E 5 MPa, nu 0.45, t 50 mm
    and 0.3 kg per node as in its scene, a uniform pressure of 10 kPa that grows over 1 s. The true answer is that
    of the same flat facets, each cut into 16."""
    marks = {"figure-6": [], "figure-6-time": [], "figure-6-error": []}
    for count in (200, 400, 600, 800, 1000):
        vertices, triangles = paper_mesh(folder, count)
        study.mesh(f"figure-6/aneurysm{count}", vertices, triangles)
        sides = vertices[triangles]
        area = np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1).sum() / 2
        density = f"{0.3 * len(vertices) / (area * 50) * 1e9:.6g}kg/m3"
        boxes = (((-200, -1000, -200), (200, -800, 200)), ((400, 300, -800), (800, 700, -700)))
        held = [i for i, p in enumerate(vertices) if any((p >= box[0]).all() and (p <= box[1]).all() for box in boxes)]

        def solved(name, mesh, nodes, kind, repeats=None, **keys):
            return study.scene(f"figure-6/{name}", run_lines(kind="dynamic", duration="1s", step="40ms", **keys) +
                               shell(f"{mesh}.ply", 50, 5.0, 0.45, density=density, **kind) + fix(nodes) +
                               load("pressure", "10kPa", more=RAMP), repeats=repeats)

        fine, finer, fine_held = split(*split(vertices, triangles, held))
        study.mesh(f"figure-6/fine{count}", fine, finer)
        solved(f"exact{count}", f"fine{count}", fine_held, {}, repeats=1, solver="direct")
        exact = study.states(f"figure-6/exact{count}")[:, :len(vertices)]
        for setting, kind, keys in (
                ("the paper's element, converged", PAPER, {"solver": "direct"}),
                ("100 CG iterations, the paper's", PAPER, {"cg_iterations": 100}),
                ("CG to 5 %, the paper's", PAPER, {"cg_tolerance": "5%", "newton_max": 1}),
                ("tunica's default, converged", {}, {})):
            name = key_of(f"{setting} {count}")
            record = solved(name, f"aneurysm{count}", held, kind, **keys)
            error = from_exact(study, f"figure-6/{name}", record, exact)
            for chart, found in marks.items():
                found.append(study.mark(chart, name, record, setting, shells=count, size=str(count),
                                        error_percent=error, ms_per_step=per_step(record)))
    ms, error = ("time of a step, ms, one thread", "true error, % of the largest displacement")
    common = ("--lines", "--failed", "study.exit")
    count = ("--x", "study.shells", "--x-scale", "linear", "--x-label", "shells")
    study.draw("figure-6", "The paper's Fig. 6 again: time of a step against the error it leaves", marks["figure-6"],
               *common, "--x", "study.ms_per_step", "--x-label", ms, "--x-scale", "log", "--y", "study.error_percent",
               "--y-scale", "log", "--y-label", error, "--label", "study.size")
    study.draw("figure-6-time", "The paper's Fig. 6 again: time of a step of 40 ms", marks["figure-6-time"], *common,
               *count, "--y", "study.ms_per_step", "--y-label", ms)
    study.draw("figure-6-error", "The paper's Fig. 6 again: the error its settings leave", marks["figure-6-error"],
               *common, *count, "--y", "study.error_percent", "--y-label", error)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reports", type=Path)
    parser.add_argument("charts", type=Path)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--paper", type=Path)
    parser.add_argument("--only", default="organs,elements,solvers,steps,sizes,figure-6",
                        help="parts; elements take organs along (default: %(default)s)")
    parser.add_argument("--repeats", type=int, default=3, help="of every timed run (default: %(default)s)")
    given = parser.parse_args()
    for folder in (given.reports, given.charts):
        folder.mkdir(parents=True, exist_ok=True)
    study = Study(given.reports.resolve(), given.charts.resolve(), given.repeats)
    parts = given.only.split(",")
    if "organs" in parts or "elements" in parts:
        swept = bodies(study, given.data and given.data.resolve())
    if "organs" in parts:
        whole_runs(study, swept)
        requested(study, swept)
        estimates(study, swept)
        profiles(study, swept)
        shapes(study, swept[0])
        load_steps(study, swept[0])
    if "elements" in parts:
        elements(study, swept)
    for part, draw in (("solvers", solvers), ("steps", time_steps), ("sizes", sizes)):
        if part in parts:
            draw(study)
    if "figure-6" in parts and given.paper:
        figure_6(study, given.paper)
    elif "figure-6" in parts:
        print("Fig. 6: left out, PAPER names no folder")


if __name__ == "__main__":
    main()
