"""Runs of the tools for one cell of a map, and the verdict on them."""
import math
import os
import signal
from dataclasses import dataclass, field

from published import write_ply
from running import measure

RIGHT, DOUBTFUL, REFUSED, WRONG = "R", "D", "X", "W"
ORDER = RIGHT + DOUBTFUL + REFUSED + WRONG  # the worst last
ALLOWED_ERROR = 0.1
LONGEST_RUN_S = 60  # of processor time
RIGID = "[[fix]]\nbody = \"s\"\nwhere = {rigid_motions = true}\n"


@dataclass(frozen=True)
class Method:
    """Keys of [run] and [[shell]] in a scene, for every map that simulates."""
    name: str
    title: str
    run: dict = field(default_factory=dict)
    shell: dict = field(default_factory=dict)


DEFAULT = Method("default", "tunica's defaults")
PAPER = Method("paper", "element and solver of Comas 2010", {"solver": "cg", "cg_iterations": 100},
               {"membrane": "cst", "bending": "comas", "rest": "flat"})


class Ended(Exception):
    """A run that did not end with exit code 0."""

    def __init__(self, code, message):
        super().__init__(message)
        self.code, self.message = code, message


@dataclass
class Verdict:
    letter: str
    error: float  # relative; NaN where nothing can be compared
    code: int
    message: str  # the first warning, or why it ended


class Runner:
    """Runs tools in a folder of its own and keeps what they announce."""

    def __init__(self, folder):
        self.folder = str(folder)
        self.warnings, self.reports = [], []

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, text):
        with open(self.path(name), "w", encoding="utf-8") as file:
            file.write(text)

    def tool(self, verb, *arguments):
        """@return the report's result; every other end than exit code 0 is raised"""
        name = f"{verb}-{len(self.reports)}.json"
        done = measure(verb, *arguments, folder=self.folder, report=name, code=range(-64, 7),
                       within=["prlimit", f"--cpu={LONGEST_RUN_S}"])
        self.reports.append((verb, [verb, *map(str, arguments)], done.report or {}))
        if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
            raise Ended(-1, f"did not end within {LONGEST_RUN_S} s")
        if done.returncode != 0:
            raise Ended(done.returncode, done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "no message")
        self.warnings += done.report["warnings"]
        algebra = done.report["result"].get("algebraic_error_percent")
        if algebra is not None and algebra > 100 * ALLOWED_ERROR:
            self.warnings.append(f"algebraic_error_percent is {algebra:.3g}")
        return done.report["result"]

    def simulate(self, scene, mesh=None):
        """A scene file of the body in mesh.ply."""
        if mesh is not None:
            write_ply(self.path("mesh.ply"), *mesh)
        self.write("scene.toml", scene)
        return self.tool("simulate", "--scene", "scene.toml", "result.hdf", "--tessellation", "1")


def judged(measure, runner):
    """The verdict on `measure(runner)`, which runs tools and returns the relative error of their answer."""
    try:
        error = measure(runner)
    except Ended as end:
        return Verdict(REFUSED if end.code in (2, 3, 4) else WRONG, math.nan, end.code, end.message)
    if runner.warnings:
        return Verdict(DOUBTFUL, error, 0, runner.warnings[0])
    right = math.isfinite(error) and abs(error) <= ALLOWED_ERROR
    return Verdict(RIGHT if right else WRONG, error, 0, "")


def badness(verdict):
    """To sort by: the letter, then the size of the error."""
    return ORDER.index(verdict.letter), abs(verdict.error) if math.isfinite(verdict.error) else math.inf
