"""Maps of reconstruction: small features in noisy voxels, sheets that nearly touch, sheets at an angle."""
import math

import numpy as np

from atlas import meshes
from atlas.charted import Axis, Border, Map
from atlas.judge import DEFAULT, Method
from meshes import Ply
from published import write_ply

# ----------------------------------------------------------------------------------------------------------- voxels


def ball_of_voxels(runner, _, diameter, noise, seed):
    """A ball of `diameter` voxels somewhere between them; of its border voxels, on both sides, `noise` are flipped."""
    rng = np.random.default_rng(seed)
    count = math.ceil(diameter) + 8
    centre = (count - 1) / 2 + rng.uniform(-0.5, 0.5, 3)
    index = np.stack(np.meshgrid(*3 * [np.arange(count)], indexing="ij"), axis=-1)
    inside = np.linalg.norm(index - centre, axis=-1) < diameter / 2
    border = np.zeros_like(inside)
    for axis in range(3):
        for step in (1, -1):
            border |= np.roll(inside, step, axis) != inside
    inside ^= border & (rng.random(inside.shape) < noise)
    header = (f"NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: {count} {count} {count}\n"
              "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: raw\n\n")
    with open(runner.path("ball.nrrd"), "wb") as file:
        file.write(header.encode() + inside.astype(np.uint8).tobytes("F"))
    result = runner.tool("extract", "ball.nrrd", "surface.ply", "--label", "1", "--largest", "--fill-cavities")
    return result["volume_mm3"] / (math.pi / 6 * diameter**3) - 1


BALL = Map(
    "ball-of-voxels", "A ball of voxels: the volume of its extracted surface",
    Axis("diameter in voxels", (1.5, 2, 3, 4, 6, 10, 20)),
    Axis("part of the border voxels flipped", (0, 0.02, 0.05, 0.1, 0.2, 0.4)),
    ball_of_voxels,
    "The ball that was sampled, its centre anywhere between the voxels.",
    (Border("diameter 6: a tenth of a voxel all around is 10 % of the volume", ((6, -1), (6, 1))),))

# ------------------------------------------------------------------------------------------------- nearly touching

# Maps of tunica-relax: its least-error fit and the rule of Comas 2010.
BARYCENTRE = Method("barycentre", "the rule of Comas 2010", {"method": "barycentre"})


def relaxed(runner, method, *options):
    """coarse.ply fitted to target.ply: the report's result, vertices and triangles of the curved surface."""
    result = runner.tool("relax", "coarse.ply", "target.ply", "shell.ply", "--curved", "curved.ply", "--method",
                         method.run.get("method", "fit"), *options)
    curved = Ply(runner.path("curved.ply"))
    return result, curved.vertices, curved.triangles

SAMPLES = 4  # points per edge at which shells are looked at


def together(*parts):
    """Several meshes as one."""
    points, triangles, first = [], [], 0
    for part_points, part_triangles in parts:
        points.append(part_points)
        triangles.append(part_triangles + first)
        first += len(part_points)
    return np.concatenate(points), np.concatenate(triangles)


def concentric_spheres(runner, method, gap, frequency, seed):
    """Two spheres, radii 10 and 10 (1 + gap), 20 frequency^2 shells each. How much farther the curved surface lies
    from the spheres than its certificate says; infinite where it crosses itself without a word."""
    rng = np.random.default_rng(seed)
    radii = (10.0, 10.0 * (1 + gap))
    for name, splits in (("target", 6), ("coarse", frequency)):
        parts = []
        for radius in radii:
            points, triangles, _ = meshes.sphere(splits, radius, rng)
            parts.append((points, triangles if radius > 10 else triangles[:, ::-1]))
        points, triangles = together(*parts)
        write_ply(runner.path(f"{name}.ply"), points, triangles)
        if name == "target":
            sag = radii[1] - np.linalg.norm(parts[1][0][parts[1][1]].mean(axis=1), axis=1).min()
    result, points, triangles = relaxed(runner, method, "--max-iterations", "1")
    outer = np.zeros(len(points), bool)
    outer[triangles[np.linalg.det(points[triangles]) > 0]] = True
    if result["self_intersections"] == 0 and crosses(points[~outer], points[outer]):
        return math.inf
    farthest = np.abs(np.linalg.norm(points, axis=1)[:, None] - np.array(radii)).min(axis=1).max()
    certified = result["one_sided_percent"]["shell_to_target"]["upper"] / 100 * result["diagonal_mm"]
    return max(0.0, (farthest - sag) / certified - 1)


def crosses(inner, outer):
    """Whether some of the inner points lies beyond the outer point nearest to its direction, by more than their
    directions differ times a slope of 0.2."""
    inner_radius, outer_radius = np.linalg.norm(inner, axis=1), np.linalg.norm(outer, axis=1)
    directions = outer / outer_radius[:, None]
    for k in np.argsort(-inner_radius)[:400]:
        if inner_radius[k] <= outer_radius.min():
            return False
        cosine = directions @ (inner[k] / inner_radius[k])
        near = cosine.argmax()
        if inner_radius[k] > outer_radius[near] * (1 + 0.2 * math.acos(min(1.0, cosine[near]))):
            return True
    return False


SPHERES = Map(
    "near-spheres", "Shells on two concentric spheres: their certified distance, and crossings",
    Axis("gap over radius", (1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1)),
    Axis("shells on each sphere", (1, 2, 3, 4), ("20", "80", "180", "320")),
    concentric_spheres,
    "The spheres: vertices of the curved surface must lie within the certified distance of the nearer one, and a "
    "crossing must be told.",
    (Border("gap = what the chords of equal facets leave out, h^2 / 6 R: flat facets of the outer cut the inner",
            tuple((4 * math.pi * 4 / math.sqrt(3) / (20 * f**2) / 6, f) for f in np.linspace(0.5, 5, 30))),),
    (DEFAULT, BARYCENTRE))

# ------------------------------------------------------------------------------------------------ sheets at an angle

SIDE, TOLERANCE = 10.0, 0.01  # mm; of twice the side


def sheet(cells, start, degrees, rng):
    """A square with a bulge of a tenth of its side, from `start` away from the z axis, turned about it."""
    u, v, triangles = meshes.lattice(cells, cells, rng)
    height = 0.1 * SIDE * np.sin(math.pi * u) * np.sin(math.pi * v)
    x, y = start + SIDE * u, height
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.stack([cos * x - sin * y, sin * x + cos * y, SIDE * v], axis=1), triangles


def angled_sheets(runner, method, gap, degrees, seed):
    """Edges `gap` tolerances apart, the sheets at an angle of `degrees`. How much farther the curved surface lies from
    them than the tolerance allows."""
    rng = np.random.default_rng(seed)
    tolerance = TOLERANCE * SIDE * 2
    start = gap * tolerance / 2 / math.sin(math.radians(degrees) / 2)
    turn = meshes.rotation(rng)
    for name, cells in (("target", 16), ("coarse", 4)):
        points, triangles = together(sheet(cells, start, 0, rng), sheet(cells, start, degrees, rng))
        write_ply(runner.path(f"{name}.ply"), points @ turn.T, triangles)
    result, points, _ = relaxed(runner, method, "--refine", "--tolerance", f"{tolerance!r}mm", "--max-shells", "2000")
    truth, _ = together(*(sheet(96, start, angle, np.random.default_rng(0)) for angle in (0, degrees)))
    points = rng.choice(points, min(2000, len(points)), replace=False) @ turn
    nearest = max(((part[:, None] - truth[None])**2).sum(axis=2).min(axis=1).max()
                  for part in np.array_split(points, 40))
    # The nearest of the sampled points may be half a diagonal of their grid beside the nearest of the sheet.
    farthest = math.sqrt(max(0.0, nearest - (SIDE / 96)**2))
    return max(0.0, farthest / tolerance - 1) if result["hausdorff_mm"]["upper"] <= tolerance else math.inf


SHEETS = Map(
    "angled-sheets", "Two bulged sheets at an angle, apart at one edge: shells within a tolerance",
    Axis("gap over tolerance", (0.03, 0.1, 0.3, 1, 3, 10)),
    Axis("angle between the sheets, degrees", (5, 15, 45, 90, 150)),
    angled_sheets,
    "The sheets: points of the curved surface must lie within the tolerance of them.",
    (Border("gap = tolerance: below, one sheet may lie within the tolerance of the other", ((1, 1e-3), (1, 1e5))),),
    (DEFAULT, BARYCENTRE))

MAPS = [BALL, SPHERES, SHEETS]
