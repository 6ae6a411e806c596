"""The map of time integration: one mode of a sphere under a pressure that rises and stays."""
import math

import h5py
import numpy as np

from atlas import meshes
from atlas.charted import Axis, Border, Map
from atlas.judge import DEFAULT, PAPER, RIGID, Method
from atlas.statics import POISSON, RADIUS, YOUNG, body, inflation
from published import load, run_lines

DENSITY, SLENDERNESS, LOAD = 1e-9, 10, 1e-3  # t/mm3, R / t, p R / (E t)
OMEGA = math.sqrt(2 * YOUNG / ((1 - POISSON) * DENSITY * RADIUS**2))  # of the breathing sphere
PERIOD = 2 * math.pi / OMEGA
SECOND_ORDER = Method("second-order", "generalised-alpha", {"integrator": "generalised-alpha"})


def peak(ramp, until):
    """Largest displacement over the static one of an undamped oscillator under a load that rises in `ramp`; both in
    periods."""
    time = np.linspace(0, until, 20001)
    angle = 2 * math.pi * time
    if ramp == 0:
        return (1 - np.cos(angle)).max()
    rise = time - np.sin(angle) / (2 * math.pi)
    later = np.maximum(time - ramp, 0)
    return ((rise - later + np.sin(2 * math.pi * later) / (2 * math.pi)) / ramp).max()


def loaded_oscillator(runner, method, step, ramp, seed):
    """`step`, `ramp`: in periods. The largest mean strain during the ramp and two periods."""
    steps = math.ceil((ramp + 2) / step)
    thickness = RADIUS / SLENDERNESS
    rising = f"ramp = [[\"0s\", 0.0], [\"{ramp * PERIOD!r}s\", 1.0]]\n" if ramp > 0 else ""
    scene = (run_lines(kind="dynamic", duration=f"{steps * step * PERIOD!r}s", step=f"{step * PERIOD!r}s",
                       every=max(1, round(0.05 / step)), **method.run) +
             body(method, thickness, POISSON, density="1000kg/m3") + RIGID +
             load("pressure", f"{LOAD * YOUNG / SLENDERNESS!r}MPa", more=rising))
    runner.simulate(scene, meshes.sphere(3, RADIUS, np.random.default_rng(seed)))
    with h5py.File(runner.path("result.hdf")) as file:
        volume = file["tunica/history/volume"][()]
    return (np.cbrt(volume.max() / volume[0]) - 1) / inflation(LOAD) / peak(ramp, steps * step) - 1


OSCILLATOR = Map(
    "oscillator", "A sphere under a pressure that rises and stays: its largest volume",
    Axis("step over the period", (0.01, 0.03, 0.1, 0.3, 1, 3)),
    Axis("rise over the period", (0, 0.3, 1, 3, 10)),
    loaded_oscillator,
    "The undamped oscillator of one mode, w^2 = 2 E / ((1 - nu) rho R^2), during the rise and two periods.",
    (Border("rise = period / (0.1 pi): above, what swings on is below 10 % of the static answer",
            ((1e-3, 1 / (0.1 * math.pi)), (10, 1 / (0.1 * math.pi)))),
     Border("10 % of the swing lost in half a period: pi^2 step / period = 0.1, backward Euler",
            ((0.1 / math.pi**2, -1), (0.1 / math.pi**2, 20)))),
    (DEFAULT, SECOND_ORDER, Method(PAPER.name, PAPER.title, {**PAPER.run, "newton_max": 1}, PAPER.shell)))

MAPS = [OSCILLATOR]
