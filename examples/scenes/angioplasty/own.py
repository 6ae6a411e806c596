#!/usr/bin/python3
"""own.py FOLDER VESSEL [DEPOSITS] from=X,Y,Z to=X,Y,Z inflated=R [KEY=VALUE ...]: FOLDER/scene.toml, an angioplasty of your own.

VESSEL is a mesh of shells, DEPOSITS tetrahedra on its inner face; without, the balloon widens the vessel itself. All lengths
are in mm, in the coordinates of the vessel. The balloon is a rigid capsule about the line from ... to.
    inflated   its largest radius
    collapsed  its radius before and after  [a quarter of `inflated`]
    push       how far it is pushed in, in the direction from ... to; 0: it lies in its place  [0]
    wall       thickness of the vessel, whose middle is VESSEL  [1]
    young      of the wall, MPa  [1]
    deposit    Young's modulus of the deposits, kPa  [60]
    poisson    their Poisson's ratio  [0.3]
    pressure   of the blood beyond that at which VESSEL was seen, mmHg  [0.1: where nothing touches, residuals need a measure]
    friction   of the balloon  [0]
    resolution of the balloon's contact with the vessel, percent of the wall  [20]
    hold       X,Y,Z,R: all nodes of the vessel in that ball are held; may be given more than once  [the vessel's boundary]
"""
import sys
from pathlib import Path

import numpy as np

KEYS = {"collapsed": None, "push": 0, "wall": 1, "young": 1, "deposit": 60, "poisson": 0.3, "pressure": 0.1, "friction": 0,
        "resolution": 20}

SCENE = """# An angioplasty: a collapsed balloon is pushed in, inflated, deflated and withdrawn.
[run]
kind = "static"
load_factors = [{factors}]

[[shell]]
name = "vessel"
mesh = "{vessel}"
thickness = "{wall:.6g}mm"
young = "{young:.6g}MPa"
poisson = 0.45
{tissue}
[[rigid]]
name = "balloon"
shape = "capsule"
from = {start}
to = {end}
radius = [[0.2, "{collapsed:.6g}mm"], [0.5, "{inflated:.6g}mm"], [0.8, "{collapsed:.6g}mm"]]
motion = [[0.0, {out}], [0.2, {inside}], [0.8, {inside}], [1.0, {out}]]
{held}
[[contact]]
between = ["balloon", "vessel"]
friction = {friction:.6g}
resolution = "{resolution:.6g}%"
{blood}"""

HELD = """
[[fix]]
body = "vessel"
where = {where}
translation = "xyz"
rotation = "xyz"
"""

BLOOD = """
[[load]]
body = "vessel"
kind = "pressure"
value = "{pressure:.6g}mmHg"
ramp = [[0.0, 0.0], [0.05, 1.0], [1.0, 1.0]]
"""

DEPOSIT = """
[[solid]]
name = "deposit"
mesh = "{deposits}"
unit = "mm"
young = "{deposit:.6g}kPa"
poisson = {poisson:.6g}
law = "neo-hookean"

[[attach]]
body = "deposit"
where = {{touching = "{reach:.6g}mm"}}
to = "vessel"
side = "middle"

[[contact]]
between = ["balloon", "deposit"]
friction = {friction:.6g}
"""


def lengths(values):
    return "[" + ", ".join(f'"{value + 0.0:.6g}mm"' for value in values) + "]"


def scene(vessel, deposits, values, balls):
    start, end = (np.array([float(x) for x in values[key].split(",")]) for key in ("from", "to"))
    numbers = {key: float(values.get(key, default)) for key, default in KEYS.items() if key != "collapsed"}
    numbers["inflated"] = float(values["inflated"])
    numbers["collapsed"] = float(values.get("collapsed", numbers["inflated"] / 4))
    way = -numbers["push"] * (end - start) / np.linalg.norm(end - start)
    factors = [0.05, 0.1, 0.15, 0.2, *np.arange(215, 501, 15) / 1000, *np.arange(55, 81, 5) / 100, 0.9, 1]
    tissue = DEPOSIT.format(deposits=deposits, reach=0.6 * numbers["wall"], **numbers) if deposits else ""
    wheres = [f"{{sphere = {{centre = {lengths(ball[:3])}, radius = \"{ball[3]:.6g}mm\"}}}}" for ball in balls]
    held = "".join(HELD.format(where=where) for where in wheres or ["{boundary = true}"])
    blood = BLOOD.format(**numbers)
    return SCENE.format(vessel=vessel, tissue=tissue, blood=blood, held=held, start=lengths(start), end=lengths(end), out=lengths(way),
                        inside=lengths(0 * way), factors=", ".join(f"{f:.4g}" for f in factors), **numbers)


files = [word for word in sys.argv[1:] if "=" not in word]
words = [word.split("=", 1) for word in sys.argv[1:] if "=" in word]
given = dict(word for word in words if word[0] != "hold")
held = [[float(x) for x in value.split(",")] for key, value in words if key == "hold"]
wrong = [key for key in given if key not in KEYS and key not in ("from", "to", "inflated")]
missing = [key for key in ("from", "to", "inflated") if key not in given]
if len(files) not in (2, 3) or wrong or missing:
    sys.exit(f"{__doc__}\nown.py: " + (f"unknown: {', '.join(wrong)}" if wrong else f"missing: {', '.join(missing) or 'VESSEL'}"))
Path(files[0], "scene.toml").write_text(scene(files[1], files[2] if len(files) > 2 else "", given, held), encoding="utf-8")
