"""Meshes and names that nobody means, for every tool: many triangles that are no surface, none, a single one; names of
files with blanks, quotation marks, line ends, signs of any script and bytes that are no text.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/system/cli/hostile_test.py [CLASS]
"""
import json
import os
import re
import resource
import shutil
import struct
import unittest
import xml.etree.ElementTree

import meshes
import numpy as np
from running import ToolTest, run_tool

MANY = 100_000
LOAD = ["--young", "1MPa", "--poisson", "0.3", "--thickness", "1mm", "--pressure", "1kPa", "--static"]


def apart(count, size):
    """Triangles that share no vertex, anywhere in a cube of 100 mm."""
    random = np.random.default_rng(1)
    corners = random.uniform(0, 100, (count, 1, 3)) + random.uniform(-size, size, (count, 3, 3))
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def tangled(count):
    """Triangles between any three of a few vertices."""
    random = np.random.default_rng(2)
    return random.uniform(0, 100, (count // 2, 3)), random.integers(0, count // 2, (count, 3))


class Hostile(ToolTest):
    def setUp(self):
        super().setUp()
        meshes.write_ply_mm(self.folder / "ball.ply", *meshes.sphere(3, 40.0, (50.0, 50.0, 50.0)))

    def run_tool(self, *words, seconds=60, code=(0, 3, 4, 6), **options):
        """@return the exit code and what was said, which is an answer or one line. Time is that of the processor, so that
        a busy machine does not matter"""
        super().run_tool(*words, "--threads", 1, "--quiet", "--force", limits={resource.RLIMIT_CPU: seconds}, code=code, **options)
        return self.done.returncode, self.done.stderr


class Soups(Hostile):
    """Many triangles that are no surface: bounded time and memory, and an answer or a refusal that says why."""

    def expect(self, verb, *words, code, says="", memory="400MB"):
        self.run_tool(verb, *words, "--memory-limit", memory, seconds=30, code=code, says=says)

    def test_triangles_between_any_vertices(self):
        meshes.write_ply_mm(self.folder / "soup.ply", *tangled(MANY))
        self.expect("decimate", "soup.ply", "out.ply", "--triangles", "800", code=3, says="soup.ply: ")
        self.expect("relax", "soup.ply", "ball.ply", "out.ply", code=3, says="soup.ply: ")
        self.expect("relax", "ball.ply", "soup.ply", "out.ply", code=3, says="soup.ply: ")
        self.expect("simulate", "soup.ply", "out.hdf", *LOAD, "--fix", "rigid-motions", code=3, says="soup.ply: ")

    def test_triangles_apart(self):
        meshes.write_ply_mm(self.folder / "fewer.ply", *apart(MANY // 4, 1.0))
        self.expect("decimate", "fewer.ply", "out.ply", "--triangles", "800", code=4)
        meshes.write_ply_mm(self.folder / "soup.ply", *apart(MANY, 1.0))
        # A surface of so many pieces is one; a limit on memory may end it.
        self.expect("relax", "soup.ply", "ball.ply", "out.ply", code=(3, 6), memory="100MB")
        self.expect("relax", "ball.ply", "soup.ply", "out.ply", code=(3, 6), memory="100MB")
        self.assertFalse((self.folder / "out.ply").exists())
        self.expect("compare", "soup.ply", "ball.ply", code=0)


class FewTriangles(Hostile):
    """None, and a single one."""

    COMMANDS = {
        "decimate": [["MESH", "out.ply", "--triangles", "1"], ["MESH", "out.ply", "--max-error", "1%"],
                     ["MESH", "out.ply", "--triangles", "1", "--repair"]],
        "relax": [["MESH", "ball.ply", "out.ply"], ["ball.ply", "MESH", "out.ply"], ["MESH", "MESH", "out.ply"],
                  ["MESH", "MESH", "out.ply", "--tolerance", "1%"], ["MESH", "MESH", "out.ply", "--shells", "10"]],
        "compare": [["MESH", "ball.ply"], ["ball.ply", "MESH"], ["MESH", "MESH", "--map", "out.ply", "--picture", "out.png"]],
        "simulate": [["MESH", "out.hdf", *LOAD, "--fix", where, "--picture", "out.png"]
                     for where in ("rigid-motions", "boundary")],
    }

    def run_all(self, name, *more):
        for verb, commands in self.COMMANDS.items():
            for words in commands:
                with self.subTest(verb=verb, words=words, name=name):
                    for output in self.folder.glob("out.*"):
                        output.unlink()
                    words = [name if word == "MESH" else word for word in words]
                    yield verb, words, *self.run_tool(verb, *words, *more)

    def test_none_is_refused_by_name(self):
        files = {
            "none.ply": b"ply\nformat ascii 1.0\ncomment units mm\nelement vertex 3\nproperty double x\nproperty double y\n"
                        b"property double z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n"
                        b"0 0 0\n1 0 0\n0 1 0\n",
            "nothing.ply": b"ply\nformat binary_little_endian 1.0\ncomment units mm\nelement vertex 0\nproperty double x\n"
                           b"property double y\nproperty double z\nelement face 0\nproperty list uchar int vertex_indices\n"
                           b"end_header\n",
            "none.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "none.stl": bytes(84), "text.stl": b"solid none\nendsolid none\n",
            "none.off": b"OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n", "none": b"", "none.glb": b"glTF" + struct.pack("<II", 2, 12)}
        for name, data in files.items():
            (self.folder / name).write_bytes(data)
            unit = [] if name.endswith((".ply", ".glb")) else ["--mesh-unit", "mm"]
            for verb, words, code, said in self.run_all(name, *unit):
                self.assertEqual(code, 3, (verb, words, said))
                self.assertIn(f"{name}: ", said)
                self.assertFalse(list(self.folder.glob("out.*")))

    def test_a_single_one_is_answered_without_nan(self):
        up = [(0.0, 0.0, 1.0)] * 3
        meshes.write_ply(self.folder / "one.ply", [(0, 0, 0), (80, 0, 0), (0, 80, 0)], [(0, 1, 2)], up, ["units mm"])
        for verb, words, code, said in self.run_all("one.ply"):
            if verb == "decimate" or (verb, words[:2]) == ("compare", ["one.ply", "one.ply"]):
                self.assertEqual(code, 0, (verb, words, said))
            if code == 0:
                self.assertNotIn("NaN", json.dumps(self.done.report["result"]))
                if verb in ("decimate", "relax"):
                    self.assertGreaterEqual(len(meshes.Ply(self.folder / "out.ply").triangles), 1)


class Names(Hostile):
    """Every tool, its files called as no file should be."""

    NAMES = ["-rf $(touch pwned)`touch pwned`; it's \"a\"  name &|<>*?{0}%s%n\\ --><b>&amp;", "two\nlines\nend_header\ttab\rreturn",
             "\u5fc3 gro\u00dfe Gef\u00e4\u00dfe", os.fsdecode(b"\xff\xfe\xc0"), "l" * 200]

    def test_the_whole_chain(self):
        for name in self.NAMES:
            with self.subTest(name=name):
                self.chain(name)
                self.assertFalse(list(self.folder.rglob("pwned*")))

    def chain(self, name):
        folder = self.folder / f"folder {name}"
        folder.mkdir()

        def path(ending):
            return f"./folder {name}/{name}{ending}"

        def run(*words, **options):
            self.run_tool(*words, code=0, **options)

        run("phantom", "sphere", path(".nii.gz"), "--size", "16", "--spacing", "3")
        run("extract", path(".nii.gz"), path("-surface.ply"), "--label", "1")
        for ending in (".obj", ".stl", ".glb"):
            run("extract", path(".nii.gz"), path(ending), "--label", "1")
            run("decimate", path(ending), path("-back.ply"), "--triangles", "60",
                *(["--mesh-unit", "mm"] if ending != ".glb" else []))
        run("decimate", path("-surface.ply"), path("-coarse.ply"), "--triangles", "60")
        case = folder / "out" / name / "1"
        case.mkdir(parents=True)
        run("relax", path("-coarse.ply"), path("-surface.ply"), path(".ply"), "--max-iterations", "1", "--picture",
            path(".png"), "--map", path("-map.ply"), report=case / "relax.json")
        shutil.copy(folder / f"{name}.ply", case / "shell.ply")
        self.assertEqual(os.fsencode(json.loads((case / "relax.json").read_text())["inputs"][0]["path"]).decode(errors="replace"),
                         os.fsencode(path("-coarse.ply")).decode(errors="replace"))
        run("compare", path(".ply"), path("-surface.ply"), "--shell", "--map", path("-b.ply"), "--picture", path("-b.png"))
        # Files that refer to their neighbours are XML, which holds no control signs, and nothing that is no text.
        in_xml = re.search("[\x00-\x1f\udc80-\udcff]", name) is None
        kinds = ("pvd", "xmf", "inp", "feb", "glb") if in_xml else ("inp", "feb", "glb")
        exports = [word for kind in kinds for word in ("--export", kind)]
        run("simulate", path(".ply"), path(".hdf"), *LOAD, "--fix", "rigid-motions", "--picture", path("-c.png"), *exports)
        for kind in ("pvd", "xmf"):
            if not in_xml:
                self.run_tool("simulate", path(".ply"), path("-x.hdf"), *LOAD, "--fix", "rigid-motions", "--export", kind, code=2,
                              says="which has signs that no XML can hold")
                continue
            for node in xml.etree.ElementTree.parse(folder / f"{name}.{kind}").iter():
                if node.get("file"):
                    self.assertTrue((folder / node.get("file")).is_file(), (kind, node.get("file")))
        run("chart", f"./folder {name}/out/{name}/1/relax.json", "-o", path(".svg"), "--csv", path(".csv"), "--x", "result.shells", "--y", "result.hausdorff_percent.upper")
        xml.etree.ElementTree.parse(folder / f"{name}.svg")
        run("report", f"folder {name}/out", "-o", path(".html"), "--tsv", path(".tsv"), "--summary", path("-s.tsv"))
        self.assertEqual(len((folder / f"{name}-s.tsv").read_bytes().splitlines()), 2)

    def test_what_is_missing_is_named_in_one_line(self):
        for name in self.NAMES:
            for verb, words in (("extract", ["out.ply", "--label", "1"]), ("decimate", ["out.ply", "--triangles", "9"]),
                                ("relax", ["ball.ply", "out.ply"]), ("compare", ["ball.ply"]),
                                ("simulate", ["out.hdf", *LOAD, "--fix", "boundary"]),
                                ("chart", ["-o", "out.svg", "--x", "a", "--y", "b"])):
                code, said = self.run_tool(verb, f"./{name}", *words)
                self.assertEqual((code, said), (3, f"tunica-{verb}: ./{name}: no such file\n".replace("\r", "\n").replace(
                    "\n", " ").rstrip(" ") + "\n"))

    def test_a_name_like_a_flag_behind_two_hyphens(self):
        for name in ("-rf.ply", "--help.ply", "--triangles"):
            shutil.copy(self.folder / "ball.ply", self.folder / name)
            self.assertEqual(self.run_tool("compare", "ball.ply", f"./{name}")[0], 0)
            run_tool("decimate", "--triangles", 100, "--", name, f"{name}-out.ply", folder=self.folder)
            self.assertTrue((self.folder / f"{name}-out.ply").is_file())


if __name__ == "__main__":
    unittest.main()
