"""GLB, OBJ, STL and 3MF: what is written is read again, to float accuracy."""
import json
import struct
import unittest
import xml.etree.ElementTree
import zipfile

import h5py
import numpy as np
from meshes import Ply
from running import ToolTest



def read_glb(data):
    """@return positions in metres, colours or None, triangles, the JSON"""
    length, = struct.unpack_from("<I", data, 12)
    scene = json.loads(data[20:20 + length])
    binary = data[20 + length + 8:]
    types = {5126: "<f4", 5125: "<u4", 5123: "<u2", 5121: "u1"}
    wide = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}

    def array(index):
        accessor = scene["accessors"][index]
        view = scene["bufferViews"][accessor["bufferView"]]
        count = accessor["count"] * wide[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        return np.frombuffer(binary, types[accessor["componentType"]], count, start).reshape(accessor["count"], -1)

    primitive = scene["meshes"][0]["primitives"][0]
    node = next(node for node in scene["nodes"] if "mesh" in node)
    matrix = np.array(node.get("matrix", np.eye(4).ravel())).reshape(4, 4).T
    scale = matrix[:3, :3] @ np.diag(node.get("scale", [1, 1, 1]))
    colours = primitive["attributes"].get("COLOR_0")
    return (array(primitive["attributes"]["POSITION"]).astype(float) @ scale.T,
            None if colours is None else array(colours).astype(float),
            array(primitive["indices"]).reshape(-1, 3), scene)


def read_3mf(path):
    """@return positions in the unit of the model, triangles, the unit, what made it. Of an archive whose members are whole
    and say nothing of the time"""
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        assert {member.date_time for member in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        root = xml.etree.ElementTree.fromstring(archive.read("3D/3DModel.model"))
        relations = xml.etree.ElementTree.fromstring(archive.read("_rels/.rels"))
        assert [relation.get("Target") for relation in relations] == ["/3D/3DModel.model"]
    space = {"": "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"}
    built, = root.findall("build/item", space)
    mesh = next(part for part in root.findall("resources/object", space) if part.get("id") == built.get("objectid"))
    vertices = [[float(v.get(axis)) for axis in "xyz"] for v in mesh.findall("mesh/vertices/vertex", space)]
    triangles = [[int(t.get(f"v{k}")) for k in (1, 2, 3)] for t in mesh.findall("mesh/triangles/triangle", space)]
    return np.array(vertices), np.array(triangles), root.get("unit"), root.find("resources/basematerials/base", space).get("name")


class Surfaces(ToolTest):
    def run_tool(self, *words, **options):
        return super().run_tool(*words, "--force", **options)["result"]

    def extracted(self):
        self.run_tool("phantom", "sphere", "v.nii.gz", "--size", "16", "--spacing", "1.7")
        for ending in ("ply", "glb", "obj", "stl", "3mf"):
            self.run_tool("extract", "v.nii.gz", f"s.{ending}", "--label", "1", "--smooth", "staircase")
        return Ply(self.folder / "s.ply")

    def same(self, vertices, triangles, ply):
        """Triangle by triangle, whatever became of the order of the vertices."""
        ours, theirs = ply.vertices[ply.triangles], vertices[triangles]
        self.assertEqual(ours.shape, theirs.shape)
        np.testing.assert_allclose(theirs, ours, rtol=1.2e-7, atol=1e-6)

    def test_what_is_written_is_what_was_extracted(self):
        ply = self.extracted()
        positions, colours, triangles, scene = read_glb((self.folder / "s.glb").read_bytes())
        self.same(1000 * positions, triangles, ply)
        self.assertIsNone(colours)
        self.assertIn("tunica-extract v.nii.gz OUT.glb", scene["meshes"][0]["name"])
        lines = (self.folder / "s.obj").read_text(encoding="utf-8").splitlines()
        self.assertTrue(lines[0].startswith("# SPACE=LPS; "))
        vertices = [[float(x) for x in line.split()[1:4]] for line in lines if line.startswith("v ")]
        faces = [[int(corner.split("/")[0]) - 1 for corner in line.split()[1:]] for line in lines
                 if line.startswith("f ")]
        self.assertEqual(len(vertices), len(ply.vertices))
        np.testing.assert_allclose(np.array(vertices)[np.array(faces)], ply.vertices[ply.triangles], rtol=1e-5)
        stl = (self.folder / "s.stl").read_bytes()
        count, = struct.unpack_from("<I", stl, 80)
        self.assertEqual(len(stl), 84 + 50 * count)
        facets = np.frombuffer(stl, [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")], count, 84)
        np.testing.assert_allclose(facets["v"], ply.vertices[ply.triangles], rtol=1.2e-7, atol=1e-6)
        vertices, triangles, unit, made_by = read_3mf(self.folder / "s.3mf")
        self.assertEqual(len(vertices), len(ply.vertices))
        np.testing.assert_allclose(vertices[triangles], ply.vertices[ply.triangles], rtol=1e-5)
        self.assertEqual(unit, "millimeter")
        self.assertIn("tunica-extract v.nii.gz OUT.3mf", made_by)

    def test_our_readers_take_them(self):
        ply = self.extracted()
        for ending in ("ply", "glb", "obj", "stl"):
            read = self.run_tool("decimate", f"s.{ending}", "again.ply", "--triangles", "100000")
            self.assertEqual(read["triangles_in"], len(ply.triangles), ending)
            self.assertTrue(read["manifold"])
            again = Ply(self.folder / "again.ply")
            self.assertEqual(len(again.vertices), len(ply.vertices))
            np.testing.assert_allclose(again.volume() / ply.volume(), 1, rtol=2e-6)
            np.testing.assert_allclose(again.vertices.min(axis=0), ply.vertices.min(axis=0), rtol=1e-5)

    def test_other_endings_are_refused(self):
        self.run_tool("phantom", "sphere", "v.nii.gz", "--size", "16", "--spacing", "1.7")
        for name in ("s.gltf", "s.3ds", "s"):
            self.run_tool("extract", "v.nii.gz", name, "--label", "1", code=2, says=".ply or .glb or .obj or .stl or .3mf")
            self.assertFalse((self.folder / name).exists())

    def test_names_that_are_markup(self):
        self.run_tool("phantom", "sphere", "v.nii.gz", "--size", "16", "--spacing", "1.7")
        name = "<b> & \"'" + 200 * "&" + ".nii.gz"
        (self.folder / "v.nii.gz").rename(self.folder / name)
        self.run_tool("extract", name, "s.3mf", "--label", "1")
        self.assertIn("<b> & \"", read_3mf(self.folder / "s.3mf")[3])  # cut where assimp's strings end, and still XML

    def test_curved_surfaces_and_results(self):
        self.extracted()
        self.run_tool("decimate", "s.ply", "c.ply", "--triangles", "120")
        self.run_tool("relax", "c.ply", "s.ply", "shell.ply", "--curved", "curved.glb")
        self.run_tool("compare", "shell.ply", "s.ply", "--shell", "--curved", "curved.ply")
        self.run_tool("compare", "shell.ply", "s.ply", "--shell", "--curved", "curved.stl")
        curved = Ply(self.folder / "curved.ply")
        positions, _, triangles, _ = read_glb((self.folder / "curved.glb").read_bytes())
        self.same(1000 * positions, triangles, curved)
        self.run_tool("simulate", "shell.ply", "r.hdf", "--young", "1MPa", "--poisson", "0.45", "--thickness", "1mm",
                      "--pressure", "1kPa", "--fix", "rigid-motions", "--static",
                      *(word for kind in ("glb", "obj", "stl", "3mf") for word in ("--export", kind)))
        positions, colours, triangles, scene = read_glb((self.folder / "r.glb").read_bytes())
        with h5py.File(self.folder / "r.hdf") as file:
            vtk = file["VTKHDF"]
            moved = vtk["Points"][()] + vtk["PointData/displacement"][()]
            stress = vtk["PointData/membrane_stress"][()]
            corners = vtk["Connectivity"][()].reshape(-1, 3)
        np.testing.assert_allclose(1000 * positions[triangles], moved[corners], rtol=1e-6, atol=1e-5)
        vertices, faces, _, made_by = read_3mf(self.folder / "r.3mf")
        np.testing.assert_allclose(vertices[faces], moved[corners], rtol=1e-5, atol=1e-4)
        self.assertIn("tunica-simulate", made_by)
        self.assertEqual((self.folder / "r.stl").stat().st_size, 84 + 50 * len(corners))
        lines = (self.folder / "r.obj").read_text(encoding="utf-8").splitlines()
        self.assertTrue(all(len(line.split()) == 7 for line in lines if line.startswith("v ")))  # colours, too
        # The palette grows darker, and the largest membrane stress is its end: violet.
        green = colours[triangles][..., 1].ravel()
        self.assertLess(np.corrcoef(green, stress[corners].ravel())[0, 1], -0.9)
        red, green, blue = colours[triangles].reshape(-1, colours.shape[1])[stress[corners].argmax(), :3]
        self.assertTrue(green < red < blue < 0.3, (red, green, blue))
        self.assertIn(f"{stress.max():.4g} MPa", scene["meshes"][0]["name"])


if __name__ == "__main__":
    unittest.main()
