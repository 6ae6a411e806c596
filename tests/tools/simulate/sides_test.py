"""Which way shells face, whether they are whole, in which space: what a mesh says of itself when it enters."""
import json
import pathlib
import struct
import unittest

import numpy as np

from support import SimulateTest, sphere, write_ply

FLAGS = ["--young", "1MPa", "--poisson", "0.45", "--thickness", "1mm", "--pressure", "1kPa", "--fix", "rigid-motions",
         "--static", "--force"]
SCENE = """
[[shell]]
name = "wall"
mesh = "{}"
young = "1 MPa"
poisson = 0.45
thickness = "1 mm"
[[load]]
body = "wall"
kind = "pressure"
value = "{}"
[[fix]]
body = "wall"
where = {{rigid_motions = true}}
[run]
kind = "static"
"""


def write_glb(path, vertices, triangles):
    corners, faces = np.asarray(vertices, "<f4").tobytes(), np.asarray(triangles, "<u4").tobytes()
    views = [{"buffer": 0, "byteOffset": at, "byteLength": n} for at, n in ((0, len(corners)), (len(corners), len(faces)))]
    about = json.dumps({
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5125, "count": np.size(triangles), "type": "SCALAR"}],
        "bufferViews": views, "buffers": [{"byteLength": len(corners) + len(faces)}]}).encode()
    about += b" " * (-len(about) % 4)
    data = corners + faces
    with open(path, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(about) + len(data)) + struct.pack("<I4s", len(about), b"JSON") +
                   about + struct.pack("<I4s", len(data), b"BIN\0") + data)


class Sides(SimulateTest):
    def setUp(self):
        super().setUp()
        self.ball = sphere(2, 10.0)
        vertices, triangles, normals = self.ball
        write_ply(self.path("outward.ply"), vertices, triangles, normals)
        write_ply(self.path("inward.ply"), vertices, triangles[:, ::-1], -normals)

    def kinds(self, report):
        return report["warning_kinds"]

    def test_shells_that_face_inward_are_said(self):
        report = self.run_tool("outward.ply", "out.hdf", *FLAGS)
        self.assertNotIn("faces inward", self.kinds(report))
        self.assertGreater(report["result"]["volume_after_mm3"], report["result"]["volume_before_mm3"])
        report = self.run_tool("inward.ply", "out.hdf", *FLAGS)
        self.assertEqual(self.kinds(report)[0], "faces inward")
        for words in "inward.ply", "pushes inward", "tunica-relax":
            self.assertIn(words, report["warnings"][0])
        for pressure, way in ("1 kPa", "pushes inward"), ("-1 kPa", "pushes outward"):
            self.write("scene.toml", SCENE.format("inward.ply", pressure))
            report = self.run_tool("--scene", "scene.toml", "out.hdf", "--force")
            self.assertEqual(self.kinds(report)[0], "faces inward")
            self.assertIn(way, report["warnings"][0])

    def test_a_shallow_surface_that_bulges_from_its_normals_is_said(self):
        vertices, triangles, normals = self.ball
        cup = triangles[(vertices[triangles].mean(1)[:, 2] > 0)]
        used, cup = np.unique(cup, return_inverse=True)
        cup = cup.reshape(-1, 3)
        flags = ["boundary" if flag == "rigid-motions" else flag for flag in FLAGS]
        for turned, counts in ((1, 0), (-1, 1)):
            write_ply(self.path("cup.ply"), vertices[used], cup[:, ::turned], turned * normals[used])
            report = self.run_tool("cup.ply", "out.hdf", *flags, "--force")
            found = [text for text in report["warnings"] if "bulges away from its normals" in text]
            self.assertEqual(len(found), counts, report["warnings"])

    def test_shells_within_shells_are_said(self):
        vertices, triangles, normals = self.ball
        write_ply(self.path("wall.ply"), np.vstack([vertices, 0.8 * vertices]),
                  np.vstack([triangles, triangles[:, ::-1] + len(vertices)]), np.vstack([normals, -normals]))
        report = self.run_tool("wall.ply", "out.hdf", *FLAGS)
        self.assertIn("nested surfaces", self.kinds(report))
        self.assertNotIn("faces inward", self.kinds(report))

    def test_an_open_seam_is_said_before_it_is_held(self):
        vertices, triangles, normals = self.ball
        below = (vertices[triangles].mean(1)[:, 2] < 0)[:, None]
        write_ply(self.path("glued.ply"), np.vstack([vertices, vertices]), triangles + below * len(vertices),
                  np.vstack([normals, normals]))
        flags = ["boundary" if flag == "rigid-motions" else flag for flag in FLAGS]
        report = self.run_tool("glued.ply", "out.hdf", *flags)
        self.assertEqual(self.kinds(report)[0], "open seam")
        self.assertIn("--repair", report["warnings"][0])

    def test_parts_that_share_one_vertex_are_said(self):
        vertices, triangles, normals = (np.array(x) for x in self.ball)
        top = int(np.argmax(vertices[:, 2]))
        other = triangles + len(vertices)
        other[other == top + len(vertices)] = top
        mirrored = vertices * [1, 1, -1] + [0, 0, 2 * vertices[top, 2]]
        write_ply(self.path("two.ply"), np.vstack([vertices, mirrored]), np.vstack([triangles, other[:, ::-1]]),
                  np.vstack([normals, normals * [1, 1, -1]]))
        # No normal is right for both.
        report = self.run_tool("two.ply", "out.hdf", *FLAGS, code=3, says="touch nowhere else")
        self.assertIn("parts meet in a point", self.kinds(report))

    def test_a_glb_is_in_the_unit_that_is_stated(self):
        vertices, triangles, _ = self.ball
        write_glb(self.path("ball.glb"), vertices, triangles)
        report = self.run_tool("ball.glb", "out.hdf", *FLAGS, "--mesh-unit", "mm")
        self.assertAlmostEqual(report["result"]["volume_before_mm3"], 4 / 3 * np.pi * 1000, delta=200)
        self.write("scene.toml", SCENE.format("ball.glb", "1 kPa").replace('"ball.glb"', '"ball.glb"\nunit = "mm"'))
        again = self.run_tool("--scene", "scene.toml", "out.hdf", "--force")
        self.assertEqual(again["result"]["volume_before_mm3"], report["result"]["volume_before_mm3"])

    def test_meshes_of_a_scene_are_in_one_space(self):
        vertices, triangles, _ = self.ball
        with open(self.path("outward.ply"), "rb") as file:
            content = file.read()
        with open(self.path("lps.ply"), "wb") as file:
            file.write(content.replace(b"comment units mm", b"comment units mm\ncomment from a program: SPACE=LPS"))
        with open(self.path("ball.obj"), "w") as file:
            file.write("# from a program: SPACE=RAS\n")
            file.writelines("v %.9g %.9g %.9g\n" % (x + 25, y, z) for x, y, z in 0.5 * vertices)
            file.writelines("f %d %d %d\n" % tuple(t + 1) for t in triangles[:, ::-1])
        rigid = '[[rigid]]\nname = "tool"\nmesh = "ball.obj"\nunit = "mm"\n[[contact]]\nbetween = ["wall", "tool"]\n'
        self.write("scene.toml", SCENE.format("lps.ply", "1 kPa") + rigid)
        self.run_tool("--scene", "scene.toml", "out.hdf", "--force", code=3, says="SPACE=RAS")
        self.write("scene.toml", SCENE.format("outward.ply", "1 kPa") + rigid)  # it says nothing of its space
        report = self.run_tool("--scene", "scene.toml", "out.hdf", "--force")
        self.assertIn("faces inward", self.kinds(report))
        self.assertIn("turned around", "".join(report["warnings"]))

    def test_exported_surfaces_say_the_axes_of_the_shells(self):
        vertices, triangles, normals = self.ball
        for space in "RAS", "LPS":
            write_ply(self.path("shell.ply"), vertices, triangles, normals)
            content = pathlib.Path(self.path("shell.ply")).read_bytes()
            pathlib.Path(self.path("shell.ply")).write_bytes(
                content.replace(b"comment units mm", b"comment units mm\ncomment SPACE=" + space.encode()))
            self.run_tool("shell.ply", "out.hdf", *FLAGS, "--export", "obj", "--export", "stl")
            for ending in "obj", "stl":
                self.assertIn(b"SPACE=" + space.encode(), pathlib.Path(self.path("out." + ending)).read_bytes()[:500])


if __name__ == "__main__":
    unittest.main()
