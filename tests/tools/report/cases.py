"""Results as Makefile.pipeline leaves them, of a small phantom, and cohorts made from copies of it."""

import atexit
import functools
import hashlib
import json
import pathlib
import shutil
import tempfile

import contact_scenes
import numpy as np
from running import run_tool

STAGES = ["extract", "decimate", "relax", "simulate"]


@functools.cache
def shells_of(shape):
    """Runs the first three stages on a phantom, once for all cases of a program. @return their folder"""
    folder = pathlib.Path(tempfile.mkdtemp(prefix="tunica-cases-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    volume, case = folder / f"{shape}.nii.gz", folder / "out" / shape / "1"
    case.mkdir(parents=True)
    run_tool("phantom", shape, volume, "--size", 24, "--spacing", 2)
    surface, coarse, shell = (case / name for name in ("surface.ply", "coarse.ply", "shell.ply"))
    open_border = [] if shape == "sphere" else ["--open-border"]
    for stage, words in (("extract", [volume, surface, "--label", 1, "--smooth", "staircase", *open_border]),
                         ("decimate", [surface, coarse, "--triangles", 200]),
                         ("relax", [coarse, surface, shell, "--max-iterations", 2])):
        run_tool(stage, *words, "--quiet", report=case / f"{stage}.json")
    return case


def make_case(folder, shape="aneurysm", pressure="1kPa", solve=()):
    """The four stages on a phantom in folder/shape/1. @param solve  further words of the last. @return that folder"""
    case = folder / "out" / shape / "1"
    shutil.copytree(shells_of(shape), case)
    load = ["--pressure", pressure, "--young", "1MPa", "--poisson", "0.45", "--thickness", "1.5mm", "--density",
            "1100kg/m3", "--fix", "rigid-motions" if shape == "sphere" else "boundary", "--static", *solve]
    run_tool("simulate", case / "shell.ply", case / "result.hdf", *load, "--quiet", report=case / "simulate.json")
    return case


def add_solid(case):
    """Solves a case anew in four steps, with a block of tetrahedra beside the organ that bends under its weight."""
    points, tetrahedra = contact_scenes.block(2, np.array([20.0, 20.0, 20.0]), np.array([60.0, 0, 0]))
    contact_scenes.write_vtk(case / "block.vtk", points, tetrahedra)
    wall = "young = \"1MPa\"\npoisson = 0.3\n"
    (case / "scene.toml").write_text(
        "[run]\nkind = \"static\"\nload_steps = 4\n"
        f"[[shell]]\nname = \"organ\"\nmesh = \"shell.ply\"\nthickness = \"1.5mm\"\n{wall}"
        "[[fix]]\nbody = \"organ\"\nwhere = {rigid_motions = true}\n"
        f"[[solid]]\nname = \"block\"\nmesh = \"block.vtk\"\nunit = \"mm\"\n{wall}"
        "density = \"1000kg/m3\"\n[[fix]]\nbody = \"block\"\nwhere = {below = {axis = \"x\", at = \"61mm\"}}\ntranslation = \"xyz\"\n"
        "[[load]]\nbody = \"organ\"\nkind = \"pressure\"\nvalue = \"1kPa\"\n"
        "[[load]]\nbody = \"block\"\nkind = \"gravity\"\nvalue = [\"0mm/s2\", \"0mm/s2\", \"-9810mm/s2\"]\n")
    run_tool("simulate", "--scene", case / "scene.toml", case / "result.hdf", "--quiet", "--force", report=case / "simulate.json")


def copy_case(case, out, name, change=lambda reports: None):
    """A copy of a case under another name; `change` may alter its reports, by stage."""
    folder = pathlib.Path(out, name, "1")
    shutil.copytree(case, folder)
    reports = {stage: json.loads((folder / f"{stage}.json").read_text()) for stage in STAGES}
    change(reports)
    for stage, report in reports.items():
        (folder / f"{stage}.json").write_text(json.dumps(report))
    return folder


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()
