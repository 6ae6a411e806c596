"""Maps of statics: spheres under pressure from within and from outside, plates, long thin elements, rings."""
import math

import h5py
import numpy as np

from atlas import meshes
from atlas.charted import Axis, Border, Map
from atlas.judge import DEFAULT, PAPER, RIGID
from published import fix, load, probe, run_lines, shell

YOUNG, RADIUS = 1.0, 10.0  # MPa, mm


def statics(method, **more):
    return run_lines(kind="static", **more, **method.run)


def body(method, thickness, poisson, mesh="mesh.ply", **more):
    return shell(mesh, repr(float(thickness)), YOUNG, float(poisson), **method.shell, **more)


def pressure(value):
    return load("pressure", f"{float(value)!r}MPa")


def worse(*ratios):
    """The error of the ratio that is farthest from one."""
    return max((ratio - 1 for ratio in ratios), key=lambda error: abs(error) if math.isfinite(error) else math.inf)


# ------------------------------------------------------------------------------------------- a sphere under pressure

POISSON = 0.3
LIMIT = 1 / (2 * (1 - POISSON))  # of p R / (E t): beyond, a sphere of this material has no equilibrium


def thick_over_thin(slenderness, outside=False):
    """Lamé's sphere under pressure on one face: displacement of the middle surface, relative to thin shells."""
    inner, outer = (1 - 0.5 / slenderness)**3, (1 + 0.5 / slenderness)**3
    pressed, free = (outer, inner) if outside else (inner, outer)
    thick = pressed / (outer - inner) * (1 - 2 * POISSON + (1 + POISSON) / 2 * free)
    return thick / ((1 - POISSON) / 2 * slenderness)


def inflation(load_number):
    """Strain e of a thin sphere, linear in its engineering strains: p R / (E t) = 2 / (1 - nu) e / (1 + e)^2."""
    q = load_number * (1 - POISSON) / 2
    return math.inf if 4 * q > 1 else 2 * q / (1 - 2 * q + math.sqrt(1 - 4 * q))


def sphere_of(runner, method, frequency, slenderness, load_number, seed):
    """@return measured strains: of the volume, of the farthest point"""
    rng = np.random.default_rng(seed)
    thickness = RADIUS / slenderness
    result = runner.simulate(statics(method) + body(method, thickness, POISSON) + RIGID +
                             pressure(load_number * YOUNG * thickness / RADIUS),
                             meshes.sphere(frequency, RADIUS, rng))
    volume = float(np.cbrt(result["volume_after_mm3"] / result["volume_before_mm3"])) - 1
    return volume, math.copysign(result["max_displacement_mm"] / RADIUS, volume)


def inflated_sphere(runner, method, slenderness, load_number, seed):
    found = sphere_of(runner, method, 4, slenderness, load_number, seed)
    expected = inflation(load_number * thick_over_thin(slenderness))
    return worse(*(strain / expected for strain in found)) if math.isfinite(expected) else math.inf


INFLATED = Map(
    "inflated-sphere", "A sphere of 320 shells under pressure from within",
    Axis("R / t", (2, 4, 7, 10, 30, 100, 1000, 10000)),
    Axis("p R / (E t)", (1e-6, 1e-4, 1e-2, 0.3, 0.8)),
    inflated_sphere,
    "Thin sphere of a material linear in engineering strains; at the inner face of thick walls the pressure acts as "
    "in Lamé's solution. Beyond the limit load there is no equilibrium, and any answer is wrong.",
    (Border("h^2 = 3 R t", ((3 / 0.3**2, 1e-9), (3 / 0.3**2, 1e3))),
     Border(f"limit load, p R / (E t) = 1 / (2 (1 - nu)) = {LIMIT:.3f}", ((1, LIMIT), (1e5, LIMIT)))),
    (DEFAULT, PAPER))


# --------------------------------------------------------------------------------------------------- outside pressure

def shrunken_sphere(runner, method, mesh_number, load_factor, seed):
    """At `load_factor` times the classical buckling pressure; `mesh_number` = h / sqrt(R t)."""
    frequency = 5
    edge = math.sqrt(4 * math.pi / (20 * frequency**2) * 4 / math.sqrt(3))  # of equal triangles, R = 1
    slenderness = (mesh_number / edge)**2
    critical = 2 / math.sqrt(3 * (1 - POISSON**2)) / slenderness  # p R / (E t)
    found = sphere_of(runner, method, frequency, slenderness, -load_factor * critical, seed)
    if load_factor > 1:
        return math.inf
    expected = inflation(-load_factor * critical * thick_over_thin(slenderness, outside=True))
    return worse(*(strain / expected for strain in found))


SHRUNKEN = Map(
    "shrunken-sphere", "A sphere of 500 shells under pressure from outside",
    Axis("h / sqrt(R t)", (0.7, 1.0, 1.5, 2.5, 5.0)),
    Axis("p / p_cr", (0.1, 0.4, 0.7, 0.95, 1.2)),
    shrunken_sphere,
    "Thin sphere, by Lamé's solution for the outer face where it is thick; p_cr = 2 E / sqrt(3 (1 - nu^2)) (t / R)^2 "
    "(Zoelly). Above it the sphere collapses, and an answer without a word of that is wrong.",
    (Border("p = p_cr, the classical buckling pressure of the perfect sphere", ((1e-3, 1), (1e3, 1))),
     Border("h^2 = 3 R t: waves as short as the elements have no membrane strain", ((3**0.5, 1e-3), (3**0.5, 1e2)))),
    (DEFAULT, PAPER))


# -------------------------------------------------------------------------------------------------------------- plates

RINGS = 8


def clamped_disc(runner, method, relative_thickness, poisson, seed):
    """`relative_thickness` = t / h; the deflection of the middle, by the moment of Mindlin's plate."""
    rng = np.random.default_rng(seed)
    edge = RADIUS / RINGS
    thickness = relative_thickness * edge
    mesh = meshes.disc(RINGS, RADIUS, rng)
    rigidity = YOUNG * thickness**3 / 12 / (1 - poisson**2)
    shear = 3.2 / (1 - poisson) * (thickness / RADIUS)**2
    deflection = 1e-6 * edge
    push = deflection / (RADIUS**4 / (64 * rigidity) * (1 + shear))
    result = runner.simulate(
        statics(method, geometry="linear") + body(method, thickness, poisson) +
        "[[fix]]\nbody = \"s\"\nwhere = {boundary = true}\ntranslation = \"xyz\"\nrotation = \"xyz\"\n" +
        load("pressure", f"{float(push)!r}MPa", more="follower = false\n"), mesh)
    return result["max_displacement_mm"] / deflection - 1


DISC = Map(
    "clamped-disc", f"A clamped disc of {6 * RINGS**2} shells under a small pressure",
    Axis("t / h", (1e-5, 1e-3, 0.1, 0.5, 1.0, 1.5, 2.0)),
    Axis("Poisson's ratio", (-0.9, 0.0, 0.3, 0.45, 0.49, 0.499)),
    clamped_disc,
    "Plate of Mindlin, w = p a^4 / (64 D) (1 + 3.2 / (1 - nu) (t / a)^2); h = a / 8.",
    (Border("where shear, which thin shells leave out, is 10 % of the deflection",
            tuple((RINGS * math.sqrt((1 - nu) / 9 / 3.2), nu) for nu in np.linspace(-0.99, 0.4999, 40))),),
    (DEFAULT, PAPER))


# --------------------------------------------------------------------------------------------- long, narrow elements

LENGTH, COLUMNS = 10.0, 20  # of a strip cut from a cylinder, two cells wide


def strip(aspect, degrees, rng):
    """@return the mesh, width, nodes of the clamped end and of the free one, its middle, centre line and its frame
    there (tangent, normal of the surface, across) at 201 points"""
    width = 2 * LENGTH / COLUMNS / aspect
    u, v, triangles = meshes.lattice(COLUMNS, 2, rng)
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))

    def surface(along, across):
        arc = (along * sin + across * cos) / RADIUS
        radial = np.stack([np.cos(arc), np.sin(arc), 0 * arc], axis=-1)
        axial = along * cos - across * sin
        return RADIUS * radial + axial[..., None] * np.array([0, 0, 1.0]), radial

    turn = meshes.rotation(rng)
    points, normals = surface(LENGTH * u, width * (v - 0.5))
    corner = points[triangles[0]]
    if np.cross(corner[1] - corner[0], corner[2] - corner[0]) @ normals[triangles[0][0]] < 0:
        triangles = triangles[:, ::-1]
    mesh = meshes.turned((points, triangles, normals), turn)
    line, normal = surface(np.linspace(0, LENGTH, 201), np.zeros(201))
    tangent = np.gradient(line, LENGTH / 200, axis=0, edge_order=2)
    frame = [part @ turn.T for part in (line, tangent, normal, np.cross(tangent, normal))]
    start, end = np.flatnonzero(u < 1e-9), np.flatnonzero(u > 1 - 1e-9)
    return mesh, width, start, end, end[np.argmin(np.abs(v[end] - 0.5))], frame


def rod_compliance(frame, width, thickness, degrees):
    """Deflection of the end of a clamped rod per force along the normal there: Kirchhoff's rod with the section of the
    strip, whose arc stiffens it, and Saint-Venant's torsion; nu = 0."""
    line, tangent, normal, across = frame
    force = normal[-1]
    moment = np.cross(line[-1] - line, force)
    sag = width**2 * math.cos(math.radians(degrees))**2 / (8 * RADIUS)
    soft = width * thickness**3 / 12 + thickness * width * sag**2 * 4 / 45
    torsion = width * thickness**3 / 3 * (1 - 0.63 * thickness / width) / 2
    stiff = thickness * width**3 / 12
    density = sum(np.einsum("ij,ij->i", moment, axis)**2 / stiffness
                  for axis, stiffness in ((across, soft), (tangent, torsion), (normal, stiff)))
    return np.trapz(density, dx=LENGTH / 200) / YOUNG


def bent_strip(runner, method, aspect, degrees, seed):
    mesh, width, start, end, middle, frame = strip(aspect, degrees, np.random.default_rng(seed))
    thickness = width / 10
    force = 1e-6 * LENGTH / rod_compliance(frame, width, thickness, degrees) * frame[2][-1]
    result = runner.simulate(statics(method, geometry="linear") + body(method, thickness, 0) + fix(start) +
                             load("force", [float(part) for part in force], "N", end) +
                             probe("end", [float(part) for part in mesh[0][middle]]), mesh)
    return np.array(result["probes"]["end"]["displacement_mm"][-1]) @ frame[2][-1] / (1e-6 * LENGTH) - 1


STRIP = Map(
    "narrow-elements", "A strip of a cylinder, cut along its long elements, bent by a force at its end",
    Axis("length over height of the elements", (1, 3, 10, 30, 100, 1000)),
    Axis("from the cylinder's axis, degrees", (0, 22.5, 45, 67.5, 90)),
    bent_strip,
    "Kirchhoff's rod along the strip, integrated; h = R / 20, width of two elements, a tenth as thick, nu = 0.",
    (Border("h^2 = 3 R t, h the length of the elements", ((12, -100), (12, 200))),),
    (DEFAULT, PAPER))

# -------------------------------------------------------------------------------------- a ring from tension to suction

AROUND, OVALITY = 32, 0.05  # nodes; amplitude of its ovality, of the thickness
# A free ring under pressure from within, without lids, leaves its plane.
FLAT = "[[fix]]\nbody = \"s\"\nwhere = {all = true}\ntranslation = \"z\"\nrotation = \"xy\"\n"


def buckled_ring(load_factor):
    """Amplitude of the ovality over R of an inextensible ring at `load_factor` > 1 times its buckling pressure
    3 E I / R^3 (Tadjbakhsh, Odeh): shooting over a quarter of the ring, with R = E I = 1."""
    push = 3 * load_factor

    def end_of(curvature, tension):
        state = np.array([0, 0, math.pi / 2, curvature, tension, 0.0])  # x, y, angle, curvature, tension, shear

        def rate(s):
            return np.array([math.cos(s[2]), math.sin(s[2]), s[3], -s[5], s[3] * s[5], -s[3] * s[4] - push])

        step = math.pi / 2 / 200
        for _ in range(200):
            a = rate(state)
            b = rate(state + step / 2 * a)
            c = rate(state + step / 2 * b)
            state = state + step / 6 * (a + 2 * b + 2 * c + rate(state + step * c))
        return state

    unknown = np.array([1 + 3 * math.sqrt(load_factor - 1), -push * (1 + 0.6 * math.sqrt(load_factor - 1))])
    for _ in range(40):
        def missing(values):
            state = end_of(*values)
            return np.array([state[2] - math.pi, state[5]])

        residual = missing(unknown)
        slopes = np.column_stack([(missing(unknown + d) - residual) / 1e-6 for d in np.eye(2) * 1e-6])
        change = np.linalg.solve(slopes, residual)
        unknown = unknown - change / max(1, 5 * np.abs(change).max())
    end = end_of(*unknown)
    return (-end[0] - end[1]) / 2  # half axes: from the start to the middle, and the height


def ring_under_pressure(runner, method, load_factor, slenderness, seed):
    """`load_factor`: pressure from within over the pressure from outside that buckles the ring."""
    rng = np.random.default_rng(seed)
    thickness = RADIUS / slenderness
    u, v, triangles = meshes.lattice(AROUND, 2, rng, closed=True)
    quarters = 3 * np.arange(0, AROUND, AROUND // 4)[:, None] + np.arange(3)
    u[quarters] = np.arange(4)[:, None] / 4
    angle, width = 2 * math.pi * u, 4 * math.pi * RADIUS / AROUND
    start = OVALITY * thickness
    r, slope = RADIUS + start * np.cos(2 * angle), -2 * start * np.sin(2 * angle)
    cos, sin = np.cos(angle), np.sin(angle)
    points = np.stack([r * cos, r * sin, width * (v - 0.5)], axis=1)
    normals = np.stack([r * cos + slope * sin, r * sin - slope * cos, 0 * r], axis=1)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    critical = YOUNG / 4 * slenderness**-3
    axes = quarters[:, 1]
    runner.simulate(statics(method) + body(method, thickness, 0) + FLAT + fix(axes[[0, 2]], "y", "") +
                    fix(axes[[1]], "x", "") + pressure(load_factor * critical), (points, triangles, normals))
    with h5py.File(runner.path("result.hdf")) as file:
        moved = file["tunica/nodes/displacement"][-1]
    radial = moved[:, 0] * cos + moved[:, 1] * sin
    at = radial[quarters].mean(axis=1)
    found = (at[0] - at[1] + at[2] - at[3]) / 4
    if load_factor > -1:
        return found / (-start * load_factor / (1 + load_factor)) - 1
    return found / (RADIUS * buckled_ring(-load_factor)) - 1


RING = Map(
    "ring", f"A slightly oval ring of {4 * AROUND} shells from prestress to suction",
    Axis("pressure from within over the buckling pressure", (-1.2, -0.8, -0.4, 0.5, 5, 50)),
    Axis("R / t", (10, 30, 100, 300, 1000)),
    ring_under_pressure,
    "Change of the ovality w0 cos 2a under the pressure f p_cr, p_cr = E t^3 / (4 R^3): -w0 f / (1 + f) (Timoshenko); "
    "buckled: the inextensible ring, integrated (Tadjbakhsh, Odeh). nu = 0, w0 = t / 20; the ring stays in its plane.",
    (Border("p = -p_cr: the ring buckles", ((-1, 1), (-1, 1e5))),
     Border("h^2 = 3 R t", ((-10, 3 / 0.196**2), (100, 3 / 0.196**2)))),
    (DEFAULT, PAPER))

# ------------------------------------------------------------------------------------------------- noise of the normals

NOISY_SLENDERNESS, NOISY_LOAD = 20, 1e-3


def noisy_normals(runner, method, edge, degrees, seed):
    rng = np.random.default_rng(seed)
    frequency = round(1.2 / edge)
    points, triangles, normals = meshes.sphere(frequency, RADIUS, rng)
    normals = normals + math.radians(degrees) * rng.normal(size=normals.shape)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    thickness = RADIUS / NOISY_SLENDERNESS
    result = runner.simulate(statics(method) + body(method, thickness, POISSON) + RIGID +
                             pressure(NOISY_LOAD * YOUNG / NOISY_SLENDERNESS), (points, triangles, normals))
    volume = float(np.cbrt(result["volume_after_mm3"] / result["volume_before_mm3"])) - 1
    return worse(*(strain / inflation(NOISY_LOAD * thick_over_thin(NOISY_SLENDERNESS))
                   for strain in (volume, result["max_displacement_mm"] / RADIUS)))


NOISE = Map(
    "noisy-normals", "A sphere under pressure, its nodes exact, its normals noisy",
    Axis("h / R", (0.12, 0.2, 0.3, 0.4, 0.6)),
    Axis("noise of the normals, degrees", (0, 0.3, 1, 3, 10, 30)),
    noisy_normals,
    "Thin sphere, R / t = 20, p R / (E t) = 0.001; the noise is normal, per component. A flaw of depth d makes "
    "a shallow sphere move up to 2.4 d / t farther.",
    (Border("2.4 d / t = 10 %, with flaws of depth d = h x noise / 8",
            tuple((h, math.degrees(1 / (3 * NOISY_SLENDERNESS * h))) for h in np.linspace(0.05, 0.8, 40))),))

# --------------------------------------------------------------------------------------------------- units and lengths

UNITS = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0}


def sphere_in_unit(runner, method, diagonal, unit, seed):
    """`diagonal` in units; the mesh is an OBJ file, which carries none."""
    name, size = list(UNITS.items())[unit]
    radius = diagonal / (2 * math.sqrt(3))
    points, triangles, _ = meshes.sphere(8, radius, np.random.default_rng(seed))
    runner.write("mesh.obj", "".join(f"v {x:.17g} {y:.17g} {z:.17g}\n" for x, y, z in points) +
                 "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in triangles))
    unitless = body(method, radius * size / 10, POISSON, "mesh.obj")
    result = runner.simulate(statics(method) + f"{unitless}unit = \"{name}\"\n" + RIGID + pressure(1e-4 * YOUNG))
    volume = float(np.cbrt(result["volume_after_mm3"] / result["volume_before_mm3"])) - 1
    expected = inflation(1e-3 * thick_over_thin(10))
    return worse(volume / expected, result["max_displacement_mm"] / (radius * size) / expected)


SIZES = Map(
    "units", "The same sphere of 1,280 flat facets in files of any unit and size",
    Axis("diagonal, in the unit of the file", (1e-6, 1e-3, 1, 1e3, 1e6)),
    Axis("unit", (0, 1, 2, 3), tuple(UNITS)), sphere_in_unit,
    "Thin sphere, R / t = 10, p R / (E t) = 0.001: the same answer in every cell.")

MAPS = [INFLATED, SHRUNKEN, DISC, STRIP, NOISE, RING, SIZES]
