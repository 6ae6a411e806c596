"""The result file: opened by VTK's own reader, values compared with HDF5 and with the report."""
import hashlib
import os
import re
import subprocess
import sys
import unittest

import h5py
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow
from vtkmodules.vtkIOHDF import vtkHDFReader

from support import SimulateTest, sphere, write_ply

RADIUS = 10
MATERIAL = ["--young", "1MPa", "--poisson", "0.3", "--thickness", "0.5mm", "--pressure", "1kPa"]
STATIC = MATERIAL + ["--fix", "rigid-motions", "--static", "--load-steps", "3"]
DYNAMIC = MATERIAL + ["--density", "1100kg/m3", "--duration", "40ms", "--step", "10ms"]
POINT_FIELDS = {"displacement": 3, "rotation": 3, "membrane_stress": 1, "von_mises": 1, "normal": 3, "thickness": 1}
ELEMENT_FIELDS = {"pressure": 1, "von_mises_top": 1, "von_mises_bottom": 1, "membrane_force": 3, "bending_moment": 3,
                  "principal_strain_top": 2, "principal_strain_bottom": 2, "membrane_von_mises": 1, "tension": 1}
CELL_FIELDS = {"body": 1, **ELEMENT_FIELDS}


def read_by_vtk(path):
    messages = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(messages)
    reader = vtkHDFReader()
    reader.SetFileName(path)
    reader.Update()
    return reader.GetOutput(), messages.GetOutput()


class Result(SimulateTest):
    def setUp(self):
        super().setUp()
        self.vertices, self.triangles, self.normals = sphere(2, RADIUS)
        write_ply(self.path("ball.ply"), self.vertices, self.triangles, self.normals)

    def corner_points(self, points):
        """Index of the drawn point at each node."""
        distance = np.linalg.norm(points[None] - self.vertices[:, None], axis=2)
        self.assertLess(distance.min(axis=1).max(), 1e-12)
        return distance.argmin(axis=1)

    def test_drawn_patches_share_their_points(self):
        with open(self.path("ball.ply"), "rb") as file:
            data = file.read()
        with open(self.path("tight.ply"), "wb") as file:
            file.write(data.replace(b"comment units mm\n", b"comment units mm\ncomment surface=watertight\n"))
        for name in ("ball", "tight"):
            result = self.run_tool(name + ".ply", name + ".hdf", *MATERIAL, "--fix", "below z=-8mm", "--static",
                                   "--tessellation", "4")["result"]
            self.assertAlmostEqual(result["volume_before_mm3"] / (4 / 3 * np.pi * RADIUS**3), 1, delta=5e-4)
            with h5py.File(self.path(name + ".hdf")) as file:
                points = file["VTKHDF/Points"][()]
                triangles = file["VTKHDF/Connectivity"][()].reshape(-1, 3)
                np.testing.assert_array_equal(points[:len(self.vertices)], self.vertices)
                u = file["tunica/nodes/displacement"][-1]
                drawn = file["VTKHDF/PointData/displacement"][:len(u)]
                np.testing.assert_allclose(drawn, u, atol=1e-6 * np.abs(u).max())
            # Per shell 3 inner points and 3 on each edge, which two shells share, beside the nodes.
            shells = len(self.triangles)
            self.assertEqual(len(points), len(self.vertices) + 3 * shells * 3 // 2 + 3 * shells)
            self.assertEqual(len(np.unique(points.round(9), axis=0)), len(points))
            edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
            self.assertEqual(set(np.unique(edges, axis=0, return_counts=True)[1]), {2})  # no pinhole, no rim

    def test_everything_says_its_unit_and_what_it_is(self):
        for arguments in (STATIC, DYNAMIC):
            self.run_tool("ball.ply", "out.hdf", *arguments, "--force")
            with h5py.File(self.path("out.hdf")) as file:
                sets = []
                file.visititems(lambda name, item: sets.append(name) if isinstance(item, h5py.Dataset) else None)
                self.assertGreater(len(sets), 40)
                for name in sets:
                    for attribute in ("units", "description"):
                        text = file[name].attrs[attribute].decode()
                        self.assertGreaterEqual(len(text), 1, name)
                self.assertEqual(file["tunica/nodes/displacement"].attrs["units"], b"mm")
                self.assertEqual(file["tunica/elements/von_mises_top"].attrs["units"], b"MPa")
                self.assertEqual(file["tunica/history/time"].attrs["units"], b"1" if arguments is STATIC else b"s")
                np.testing.assert_array_equal(file["tunica/nodes/position"], self.vertices)
                np.testing.assert_array_equal(file["tunica/elements/nodes"], self.triangles)
                normals = file["tunica/elements/normals"][()].reshape(-1, 3)
                directions = self.vertices[self.triangles.ravel()] / RADIUS
                np.testing.assert_allclose(normals, directions, atol=1e-12)  # of a ball
                self.assertEqual(set(file["tunica/elements/patch"]), {0})

    def test_the_script_of_the_page_runs_beside_a_result_of_either_ending(self):
        with open(os.path.join(os.environ["TUNICA_SOURCE"], "docs", "results.md"), encoding="utf-8") as page:
            script = re.search(r"## A script\n\n```python\n(.*?)```", page.read(), re.DOTALL).group(1)
        self.assertLessEqual(len(script.splitlines()), 15)
        with open(self.path("ball.ply"), "rb") as file:
            data = file.read()
        with open(self.path("ball.ply"), "wb") as file:  # comas patches leave gaps, 1.5 % of the area here
            file.write(data.replace(b"comment units mm\n", b"comment units mm\ncomment surface=watertight\n"))
        for name in ("result.hdf", "result.vtkhdf"):
            self.run_tool("ball.ply", name, *STATIC, "--force")  # both have one result.page
            done = subprocess.run([sys.executable, "-B", "-c", script.replace("result.hdf", name)], cwd=self.folder,
                                  capture_output=True, text=True, timeout=60, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            first = done.stdout.splitlines()[0]
            self.assertRegex(first, r"^320 shells, 125\d\.\d mm2, mean 0\.01\d+ MPa$")
            with h5py.File(self.path(name)) as file:
                area = file["tunica/elements/area"]
                self.assertEqual(area.attrs["units"], b"mm2")
                # Of the sphere; the flat facets have 2 % less.
                self.assertAlmostEqual(area[()].sum() / (4 * np.pi * RADIUS**2), 1, delta=1e-3)
        grid, messages = read_by_vtk(self.path("result.vtkhdf"))
        self.assertEqual(messages, "")
        self.assertEqual(grid.GetNumberOfCells(), 320 * 16)
        self.assertIsNotNone(grid.GetPointData().GetArray("von_mises"))

    def test_the_wall_is_reported_and_written(self):
        """Thin-walled ball under pressure: s = p R / 2 t, e = (1 - nu) s / E, at both faces."""
        result = self.run_tool("ball.ply", "out.hdf", *STATIC)["result"]
        wall = result["wall"]
        stress = 1e-3 * RADIUS / (2 * 0.5)
        # On the deformed ball, some 2 % thinner against its radius; DKT's largest node stands out by a few percent.
        self.assertAlmostEqual(wall["stress_p99_mpa"] / stress, 1, delta=0.08)
        self.assertAlmostEqual(wall["strain_p99_percent"] / (100 * 0.7 * stress), 1, delta=0.08)
        self.assertGreaterEqual(wall["stress_max_mpa"], wall["stress_p99_mpa"])
        self.assertGreaterEqual(wall["strain_max_percent"], wall["strain_p99_percent"])
        self.assertAlmostEqual(np.linalg.norm(wall["stress_max_at_mm"]), RADIUS, places=9)
        self.assertGreaterEqual(result["max_displacement_mm"], result["max_node_displacement_mm"] * (1 - 1e-12))
        with h5py.File(self.path("out.hdf")) as file:
            history = file["tunica/history"]
            self.assertEqual(history["stress_p99"][-1], wall["stress_p99_mpa"])
            self.assertEqual(history["stress_max"][-1], wall["stress_max_mpa"])
            self.assertEqual(history["stress_max_at"][-1].tolist(), wall["stress_max_at_mm"])
            self.assertEqual(history["strain_p99"][-1], wall["strain_p99_percent"])
            self.assertEqual(history["strain_max"][-1], wall["strain_max_percent"])
            self.assertEqual(history["max_displacement"][-1], result["max_displacement_mm"])
            self.assertEqual(history["stress_max"][0], 0)
            # What is drawn at the nodes is recovered there, as is the largest value.
            faces, membrane = (file["tunica/nodes"][name][-1] for name in ("von_mises", "membrane_stress"))
            for name, of_nodes in (("von_mises", faces), ("membrane_stress", membrane)):
                np.testing.assert_allclose(file["VTKHDF/PointData"][name][:len(of_nodes)], of_nodes, rtol=1e-6)
                self.assertAlmostEqual(of_nodes.mean() / stress, 1, delta=0.05)
            self.assertAlmostEqual(faces.max() / wall["stress_max_mpa"], 1, delta=1e-3)
            self.assertAlmostEqual(membrane.max() / wall["membrane_max_mpa"], 1, delta=1e-3)
            self.assertAlmostEqual(wall["membrane_mean_mpa"] / stress, 1, delta=0.02)
            self.assertEqual(history["membrane_mean"][-1], wall["membrane_mean_mpa"])

    def test_static_result_is_one_loaded_state_that_vtk_reads(self):
        result = self.run_tool("ball.ply", "out.hdf", *STATIC)["result"]
        grid, messages = read_by_vtk(self.path("out.hdf"))
        self.assertEqual(messages, "")
        with h5py.File(self.path("out.hdf")) as file:
            vtk = file["VTKHDF"]
            self.assertEqual(vtk.attrs["Version"].tolist(), [1, 0])
            self.assertEqual(vtk.attrs["Type"], b"UnstructuredGrid")
            self.assertFalse(h5py.check_string_dtype(vtk.attrs.get_id("Type").dtype).length is None)
            self.assertNotIn("Steps", vtk)
            self.assertEqual(grid.GetNumberOfPoints(), vtk["NumberOfPoints"][0])
            self.assertEqual(grid.GetNumberOfCells(), vtk["NumberOfCells"][0])
            self.assertEqual({grid.GetCellType(i) for i in range(grid.GetNumberOfCells())}, {5})
            points = vtk_to_numpy(grid.GetPoints().GetData())
            np.testing.assert_array_equal(points, vtk["Points"])
            np.testing.assert_array_equal(vtk_to_numpy(grid.GetCells().GetConnectivityArray()), vtk["Connectivity"])
            for data, group, fields in ((grid.GetPointData(), "PointData", POINT_FIELDS),
                                        (grid.GetCellData(), "CellData", CELL_FIELDS)):
                self.assertEqual({data.GetArrayName(i) for i in range(data.GetNumberOfArrays())}, set(fields))
                self.assertEqual(set(vtk[group]), set(fields))
                for name, components in fields.items():
                    values = vtk_to_numpy(data.GetArray(name))
                    self.assertEqual(values.size, components * len(vtk[group][name]))
                    np.testing.assert_array_equal(values, vtk[group][name])
                    self.assertTrue(np.isfinite(values).all())
            self.check_values(grid, points, file, result)

    def test_values_beyond_single_precision_are_refused(self):
        self.write("scene.toml", """
[run]
kind = "static"
geometry = "linear"
[[shell]]
name = "ball"
mesh = "ball.ply"
thickness = "0.5mm"
young = "1MPa"
poisson = 0.3
[[load]]
body = "ball"
kind = "pressure"
value = "1e39MPa"
[[fix]]
body = "ball"
where = {rigid_motions = true}
""")
        self.run_tool("--scene", "scene.toml", "out.hdf", code=4, says="single precision")
        self.assertFalse(self.exists("out.hdf"))

    def check_values(self, grid, points, file, result):
        """Against what is known of the sphere, and against the nodes' own freedoms."""
        u = vtk_to_numpy(grid.GetPointData().GetArray("displacement"))
        self.assertEqual(u.dtype, np.float32)
        nodes = file["tunica/nodes/displacement"][-1]
        at_nodes = self.corner_points(points)
        np.testing.assert_allclose(u[at_nodes], nodes, atol=1e-6 * np.abs(nodes).max())
        self.assertAlmostEqual(np.linalg.norm(nodes, axis=1).max(), result["max_node_displacement_mm"], places=12)
        # Drawn curved, before and after: facets of 320 triangles would lie up to 2.7 % inside the sphere.
        radius = np.linalg.norm(points, axis=1)
        self.assertLess(np.abs(radius / RADIUS - 1).max(), 2e-3)
        centre = (points + u).mean(axis=0)
        deformed = np.linalg.norm(points + u - centre, axis=1)
        w = 1e-3 * RADIUS**2 * 0.7 / (2 * 0.5)
        self.assertAlmostEqual((deformed - radius).mean() / w, 1, delta=0.05)
        self.assertLess(np.abs(deformed / deformed.mean() - 1).max(), 4e-3)
        normal = vtk_to_numpy(grid.GetPointData().GetArray("normal"))
        np.testing.assert_allclose(normal[at_nodes], self.normals, atol=2e-2)
        self.assertGreater((normal * points).sum(axis=1).min(), 0.99 * RADIUS)
        cells = grid.GetCellData()
        np.testing.assert_allclose(vtk_to_numpy(cells.GetArray("pressure")), 1e-3, rtol=1e-6)
        np.testing.assert_allclose(vtk_to_numpy(grid.GetPointData().GetArray("thickness")), 0.5, rtol=1e-6)
        self.assertEqual(set(vtk_to_numpy(cells.GetArray("body"))), {0})
        # Membrane stress of a sphere: p R / 2 t, the same in both directions, so von Mises's is that too.
        stress = 1e-3 * RADIUS / (2 * 0.5)
        faces = [vtk_to_numpy(cells.GetArray(f"principal_strain_{face}")) for face in ("top", "bottom")]
        # Forces are per current length, the wall as thin as it has become: of a strain the same in both directions.
        current = (1 + np.mean(faces, axis=(0, 2)))**(2 * 0.3 / 0.7 - 1)
        for name in ("von_mises_top", "von_mises_bottom"):
            self.assertAlmostEqual(vtk_to_numpy(cells.GetArray(name)).mean() / stress, 1, delta=0.05)
            strains = vtk_to_numpy(cells.GetArray(name.replace("von_mises", "principal_strain")))
            self.assertTrue((strains[:, 0] >= strains[:, 1]).all())
            self.assertAlmostEqual(strains.mean() / (w / RADIUS), 1, delta=0.05)
            # Of every single element, whatever its frame: Hooke's law for the principal strains gives its von Mises.
            s1, s2 = np.array([strains[:, 0] + 0.3 * strains[:, 1], strains[:, 1] + 0.3 * strains[:, 0]]) / 0.91
            np.testing.assert_allclose(current * np.sqrt(s1**2 - s1 * s2 + s2**2), vtk_to_numpy(cells.GetArray(name)),
                                       rtol=1e-3)
        force = vtk_to_numpy(cells.GetArray("membrane_force")).mean(axis=0)
        np.testing.assert_allclose(force / (0.5 * stress), [1, 1, 0], atol=0.05)
        turned = vtk_to_numpy(grid.GetPointData().GetArray("rotation"))
        np.testing.assert_allclose(turned[at_nodes], file["tunica/nodes/rotation"][-1], atol=1e-8)

    def test_history_of_a_static_path(self):
        self.write("scene.toml", f"""
[run]
kind = "static"
load_factors = [0.25, 0.5, 1]
[[shell]]
name = "ball"
mesh = "ball.ply"
thickness = "0.5mm"
young = "1MPa"
poisson = 0.3
[[fix]]
body = "ball"
where = {{rigid_motions = true}}
[[load]]
body = "ball"
kind = "pressure"
value = "1kPa"
[[probe]]
name = "top"
body = "ball"
nearest = ["0mm", "0mm", "{RADIUS}mm"]
""")
        report = self.run_tool("--scene", "scene.toml", "out.hdf")
        probe = report["result"]["probes"]["top"]
        self.assertEqual(probe["load_factor"], [0, 0.25, 0.5, 1])
        self.assertEqual(probe["time_s"], [None] * 4)
        with h5py.File(self.path("out.hdf")) as file:
            tunica = file["tunica"]
            history = tunica["history"]
            self.assertEqual(history["load_factor"][:].tolist(), [0, 0.25, 0.5, 1])
            self.assertEqual(set(history), {"time", "load_factor", "volume", "strain_energy", "kinetic_energy",
                                            "residual", "newton_iterations", "cg_iterations", "max_displacement",
                                            "displacement_p99", "membrane_p99", "membrane_max", "membrane_mean",
                                            "tension_p99", "stress_p99", "stress_max", "stress_max_at", "strain_p99", "strain_max"})
            self.assertTrue(all(len(history[name]) == 4 for name in history))
            self.assertTrue((np.diff(history["volume"]) > 0).all())
            self.assertTrue((np.diff(history["strain_energy"]) > 0).all())
            self.assertEqual(history["volume"][0], report["result"]["volume_before_mm3"])
            self.assertEqual(history["volume"][-1], report["result"]["volume_after_mm3"])
            self.assertEqual(history["strain_energy"][-1], report["result"]["strain_energy_mj"])
            u = tunica["nodes/displacement"]
            self.assertEqual((u.shape, u.dtype), ((4, len(self.vertices), 3), np.float64))
            self.assertEqual(tunica["nodes/rotation"].shape, u.shape)
            elements = tunica["elements"]  # every state of the path, though only the last is drawn
            self.assertEqual(set(elements), {"nodes", "body", "area", "normals", "patch", *ELEMENT_FIELDS})
            count = len(self.triangles)
            for name, components in ELEMENT_FIELDS.items():
                self.assertEqual(elements[name].shape, (4, count) if components == 1 else (4, count, components))
                self.assertLess(np.abs(elements[name][0]).max(), 1e-15)
                drawn = file["VTKHDF/CellData"][name][()]
                np.testing.assert_array_equal(np.repeat(elements[name][-1], len(drawn) // count, axis=0), drawn)
            np.testing.assert_allclose(elements["pressure"][:, 0], [0, 0.25e-3, 0.5e-3, 1e-3], rtol=1e-6)
            half, whole = elements["membrane_force"][2:].mean(axis=1)[:, 0]
            self.assertAlmostEqual(half / whole, 0.5, delta=0.02)
            top = np.linalg.norm(self.vertices - [0, 0, RADIUS], axis=1).argmin()
            np.testing.assert_array_equal(tunica["probes/top/displacement"], u[:, top])
            np.testing.assert_array_equal(probe["displacement_mm"], u[:, top])
            np.testing.assert_array_equal(tunica["probes/top/rotation"], tunica["nodes/rotation"][:, top])
            np.testing.assert_array_equal(probe["rotation_rad"], tunica["nodes/rotation"][:, top])
            self.assertEqual(tunica["converged"][()], 1)
            self.assertEqual(tunica["command"][()].decode().split()[:2], ["tunica-simulate", "--scene"])
            self.assertIn("OUT.hdf", tunica["command"][()].decode())
            self.assertEqual(tunica["version"][()].decode(), report["version"])
            self.assertIn("[[probe]]\nname = \"top\"", tunica["scene"][()].decode())
            for path, sha in zip(tunica["inputs/path"], tunica["inputs/sha256"]):
                with open(os.path.join(self.folder, path.decode()), "rb") as source:
                    self.assertEqual(sha.decode(), hashlib.sha256(source.read()).hexdigest())
            self.assertEqual([i["sha256"] for i in report["inputs"]],
                             [sha.decode() for sha in tunica["inputs/sha256"]])

    def test_dynamic_result_has_steps(self):
        result = self.run_tool("ball.ply", "out.hdf", *DYNAMIC)["result"]
        with h5py.File(self.path("out.hdf")) as file:
            vtk = file["VTKHDF"]
            steps = vtk["Steps"]
            points, cells = vtk["NumberOfPoints"][0], vtk["NumberOfCells"][0]
            self.assertEqual(vtk.attrs["Version"].tolist(), [2, 0])
            self.assertEqual(steps.attrs["NSteps"], 5)
            np.testing.assert_allclose(steps["Values"], [0, 0.01, 0.02, 0.03, 0.04], atol=1e-15)
            largest = file["tunica/history/max_displacement"][:]
            peak = int(np.argmax(largest))
            self.assertLess(peak, 4)
            self.assertEqual(result["peak"], {"max_displacement_mm": largest[peak], "time_s": steps["Values"][peak]})
            for name, expected in (("PartOffsets", 0), ("PointOffsets", 0), ("CellOffsets", 0),
                                   ("ConnectivityIdOffsets", 0), ("NumberOfParts", 1)):
                self.assertEqual(steps[name][:].tolist(), [expected] * 5, name)
            for kind, fields, rows in (("Point", POINT_FIELDS, points), ("Cell", CELL_FIELDS, cells)):
                self.assertEqual(set(vtk[kind + "Data"]), set(fields))
                self.assertEqual(set(steps[kind + "DataOffsets"]), set(fields))
                for name in fields:
                    offsets = steps[kind + "DataOffsets"][name][:]
                    fixed = name in ("normal", "thickness", "body")
                    self.assertEqual(offsets.tolist(), [0] * 5 if fixed else [i * rows for i in range(5)])
                    self.assertEqual(len(vtk[kind + "Data"][name]), rows if fixed else 5 * rows)
            at_nodes = self.corner_points(vtk["Points"][:])
            drawn = vtk["PointData/displacement"][:].reshape(5, points, 3)
            u = file["tunica/nodes/displacement"][:]
            np.testing.assert_allclose(drawn[:, at_nodes], u, atol=1e-6 * np.abs(u).max())
            self.assertTrue((u[0] == 0).all())
            self.assertAlmostEqual(np.linalg.norm(u[-1], axis=1).max() / result["max_node_displacement_mm"], 1, delta=1e-14)
            self.assertTrue((file["tunica/history/kinetic_energy"][1:] > 0).all())
        grid, _ = read_by_vtk(self.path("out.hdf"))  # VTK 9.1 knows no Steps: it warns and takes the first
        self.assertEqual(grid.GetNumberOfPoints(), points)
        self.assertTrue((vtk_to_numpy(grid.GetPointData().GetArray("displacement")) == 0).all())


if __name__ == "__main__":
    unittest.main()
