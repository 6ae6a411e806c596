#!/usr/bin/python3
"""Pictures of any result of tunica-simulate: shells, tetrahedra and rigid bodies, cut open if wanted, without a display.

    draw.py RESULT.hdf OUT.png [--at 0 0.25 0.5 1] [--cut y=0] [--view 0.4 1 0.5] [--up 0 0 1] [--most 0.2]

One panel for each place in --at, left to right, then down: the load factor, seconds of a motion, the frequency or factor of
a mode; the nearest written state is drawn (default: the last one). Colours are the von Mises stress, from 0 (blue) to
--most MPa (red; default: what 1 % of the points of all panels pass). Rigid bodies are grey; rigid meshes are not drawn.
--cut y=1 leaves what lies at y < 1, --cut=-y=1 what lies at y > 1; without a number the cut is in the middle of the bodies.
Shells are drawn a little before what they lie on. Needs python3-vtk9 and python3-h5py.
"""
import argparse
import re
import struct
import sys
import tomllib
import zlib

import h5py
import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

PANEL = (560, 420)  # pixels
FINER = 2           # samples per pixel and direction
COLOURS = np.array([(0.15, 0.25, 0.55), (0.2, 0.6, 0.65), (0.98, 0.85, 0.4), (0.75, 0.12, 0.15)])
PLACES = (0, 0.35, 0.7, 1)
GREY = (0.62, 0.62, 0.66)
PIECES = 4          # of the edge of a shell
UNITS = {"um": 1e-3, "mm": 1, "cm": 10, "m": 1000, "us": 1e-6, "ms": 1e-3, "s": 1, "min": 60}  # to mm and s


def filtered(algorithm, data):
    algorithm.SetInputData(data)
    algorithm.Update()
    return algorithm.GetOutput()


def patches(corners, normals):
    """Points of the watertight patches (docs/reconstruction.md) of triangles at barycentric(PIECES), without their rule at creases.
    @param corners, normals  triangles x 3 x 3
    """
    def control(a, b):
        edge = corners[:, b] - corners[:, a]
        length = np.linalg.norm(edge, axis=1, keepdims=True)
        tangent = edge - np.sum(edge * normals[:, a], axis=1, keepdims=True) * normals[:, a]
        size = np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12 * length)
        return corners[:, a] + 2 * length / (3 * (1 + size / length)) * tangent / size

    pairs = [(a, b) for a in range(3) for b in range(3) if a != b]
    controls = {(a, b): control(a, b) for a, b in pairs}

    def middle_without_xxy(a, b, c):
        edge, side = corners[:, b] - corners[:, a], corners[:, c] - corners[:, a]
        s = np.sum(edge * side, axis=1, keepdims=True) / np.sum(edge * edge, axis=1, keepdims=True)
        at_a = corners[:, a] - 2 * controls[a, b] + controls[b, a]
        at_b = corners[:, b] - 2 * controls[b, a] + controls[a, b]
        return ((s - 1) * at_a - s * at_b + controls[a, c] + controls[b, c]) / 2

    middle = np.mean([middle_without_xxy(*turn) for turn in ((0, 1, 2), (1, 2, 0), (2, 0, 1))], axis=0)
    weights = barycentric(PIECES)
    points = np.einsum("sk,tkc->tsc", weights ** 3, corners) + 6 * np.prod(weights, axis=1)[None, :, None] * middle[:, None]
    for a, b in pairs:
        points += (3 * weights[:, a] ** 2 * weights[:, b])[None, :, None] * controls[a, b][:, None]
    return points


def turned(vectors, rotations):
    """Vectors turned by rotation vectors."""
    angle = np.linalg.norm(rotations, axis=-1, keepdims=True)
    axis = rotations / np.maximum(angle, 1e-30)
    return (np.cos(angle) * vectors + np.sin(angle) * np.cross(axis, vectors)
            + (1 - np.cos(angle)) * np.sum(axis * vectors, axis=-1, keepdims=True) * axis)


def at_nodes(count, cells, values, sizes):
    """Mean of the cells' values at their nodes, by size."""
    total, weight = np.zeros(count), np.zeros(count)
    for corner in cells.T:
        np.add.at(total, corner, sizes * values)
        np.add.at(weight, corner, sizes)
    return total / np.maximum(weight, 1e-300)


def small_triangles():
    """Rows of barycentric(PIECES) of the triangles between its points."""
    def counts(n):
        return np.rint(n * barycentric(n)).astype(int)

    index, unit = {tuple(point): i for i, point in enumerate(counts(PIECES))}, np.eye(3, dtype=int)
    corners = [point + unit for point in counts(PIECES - 1)] + [point + 1 - unit for point in counts(PIECES - 2)]
    return np.array([[index[tuple(corner)] for corner in triangle] for triangle in corners])


def shell_cells(part, state, moved):
    """@return points of the curved shells, their stress, and triangles; neighbours share what lies on their edge"""
    nodes = part["elements/nodes"][()].astype(int)
    rotation = part["nodes/rotation"][state][nodes]
    points = patches(moved[nodes], turned(part["elements/normals"][()].reshape(-1, 3, 3), rotation))
    faces = [at_nodes(len(moved), nodes, part[f"elements/von_mises_{face}"][state], part["elements/area"][()]) for face in ("top", "bottom")]
    weights = barycentric(PIECES)
    stress = np.maximum(*faces)[nodes] @ weights.T

    # A name for every point: the nodes that it lies between with its parts of them, or its shell where it is inside.
    parts = np.rint(PIECES * weights).astype(int)
    names = np.zeros((*points.shape[:2], 6), int)
    for i, share in enumerate(parts):
        some = share > 0
        if some.all():
            names[:, i, 0], names[:, i, 1] = -1 - np.arange(len(nodes)), i
            continue
        between, shares = nodes[:, some], np.broadcast_to(share[some], (len(nodes), some.sum()))
        order = np.argsort(between, axis=1)
        names[:, i, :some.sum()] = np.take_along_axis(between, order, 1)
        names[:, i, 3:3 + some.sum()] = np.take_along_axis(shares, order, 1)
    _, first, place = np.unique(names.reshape(-1, 6), axis=0, return_index=True, return_inverse=True)
    triangles = place.reshape(len(nodes), -1)[:, small_triangles()].reshape(-1, 3)
    return points.reshape(-1, 3)[first], stress.reshape(-1)[first], triangles


def solid_cells(part, state, moved):
    """@return the nodes, their stress, and the tetrahedra"""
    nodes = part["tetrahedra/nodes"][()].astype(int)
    corners = part["nodes/position"][()][nodes]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    return moved, at_nodes(len(moved), nodes, part["tetrahedra/solid_von_mises"][state], volume), nodes


def deformed(part, state):
    """Shells and tetrahedra of one state, with `von_mises` and `of_shell` at the points.
    @param part  /tunica of the result
    """
    moved = part["nodes/position"][()] + part["nodes/displacement"][state]
    pieces = [(kind, *cells(part, state, moved)) for kind, name, cells in
              ((vtk.VTK_TRIANGLE, "elements", shell_cells), (vtk.VTK_TETRA, "tetrahedra", solid_cells)) if name in part]
    grid, points, before = vtk.vtkUnstructuredGrid(), vtk.vtkPoints(), 0
    points.SetData(numpy_to_vtk(np.concatenate([p for _, p, *_ in pieces]), deep=True))
    grid.SetPoints(points)
    rows, kinds = [], []
    for kind, own, _, cells in pieces:
        rows.append(np.column_stack([np.full(len(cells), cells.shape[1]), cells + before]).ravel())
        kinds.append(np.full(len(cells), kind, np.uint8))
        before += len(own)
    cells = vtk.vtkCellArray()
    cells.ImportLegacyFormat(numpy_to_vtkIdTypeArray(np.concatenate(rows).astype(np.int64), deep=True))
    grid.SetCells(numpy_to_vtk(np.concatenate(kinds), deep=True), cells)
    for name, values in (("von_mises", [np.nan_to_num(stress) for _, _, stress, _ in pieces]),
                         ("of_shell", [np.full(len(own), float(kind == vtk.VTK_TRIANGLE)) for kind, own, *_ in pieces])):
        array = numpy_to_vtk(np.concatenate(values), deep=True)
        array.SetName(name)
        grid.GetPointData().AddArray(array)
    return grid


def polydata(grid, kind):
    """The surface of the cells of one kind (vtk.VTK_TRIANGLE: the shells; vtk.VTK_TETRA)."""
    some = vtk.vtkExtractCells()
    cells = vtk.vtkIdList()
    for cell in range(grid.GetNumberOfCells()):
        if grid.GetCellType(cell) == kind:
            cells.InsertNextId(cell)
    some.SetCellList(cells)
    return filtered(vtk.vtkTriangleFilter(), filtered(vtk.vtkGeometryFilter(), filtered(some, grid)))


def surface(data, cut):
    """@return points, normals, triangles, and at the points which are a shell's and `von_mises` (None: it has neither)"""
    if cut:
        plane = vtk.vtkPlane()
        axis, _, at = cut.removeprefix("-").partition("=")
        normal = np.eye(3)["xyz".index(axis)]
        plane.SetNormal(*(-normal if cut.startswith("-") else normal))
        plane.SetOrigin(*(float(at or 0) * normal))
        clip = vtk.vtkClipDataSet() if data.IsA("vtkUnstructuredGrid") else vtk.vtkClipPolyData()
        clip.SetClipFunction(plane)
        clip.InsideOutOn()
        data = filtered(clip, data)
    if data.IsA("vtkUnstructuredGrid"):
        data = filtered(vtk.vtkGeometryFilter(), data)
    data = filtered(vtk.vtkTriangleFilter(), data)
    normals = vtk.vtkPolyDataNormals()
    normals.SetFeatureAngle(40)
    data = filtered(normals, data)
    stress = data.GetPointData().GetArray("von_mises")
    if data.GetNumberOfPolys() == 0:
        sys.exit(f"draw.py: --cut {cut} leaves nothing: give it a place between the ends of the bodies, or none for their middle")
    triangles = vtk_to_numpy(data.GetPolys().GetData()).reshape(-1, 4)[:, 1:]
    return (vtk_to_numpy(data.GetPoints().GetData()).astype(float), vtk_to_numpy(data.GetPointData().GetNormals()).astype(float),
            triangles, None if stress is None else vtk_to_numpy(data.GetPointData().GetArray("of_shell")) > 0.5,
            None if stress is None else vtk_to_numpy(stress).astype(float))


def in_unit(text):
    """Of a length or time in the resolved scene: mm or s; of a plain number itself."""
    number, unit = re.fullmatch(r"\s*([-+0-9.eE]+?)\s*([a-z]*)\s*", str(text)).groups()
    return float(number) * (UNITS[unit] if unit else 1)


def at_place(value, place, read):
    """A quantity of the scene, or a table of [place, quantity]."""
    if isinstance(value, list) and isinstance(value[0], list):
        rows = [(in_unit(t), read(v)) for t, v in value]
        times = [t for t, _ in rows]
        return np.array([np.interp(place, times, c) for c in np.array([np.atleast_1d(v) for _, v in rows]).T])
    return np.atleast_1d(read(value))


def lengths(value):
    return np.array([in_unit(v) for v in value])


def turned_about(axis, profile):
    """Polydata of a profile (along the axis, radius) turned about a unit vector through the origin."""
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    around = 2 * np.pi * np.arange(48) / 48
    profile = np.array(profile, float)
    width = np.max(profile[:, 1]) * 2 * np.pi / 48
    pieces = [max(1, int(np.linalg.norm(b - a) / (4 * width))) for a, b in zip(profile, profile[1:])]  # long triangles are slow
    profile = np.concatenate([*(np.linspace(a, b, n, endpoint=False) for n, a, b in zip(pieces, profile, profile[1:])), profile[-1:]])
    rings = np.array([[h * axis + r * (np.cos(a) * side + np.sin(a) * other) for a in around] for h, r in profile])
    points, cells = vtk.vtkPoints(), vtk.vtkCellArray()
    points.SetData(numpy_to_vtk(rings.reshape(-1, 3), deep=True))
    for i in range(len(profile) - 1):
        for k in range(48):
            cells.InsertNextCell(4)
            for j in (48 * i + k, 48 * i + (k + 1) % 48, 48 * (i + 1) + (k + 1) % 48, 48 * (i + 1) + k):
                cells.InsertCellPoint(j)
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    data.SetPolys(cells)
    return data


def rigid_bodies(scene, place, size):
    """Polydata of the spheres, capsules and cylinders at a load factor or time; of planes a square."""
    bodies = []
    for rigid in scene.get("rigid", []):
        moved = at_place(rigid["motion"], place, lengths) if "motion" in rigid else np.zeros(3)
        shape = rigid.get("shape")
        if shape is None:
            continue
        if shape == "plane":
            axis, middle = np.array(rigid["normal"], float), at_place(rigid["point"], place, lengths) + moved
            profile = [(0, 0), (0, size)]
        else:
            radius = at_place(rigid["radius"], place, in_unit)[0]
            ends = [at_place(rigid[key], place, lengths) + moved for key in (("from", "to") if shape != "sphere" else ("centre", "centre"))]
            middle, axis = (ends[0] + ends[1]) / 2, ends[1] - ends[0]
            half = np.linalg.norm(axis) / 2
            axis = axis / (2 * half) if half > 0 else np.array([0.0, 0.0, 1.0])
            angles = np.linspace(0, np.pi / 2, 13)
            if shape == "cylinder":
                profile = [(-half, 0), (-half, radius), (half, radius), (half, 0)]
            else:
                profile = ([(-half - radius * np.cos(a), radius * np.sin(a)) for a in angles]
                           + [(half + radius * np.cos(a), radius * np.sin(a)) for a in angles[::-1]])
        body = turned_about(axis, profile)
        points = vtk_to_numpy(body.GetPoints().GetData())
        points += middle
        bodies.append(body)
    return bodies


def barycentric(n):
    return np.array([(i / n, j / n, (n - i - j) / n) for i in range(n + 1) for j in range(n + 1 - i)])


class Panel:
    """Parallel projection of triangles onto a raster with depths."""

    def __init__(self, frame, centre, scale):
        self.frame, self.centre, self.scale = frame, centre, scale * FINER
        self.width, self.height = PANEL[0] * FINER, PANEL[1] * FINER
        self.colour = np.ones((self.height * self.width, 3))
        self.depth = np.full(self.height * self.width, -np.inf)

    def add(self, points, normals, triangles, colours, lift=0.0):
        """@param lift  towards the viewer, mm: what lies on something else is to be seen"""
        seen = (points - self.centre) @ self.frame.T * self.scale + [self.width / 2, self.height / 2, 0]
        seen[:, 2] += lift * self.scale
        facing = normals @ self.frame.T
        flat = seen[triangles][:, :, :2]
        longest = np.max(np.linalg.norm(flat - np.roll(flat, 1, axis=1), axis=2), axis=1)
        pieces = 2 ** np.ceil(np.log2(np.maximum(1.4 * longest, 1))).astype(int)
        for n in np.unique(pieces):
            weights = barycentric(n)
            some = triangles[pieces == n]
            for part in np.array_split(some, max(1, len(some) * len(weights) // 2000000)):
                self._put(np.einsum("sk,tkc->tsc", weights, seen[part]).reshape(-1, 3),
                          np.einsum("sk,tkc->tsc", weights, facing[part]).reshape(-1, 3),
                          np.einsum("sk,tkc->tsc", weights, colours[part]).reshape(-1, 3))

    def _put(self, seen, facing, colours):
        x, y = np.floor(seen[:, 0]).astype(int), np.floor(seen[:, 1]).astype(int)
        inside = (x >= 0) & (x < self.width) & (y >= 0) & (y < self.height)
        pixel = (self.height - 1 - y[inside]) * self.width + x[inside]
        depth = seen[inside, 2]
        order = np.lexsort((depth, pixel))
        last = np.flatnonzero(np.append(np.diff(pixel[order]) > 0, True)) if len(order) else []
        best = order[last]
        nearer = depth[best] > self.depth[pixel[best]]
        best = best[nearer]
        normal = facing[inside][best]
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
        normal *= np.where(normal[:, 2:] < 0, -1, 1)
        light = np.array([-0.35, 0.45, 0.82])
        shade = 0.35 + 0.65 * np.clip(normal @ (light / np.linalg.norm(light)), 0, 1)
        self.depth[pixel[best]] = depth[best]
        self.colour[pixel[best]] = colours[inside][best] * shade[:, None]

    def picture(self):
        image = self.colour.reshape(PANEL[1], FINER, PANEL[0], FINER, 3).mean(axis=(1, 3))
        image[0], image[-1], image[:, 0], image[:, -1] = 0.85, 0.85, 0.85, 0.85
        return image


def write_png(path, image):
    rows = (255 * np.clip(image, 0, 1) + 0.5).astype(np.uint8)
    raw = b"".join(b"\0" + row.tobytes() for row in rows)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", rows.shape[1], rows.shape[0], 8, 2, 0, 0, 0))
                   + chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b""))


def view_frame(direction, up):
    out = np.array(direction, float) / np.linalg.norm(direction)
    right = np.cross(up, out)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(out, right), out])


def whole_cut(cut, part):
    """AXIS without a place: through the middle of the bodies."""
    axis, _, at = (cut or "").removeprefix("-").partition("=")
    if cut is None or at:
        return cut
    along = part["nodes/position"][:, "xyz".index(axis)]
    return f"{cut}={(along.min() + along.max()) / 2!r}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("result")
    parser.add_argument("out")
    parser.add_argument("--at", type=float, nargs="+")
    parser.add_argument("--cut", help="AXIS or AXIS=MM, with - before it for the other side")
    parser.add_argument("--view", type=float, nargs=3, default=[0.4, 1, 0.5])
    parser.add_argument("--up", type=float, nargs=3, default=[0, 0, 1])
    parser.add_argument("--most", type=float)
    given = parser.parse_args()
    if given.cut and not re.fullmatch(r"-?[xyz](=[-+0-9.eE]+)?", given.cut):
        parser.error(f"--cut {given.cut}: write it like y, y=1.5 or -y=1.5")
    if np.linalg.norm(np.cross(given.view, given.up)) < 1e-6 * np.linalg.norm(given.view):
        parser.error("--view looks along --up: give --up another direction")

    try:
        file = h5py.File(given.result)
        part = file["tunica"]
    except (OSError, KeyError) as error:
        sys.exit(f"draw.py: {given.result}: no result of tunica-simulate: {error}")
    with file:
        places = part["history/time"][:]
        scene = tomllib.loads(part["scene"].asstr()[()])
        states = [int(np.argmin(np.abs(places - place))) for place in given.at or places[-1:]]
        cut = whole_cut(given.cut, part)
        drawn = [surface(deformed(part, state), cut) for state in states]
    most = given.most or max(float(np.quantile(np.concatenate([stress for *_, stress in drawn]), 0.99)), 1e-9)
    frame = view_frame(given.view, given.up)
    seen = np.concatenate([points for points, *_ in drawn]) @ frame.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    spread = high - low
    scale = 0.7 * min(PANEL[0] / max(spread[0], 1e-9 * max(spread)), PANEL[1] / max(spread[1], 1e-9 * max(spread)))
    panels = []
    for state, (points, normals, triangles, of_shell, stress) in zip(states, drawn):
        panel = Panel(frame, (low + high) / 2 @ frame, scale)
        part = np.clip(stress / most, 0, 1)
        panel.add(points, normals, triangles, np.stack([np.interp(part, PLACES, c) for c in COLOURS.T], axis=1),
                  0.006 * np.max(spread) * of_shell)
        for body in rigid_bodies(scene, places[state], 0.5 * np.linalg.norm(spread)):
            points, normals, triangles, *_ = surface(body, None)
            panel.add(points, normals, triangles, np.tile(GREY, (len(points), 1)))
        panels.append(panel.picture())
    columns = 2 if len(panels) > 3 else len(panels)
    rows = [np.concatenate(panels[i:i + columns], axis=1) for i in range(0, len(panels), columns)]
    write_png(given.out, np.concatenate(rows, axis=0))
    print(f"{given.out}: at " + ", ".join("%.4g" % places[s] for s in states) + f"; red is {1000 * most:.3g} kPa")


if __name__ == "__main__":
    main()
