"""--export and --tessellation: what other readers get is what the result file holds."""
import glob
import os
import signal
import time
import unittest
import xml.etree.ElementTree as ElementTree

import h5py
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

from support import SimulateTest, sphere, write_ply

MATERIAL = ["--young", "1MPa", "--poisson", "0.3", "--thickness", "0.5mm", "--pressure", "1kPa"]
STATIC = MATERIAL + ["--fix", "rigid-motions", "--static", "--load-steps", "2"]
DYNAMIC = MATERIAL + ["--density", "1100kg/m3", "--duration", "40ms", "--step", "10ms"]


def read_vtu(path):
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    return reader.GetOutput()


def arrays(data):
    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


class Export(SimulateTest):
    def setUp(self):
        super().setUp()
        write_ply(self.path("ball.ply"), *sphere(1, 10))

    def states_of_pvd(self, name):
        root = ElementTree.parse(self.path(name)).getroot()
        return [(float(item.get("timestep")), item.get("file")) for item in root.iter("DataSet")]

    def item(self, node):
        """What a DataItem of an XDMF file stands for."""
        shape = [int(n) for n in node.get("Dimensions").split()]
        if node.get("ItemType") == "HyperSlab":
            selection, source = node.findall("DataItem")
            start, stride, count = np.array([int(n) for n in selection.text.split()]).reshape(3, -1)
            self.assertEqual([int(n) for n in selection.get("Dimensions").split()], [3, len(start)])
            whole = self.item(source)
            self.assertEqual(stride.tolist(), [1] * whole.ndim)
            values = whole[tuple(slice(s, s + n) for s, n in zip(start, count))]
        else:
            self.assertEqual(node.get("Format"), "HDF")
            file, place = node.text.split(":")
            with h5py.File(self.path(file)) as result:
                values = result[place][()]
            self.assertEqual(values.dtype.itemsize, int(node.get("Precision")))
            self.assertEqual(values.dtype.kind, {"Float": "f", "Int": "i"}[node.get("NumberType")])
        self.assertEqual(list(values.shape), shape)
        return values

    def check_against(self, result, time, state):
        """A .vtu against the rows of that state in the result file."""
        grid = read_vtu(self.path(state))
        with h5py.File(self.path(result)) as file:
            vtk, history = file["VTKHDF"], file["tunica/history"]
            index = int(np.argmin(np.abs(history["time"][()] - time)))
            self.assertAlmostEqual(history["time"][index], time)
            n, m = grid.GetNumberOfPoints(), grid.GetNumberOfCells()
            self.assertEqual((n, m), (vtk["NumberOfPoints"][0], vtk["NumberOfCells"][0]))
            np.testing.assert_array_equal(vtk_to_numpy(grid.GetPoints().GetData()), vtk["Points"])
            np.testing.assert_array_equal(vtk_to_numpy(grid.GetCells().GetConnectivityArray()), vtk["Connectivity"])
            self.assertEqual({grid.GetCellType(i) for i in range(m)}, {5})
            fields = arrays(grid.GetFieldData())
            self.assertAlmostEqual(fields["TimeValue"][0], time)
            for name in ("volume", "strain_energy", "kinetic_energy", "load_factor"):
                self.assertEqual(fields[name][0], history[name][index])
            series = "Steps" in vtk
            for data, group, rows in ((grid.GetPointData(), "PointData", n), (grid.GetCellData(), "CellData", m)):
                read = arrays(data)
                self.assertEqual(set(read), set(vtk[group]))
                for name, values in read.items():
                    stored = vtk[group][name][()]
                    if series and len(stored) > rows:
                        stored = stored[index * rows:(index + 1) * rows]
                    if series or index + 1 == len(history["time"]) or name in ("normal", "thickness", "body"):
                        np.testing.assert_array_equal(values, stored)
        return grid

    def test_pvd_of_a_dynamic_run(self):
        report = self.run_tool("ball.ply", "out.hdf", *DYNAMIC, "--export", "pvd")
        written = [os.path.basename(name) for name in sorted(glob.glob(self.path("out_*.vtu")))]
        self.assertEqual([entry["path"] for entry in report["outputs"]], ["out.hdf", "out.page", "out.pvd", *written])
        states = self.states_of_pvd("out.pvd")
        np.testing.assert_allclose([time for time, _ in states], [0, 0.01, 0.02, 0.03, 0.04])
        self.assertEqual([file for _, file in states], [f"out_{i:04}.vtu" for i in range(5)])
        for time_s, file in states:
            self.check_against("out.hdf", time_s, file)
        self.assertEqual(sorted(os.listdir(self.folder)),
                         sorted(["ball.ply", "out.hdf", "out.page", "out.pvd"] + [file for _, file in states]))

    def test_pvd_of_a_static_path_holds_every_state(self):
        self.run_tool("ball.ply", "out.hdf", *STATIC, "--export", "pvd")
        states = self.states_of_pvd("out.pvd")
        self.assertEqual([time for time, _ in states], [0, 0.5, 1])
        largest = [np.abs(arrays(self.check_against("out.hdf", *state).GetPointData())["displacement"]).max()
                   for state in states]
        self.assertEqual(largest[0], 0)
        self.assertAlmostEqual(largest[1] / largest[2], 0.5, delta=0.05)

    def test_xmf_names_every_state_of_the_result(self):
        for words, states in ((DYNAMIC, 5), (STATIC, 1)):
            self.run_tool("ball.ply", "out.hdf", *words, "--export", "xmf", "--force")
            root = ElementTree.parse(self.path("out.xmf")).getroot()
            self.assertEqual(root.get("Version"), "2.0")
            grids = root.findall("Domain/Grid/Grid")
            self.assertEqual(len(grids), states)
            with h5py.File(self.path("out.hdf")) as file:
                vtk = file["VTKHDF"]
                n, m = vtk["NumberOfPoints"][0], vtk["NumberOfCells"][0]
                for i, grid in enumerate(grids):
                    index = i if states > 1 else -1
                    self.assertAlmostEqual(float(grid.find("Time").get("Value")),
                                           file["tunica/history/time"][index])
                    self.assertEqual(int(grid.find("Topology").get("NumberOfElements")), m)
                    np.testing.assert_array_equal(self.item(grid.find("Topology/DataItem")), vtk["Connectivity"])
                    np.testing.assert_array_equal(self.item(grid.find("Geometry/DataItem")), vtk["Points"])
                    names = set()
                    for attribute in grid.findall("Attribute"):
                        name = attribute.get("Name")
                        rows, group = (n, "PointData") if attribute.get("Center") == "Node" else (m, "CellData")
                        stored = vtk[group][name][()]
                        stored = stored if len(stored) == rows else stored[i * rows:(i + 1) * rows]
                        np.testing.assert_array_equal(self.item(attribute.find("DataItem")), stored)
                        names.add((group, name))
                    self.assertEqual(names, {(g, name) for g in ("PointData", "CellData") for name in vtk[g]})

    def test_exports_follow_the_rules_of_outputs(self):
        self.write("out.pvd", "mine")
        self.run_tool("ball.ply", "out.hdf", *STATIC, "--export", "pvd", code=5, says="out.pvd: exists")
        os.rename(self.path("out.pvd"), self.path("out_0000.vtu"))
        self.run_tool("ball.ply", "out.hdf", *STATIC, "--export", "pvd", code=5, says="out_0000.vtu: exists")
        self.assertFalse(self.exists("out.hdf"))
        self.run_tool("ball.ply", "out.hdf", *STATIC, "--export", "pvd", "--export", "xmf", "--force")
        self.check_against("out.hdf", 0, "out_0000.vtu")
        self.run_tool("ball.ply", "a.hdf", *STATIC, "--export", "vtk", code=2, says="--export: 'vtk' is not one of pvd, xmf")
        self.run_tool("ball.ply", "out.pvd", *STATIC, "--export", "pvd", "--force", code=2)  # two uses of one name

    def test_a_failed_run_leaves_part_files(self):
        words = [word if word != "1kPa" else "10MPa" for word in STATIC]
        self.run_tool("ball.ply", "out.hdf", *words, "--export", "pvd", "--export", "xmf", code=4)
        self.assertFalse(self.exists("out.pvd"))
        states = self.states_of_pvd("out.pvd.part")
        self.assertGreater(len(states), 1)
        for time_s, file in states:
            self.check_against("out.hdf.part", time_s, file)
        root = ElementTree.parse(self.path("out.xmf.part")).getroot()
        self.assertTrue(all(item.text.startswith("out.hdf.part:/VTKHDF/") for item in root.iter("DataItem")
                            if item.get("Format") == "HDF"))

    def test_a_resumed_run_exports_all_states(self):
        long = [word.replace("40ms", "2s") for word in DYNAMIC]
        running = self.start_tool("ball.ply", "out.hdf", *long, "--export", "pvd", "--tessellation", "2", "--quiet")
        limit = time.monotonic() + 60
        while not self.exists("out_0009.vtu") and time.monotonic() < limit:
            time.sleep(0.002)
        running.send_signal(signal.SIGKILL)
        self.assertEqual(running.wait(), -9)
        self.run_tool("ball.ply", "out.hdf", *long, "--resume", "out.hdf.part", "--tessellation", "3", code=3,
                      says="--tessellation 3")
        self.run_tool("--resume", "out.hdf.part")
        states = self.states_of_pvd("out.pvd")
        self.assertEqual(len(states), 201)
        for time_s, file in states[::20]:
            self.check_against("out.hdf", time_s, file)

    def test_finer_tessellations_are_closer_to_the_sphere(self):
        distances = []
        for pieces in (1, 2, 4, 8):
            self.run_tool("ball.ply", "out.hdf", *STATIC, "--tessellation", str(pieces), "--force")
            with h5py.File(self.path("out.hdf")) as file:
                self.assertEqual(file["VTKHDF/NumberOfCells"][0], 80 * pieces**2)
                points = file["VTKHDF/Points"][()]
                corners = points[file["VTKHDF/Connectivity"][()].reshape(-1, 3)]
                # The drawn surface lies inside the sphere by the sagitta of its triangles; the patches follow it.
                distances.append(10 - np.linalg.norm(corners.mean(axis=1), axis=1).mean())
        self.assertGreater(distances[0], 0.3)
        for coarse, fine in zip(distances, distances[1:]):
            self.assertLess(fine, 0.4 * coarse)
        for wrong in ("0", "1.5", "65", "fine"):
            self.run_tool("ball.ply", "b.hdf", *STATIC, "--tessellation", wrong, code=2, says="--tessellation")


if __name__ == "__main__":
    unittest.main()
