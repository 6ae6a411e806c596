"""--export inp and feb: models for CalculiX, Abaqus and FEBio. CalculiX runs them where it is installed."""
import os
import shutil
import subprocess
import unittest
import xml.etree.ElementTree as ElementTree

import h5py
import numpy as np

from published import fix, load, run_lines, shell
from support import SimulateTest, grid, sphere, write_ply

CALCULIX = shutil.which("ccx")
MATERIAL = ["--young", "100MPa", "--poisson", "0.3"]


def read_inp(path):
    """@return what follows each keyword line, by its keyword: (parameters, rows) in order"""
    blocks, comments = [], []
    with open(path, encoding="utf-8") as file:
        for line in file.read().splitlines():
            assert len(line) <= 256, line
            if line.startswith("**"):
                comments.append(line)
            elif line.startswith("*"):
                keyword, *parameters = [word.strip() for word in line[1:].split(",")]
                blocks.append((keyword, parameters, []))
            else:
                fields = [field.strip() for field in line.split(",")]
                assert all(len(field) <= 20 for field in fields) or blocks[-1][0] == "HEADING", line
                blocks[-1][2].append(fields)
    return blocks, comments


def rows_of(blocks, keyword):
    return [row for name, _, rows in blocks if name == keyword for row in rows]


def disc(rings, radius):
    """A flat disc of rings, six sectors."""
    vertices, triangles, starts = [(0, 0, 0)], [], [0]
    for r in range(1, rings + 1):
        starts.append(len(vertices))
        angles = 2 * np.pi * np.arange(6 * r) / (6 * r)
        vertices += [(radius * r / rings * np.cos(a), radius * r / rings * np.sin(a), 0) for a in angles]
    for r in range(1, rings + 1):
        inner, outer = 6 * (r - 1), 6 * r
        for sector in range(6):
            for i in range(r):
                a = starts[r] + (sector * r + i) % outer
                b = starts[r] + (sector * r + i + 1) % outer
                c = starts[r - 1] + (sector * (r - 1) + i) % max(inner, 1)
                triangles.append((c, a, b))
                if i < r - 1:
                    d = starts[r - 1] + (sector * (r - 1) + i + 1) % inner
                    triangles.append((c, b, d))
    return np.array(vertices, float), np.array(triangles)


def roof(columns, rows):
    """The roof of Scordelis and Lo in mm, its load in N: radius 25, length 50, 80 degrees. Axis along y."""
    flat, triangles = grid(columns, rows, 80, 50)
    angle = np.radians(flat[:, 0] - 40)
    normals = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    vertices = 25 * normals
    vertices[:, 1] = flat[:, 1]
    return vertices, triangles, normals


class Decks(SimulateTest):
    def calculix(self, name):
        """Runs NAME.inp; @return displacements of its nodes at the end"""
        done = subprocess.run([CALCULIX, name], cwd=self.folder, capture_output=True, text=True, timeout=300,
                              check=False, env={**os.environ, "OMP_NUM_THREADS": "1"})
        self.assertIn("Job finished", done.stdout, done.stdout[-2000:])
        self.assertNotIn("*ERROR", done.stdout)
        with open(self.path(name + ".dat"), encoding="utf-8") as file:
            last = file.read().split("displacements")[-1]
        rows = [line.split() for line in last.splitlines()[1:] if line.strip()]
        return np.array([[float(value) for value in row[1:]] for row in rows])

    def ours(self, name):
        with h5py.File(self.path(name)) as file:
            return file["tunica/nodes/displacement"][-1]

    def test_nodes_elements_and_loads(self):
        vertices, triangles, normals = sphere(1, 10)
        thickness = 0.5 + 0.01 * vertices[:, 2]
        write_ply(self.path("ball.ply"), vertices, triangles, normals, wall=thickness)
        scene = """
[run]
kind = "static"
[[shell]]
name = "ball & <co>"
mesh = "ball.ply"
thickness_from = "wall"
young = "100MPa"
poisson = 0.3
[[fix]]
body = "ball & <co>"
where = {rigid_motions = true}
[[load]]
body = "ball & <co>"
kind = "pressure"
value = "10kPa"
"""
        self.write("scene.toml", scene)
        report = self.run_tool("--scene", "scene.toml", "out.hdf", "--export", "inp", "--export", "feb")
        self.assertEqual([output["path"] for output in report["outputs"]], ["out.hdf", "out.page", "out.inp", "out.feb"])
        blocks, comments = read_inp(self.path("out.inp"))
        self.assertTrue(any("tunica-simulate" in line and "--export inp" in line for line in comments))
        nodes = np.array(rows_of(blocks, "NODE"))[:, 1:].astype(float)
        np.testing.assert_allclose(nodes[:len(vertices)], vertices, atol=1e-12)
        self.assertEqual(len(nodes), len(vertices) + 3 * len(triangles) // 2)
        # The middles of the edges lie on the sphere, where those of the chords are 0.4 mm inside.
        self.assertLess(np.abs(np.linalg.norm(nodes, axis=1) - 10).max(), 0.02)
        elements = np.array(rows_of(blocks, "ELEMENT")).astype(int) - 1
        np.testing.assert_array_equal(elements[:, 1:4], triangles)
        for k in range(3):
            ends = nodes[elements[:, 1 + k]] + nodes[elements[:, 1 + (k + 1) % 3]]
            gap = np.linalg.norm(nodes[elements[:, 4 + k]] - ends / 2, axis=1)
            self.assertLess(gap.max(), 0.6)
        walls = np.array(rows_of(blocks, "NODAL THICKNESS")).astype(float)
        np.testing.assert_allclose(walls[:len(vertices), 1], thickness)
        self.assertEqual(rows_of(blocks, "DLOAD"), [["BODY1", "P", "0.01"]])
        self.assertEqual(len(rows_of(blocks, "BOUNDARY")), 6)
        self.assertIn("NLGEOM", next(parameters for keyword, parameters, _ in blocks if keyword == "STEP"))
        self.check_feb(nodes, elements[:, 1:], normals, thickness)

    def test_what_acts_on_a_part(self):
        vertices, triangles = grid(4, 4, 10, 10)
        write_ply(self.path("plate.ply"), vertices, triangles)
        plate = run_lines(kind="static") + shell("plate.ply", 1, 100, 0.3) + fix(np.flatnonzero(vertices[:, 0] < 0.1))
        for deck in ("inp", "feb"):
            self.write("part.toml", plate + load("pressure", "1Pa", more='where = {above = {axis = "x", at = "3mm"}}\n'))
            self.run_tool("--scene", "part.toml", "out.hdf", "--export", deck, code=2,
                          says=[f"--export {deck}: the file presses whole bodies", "leave it out"])
            self.assertEqual([name for name in os.listdir(self.folder) if name.startswith("out")], [])
        self.write("edge.toml", plate + load("edge", [0.0, 0.0, 1e-3], "N/mm",
                   more='where = {box = [["9mm", "1mm", "-1mm"], ["11mm", "9mm", "1mm"]]}\n'))
        self.run_tool("--scene", "edge.toml", "out.hdf", "--export", "inp")
        total = sum(float(row[2]) for row in rows_of(read_inp(self.path("out.inp"))[0], "CLOAD") if row[1] == "3")
        self.assertAlmostEqual(total, 8e-3, places=9)

    def check_feb(self, middle, elements, normals, thickness):
        """The structure that FEBio's manual gives, its references, and the same model."""
        root = ElementTree.parse(self.path("out.feb")).getroot()
        self.assertEqual((root.tag, root.get("version")), ("febio_spec", "4.0"))
        self.assertEqual([child.tag for child in root],
                         ["Module", "Control", "Globals", "Material", "Mesh", "MeshDomains", "MeshData", "Boundary",
                          "Loads", "LoadData", "Output"])
        top = np.array([[float(x) for x in node.text.split(",")] for node in root.iter("node")])
        self.assertEqual([node.get("id") for node in root.iter("node")], [str(i + 1) for i in range(len(middle))])
        np.testing.assert_allclose(top[:len(normals)], middle[:len(normals)] + thickness[:, None] / 2 * normals,
                                   atol=1e-9)
        outward = np.linalg.norm(top, axis=1) - np.linalg.norm(middle, axis=1)
        self.assertTrue(((outward > 0.19) & (outward < 0.31)).all())
        read = [[int(i) - 1 for i in item.text.split(",")] for item in root.iter("elem")]
        np.testing.assert_array_equal(read, elements)
        np.testing.assert_array_equal([[int(i) - 1 for i in item.text.split(",")] for item in root.iter("tri6")],
                                      elements)
        walls = [[float(x) for x in item.text.split(",")] for item in root.find("MeshData/ElementData")]
        np.testing.assert_allclose(np.array(walls)[:, :3], thickness[elements[:, :3]])
        self.assertEqual(root.find("MeshData/ElementData").get("elem_set"), root.find("Mesh/Elements").get("name"))
        materials = {item.get("name") for item in root.iter("material")}
        self.assertEqual({item.get("mat") for item in root.iter("ShellDomain")}, materials)
        sets = {item.get("name") for item in root.iter("NodeSet")}
        self.assertEqual({item.get("node_set") for item in root.iter("bc")}, sets)
        self.assertEqual({item.get("surface") for item in root.iter("surface_load")},
                         {item.get("name") for item in root.iter("Surface")})
        # FEBio's pressure pushes against the top face; both faces together make what acts on the middle.
        loads = {item.find("shell_bottom").text: float(item.find("pressure").text)
                 for item in root.iter("surface_load")}
        self.assertEqual(loads, {"0": -0.005, "1": 0.005})
        self.assertEqual({item.get("lc") for item in root.iter() if item.get("lc")},
                         {item.get("id") for item in root.iter("load_controller")})

    def test_a_clamped_edge(self):
        vertices, triangles = disc(3, 10)
        write_ply(self.path("disc.ply"), vertices, triangles, np.tile((0, 0, 1.0), (len(vertices), 1)))
        self.run_tool("disc.ply", "out.hdf", *MATERIAL, "--thickness", "1mm", "--pressure", "1kPa", "--fix", "boundary",
                      "--static", "--export", "inp", "--export", "feb")
        held = np.array(rows_of(read_inp(self.path("out.inp"))[0], "BOUNDARY")).astype(int)
        nodes = np.array(rows_of(read_inp(self.path("out.inp"))[0], "NODE"))[:, 1:].astype(float)
        rim = np.unique(held[:, 0])
        self.assertEqual(len(rim), 36)  # 18 nodes and the middles between them
        self.assertEqual(len(held), 6 * 36)
        self.assertGreater(np.linalg.norm(nodes[rim - 1], axis=1).min(), 9.8)
        root = ElementTree.parse(self.path("out.feb")).getroot()
        sets = {item.get("name"): [int(i) for i in item.text.split(",")] for item in root.iter("NodeSet")}
        kinds = set()
        for condition in root.iter("bc"):
            self.assertEqual(sets[condition.get("node_set")], rim.tolist())
            held_by = [item.tag for item in condition if item.text == "1"]
            self.assertEqual(len(held_by), 1)
            kinds.add((condition.get("type"), held_by[0]))
        self.assertEqual(kinds, {("zero displacement", a + "_dof") for a in "xyz"} |
                         {("zero shell displacement", "s" + a + "_dof") for a in "xyz"})

    @unittest.skipUnless(CALCULIX, "CalculiX (package calculix-ccx) is not installed")
    def test_a_clamped_plate_in_calculix(self):
        """Deflections of a fiftieth and of two thirds of the thickness: 2 % apart at 8 elements along the radius."""
        vertices, triangles = disc(8, 10)
        write_ply(self.path("disc.ply"), vertices, triangles, np.tile((0, 0, 1.0), (len(vertices), 1)))
        wall, small = 0.8, 100 * 64 * 0.8**4 / (12 * (1 - 0.3**2) * 10**4)  # MPa that bend it by its thickness
        for part in (0.02, 0.9):
            self.run_tool("disc.ply", "plate.hdf", *MATERIAL, "--thickness", f"{wall}mm", "--pressure",
                          f"{part * small}MPa", "--fix", "boundary", "--static", "--export", "inp", "--force")
            theirs, ours = self.calculix("plate")[0, 2], self.ours("plate.hdf")[0, 2]
            self.assertLess(abs(theirs / ours - 1), 0.02)
            if part < 0.1:
                self.assertLess(abs(theirs / (part * wall) - 1), 0.01)

    @unittest.skipUnless(CALCULIX, "CalculiX (package calculix-ccx) is not installed")
    def test_a_sphere_in_calculix(self):
        """Ours is pressed in the middle of its wall, theirs on the inner face: Lame's thick sphere."""
        write_ply(self.path("ball.ply"), *sphere(2, 10))
        self.run_tool("ball.ply", "ball.hdf", *MATERIAL, "--thickness", "0.2mm", "--pressure", "4kPa", "--fix",
                      "rigid-motions", "--static", "--export", "inp")

        def growth(moved):
            return (np.linalg.norm(moved - moved.mean(axis=0), axis=1) - 10).mean()

        vertices = sphere(2, 10)[0]
        theirs = growth(vertices + self.calculix("ball")[:len(vertices)])
        ours = growth(vertices + self.ours("ball.hdf"))
        inner, outer = 9.9**3, 10.1**3
        thick = 0.004 * inner * 10 / (100 * (outer - inner)) * (1 - 2 * 0.3 + (1 + 0.3) * outer / (2 * 10**3))
        self.assertLess(abs(theirs / thick - 1), 0.003)
        self.assertLess(abs(ours / (0.004 * 10**2 * (1 - 0.3) / (2 * 100 * 0.2)) - 1), 0.003)
        self.assertLess(abs(theirs / ours - 1), 0.015)

    @unittest.skipUnless(CALCULIX, "CalculiX (package calculix-ccx) is not installed")
    def test_the_roof_of_scordelis_and_lo_in_calculix(self):
        """The middle of a free edge sinks by 0.3024 (MacNeal and Harder 1985)."""
        columns, rows = 16, 16
        write_ply(self.path("roof.ply"), *roof(columns, rows))
        self.write("scene.toml", """
[run]
kind = "static"
geometry = "linear"
[[shell]]
name = "roof"
mesh = "roof.ply"
thickness = "0.25mm"
young = "4.32e8MPa"
poisson = 0.0
[[fix]]
body = "roof"
where = {below = {axis = "y", at = "0mm"}}
translation = "xz"
rotation = ""
[[fix]]
body = "roof"
where = {above = {axis = "y", at = "50mm"}}
translation = "xz"
rotation = ""
[[fix]]
body = "roof"
where = {nearest = ["0mm", "25mm", "25mm"]}
translation = "y"
rotation = ""
[[load]]
body = "roof"
kind = "area"
value = ["0MPa", "0MPa", "-90MPa"]
""")
        self.run_tool("--scene", "scene.toml", "roof.hdf", "--export", "inp")
        node = (rows // 2) * (columns + 1)
        theirs, ours = self.calculix("roof")[node, 2], self.ours("roof.hdf")[node, 2]
        self.assertLess(abs(theirs / ours - 1), 0.015)
        self.assertLess(abs(ours / -0.3024 - 1), 0.01)
        self.assertLess(abs(theirs / -0.3024 - 1), 0.02)

    def test_what_the_files_cannot_express_is_refused(self):
        write_ply(self.path("ball.ply"), *sphere(1, 10))
        static, body = 'kind = "static"\n', 'body = "ball"\n'
        there = "[[fix]]\n" + body + "where = {above = {axis = 'z', at = '0mm'}}\n"
        held = there + 'translation = "xyz"\nrotation = "xyz"\n'
        pressed = "[[load]]\n" + body + 'kind = "pressure"\nvalue = "1kPa"\n'
        rigid = '[[rigid]]\nname = "plate"\nshape = "plane"\npoint = ["0mm", "0mm", "-12mm"]\nnormal = [0, 0, 1]\n'
        dynamic = 'kind = "dynamic"\nduration = "2ms"\nstep = "1ms"\n'
        for run, more, both, inp, feb in (
                (dynamic, held + pressed, "not static", 1, 1),
                ('kind = "frequencies"\ncount = 1\n', held, "not static", 1, 1),
                (static, held + pressed + rigid, "solids or rigid bodies", 1, 1),
                (static, held + pressed + 'ramp = [["0s", 0.0], ["1s", 0.5]]\n', "a load has a ramp", 1, 1),
                (static, held + 'displacement = ["0mm", "0mm", "1mm"]\nramp = [["0s", 0.0], ["1s", 0.5]]\n',
                 "a fix has a ramp", 1, 1),
                (static, held + "[[load]]\n" + body + 'kind = "moment"\nwhere = {nodes = [3]}\n'
                 'value = ["0N*mm", "0N*mm", "1N*mm"]\n', "no moments", 1, 1),
                (static, held + pressed + "follower = false\n", "pressure follows", 1, 0),
                (static + 'geometry = "linear"\n', held + pressed, "the run is linear", 0, 1),
                (static, held + "[[load]]\n" + body + 'kind = "gravity"\nvalue = ["0m/s2", "0m/s2", "-9.81m/s2"]\n',
                 "gravity", 0, 1),
                (static, there + 'translation = "xyz"\nrotation = "x"\n' + pressed, "one rotation alone", 0, 1),
                (static, there + 'translation = "xy"\nrotation = "xyz"\n[[fix]]\n' + body +
                 'where = {nearest = ["0mm", "0mm", "-10mm"]}\ntranslation = "z"\nrotation = ""\n' + pressed,
                 "displacements are free", 0, 1)):
            shell = ('[[shell]]\nname = "ball"\nmesh = "ball.ply"\nyoung = "100MPa"\npoisson = 0.3\n'
                     'thickness = "0.5mm"\ndensity = "1g/cm3"\n')
            self.write("scene.toml", "[run]\n" + run + shell + more)
            for deck, refused in (("inp", inp), ("feb", feb)):
                self.run_tool("--scene", "scene.toml", "out.hdf", "--export", deck, "--force", "--quiet",
                              code=2 * refused)
                if refused:
                    self.assertIn("--export " + deck, self.done.stderr)
                    self.assertIn(both, self.done.stderr)
                    self.assertEqual(sorted(os.listdir(self.folder)), ["ball.ply", "scene.toml"])
                else:
                    os.remove(self.path("out.hdf"))
                    os.remove(self.path("out.page"))
                    os.remove(self.path("out." + deck))


if __name__ == "__main__":
    unittest.main()
