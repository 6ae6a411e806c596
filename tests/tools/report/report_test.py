#!/usr/bin/python3
"""tunica-report: what a page and its tables say, names that are hostile, --verify, --no-paths, size."""

import base64
import csv
import hashlib
import html.parser
import json
import os
import pathlib
import re
import shlex
import shutil
import struct
import tempfile
import unittest
import zlib

import h5py
import numpy as np

import cases
from running import ToolTest, run_tool


class Page(html.parser.HTMLParser):
    """The elements of a page, the text outside scripts and styles, and what should not be there."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.text, self.elements, self.scripts, self.stack = "", [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        self.stack.append(tag)

    def handle_endtag(self, tag):
        while self.stack and self.stack.pop() != tag:
            pass

    def handle_data(self, data):
        if self.stack and self.stack[-1] in ("script", "style"):
            self.scripts.append((self.elements[-1], data))
        else:
            self.text += data

    def of(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


def unpacked(page):
    """The organ of a page: its header, and the bytes of its arrays."""
    packed = next(data for (_, attributes), data in page.scripts if attributes.get("type") == "text/plain")
    data = zlib.decompress(base64.b64decode(packed))
    length, = struct.unpack("<I", data[:4])
    return json.loads(data[4:4 + length]), data[4 + length:]


def numbers(data, count):
    """What is packed as 16 bits, low bytes first, each the difference to the one before."""
    low, high = np.frombuffer(data[:2 * count], np.uint8).reshape(2, count).astype(np.uint16)
    return np.cumsum(low + 256 * high, dtype=np.uint16)


def moves(header, arrays):
    """Displacement and level of the faces' stress of the shells' points, state by state; membrane stress goes before it."""
    points, at = header["shell"]["points"], 0
    at += 6 * points + 6 * header["shell"]["triangles"] + 4 * header["edges"]
    at += points if header["tops"]["distance"] is not None else 0
    states = []
    for _ in header["states"]:
        shift = numbers(arrays[at:], 3 * points).reshape(3, points).T
        states.append(((shift.astype(float) - 32768) / 32767 * header["displacement"],
                       np.frombuffer(arrays[at + 7 * points:at + 8 * points], np.uint8)))
        at += 8 * points
    return states, arrays[at:]


class ReportTest(ToolTest):
    verb = "report"

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="tunica-report-")
        cls.addClassCleanup(folder.cleanup)
        cls.source = pathlib.Path(folder.name)
        cls.case = cases.make_case(cls.source)

    def setUp(self):
        super().setUp()
        self.out = self.folder / "out"
        self.page = self.folder / "page.html"

    def copy(self, name, change=lambda reports: None):
        return cases.copy_case(self.case, self.out, name, change)

    def cohort(self, count):
        """Cases whose stress and volume differ a little."""
        for i in range(count):
            def change(reports, i=i):
                reports["simulate"]["result"]["wall"]["stress_p99_mpa"] = 0.02 + 0.0001 * i
                reports["extract"]["result"]["voxel_volume_mm3"] = 40000 + 100 * i
                for report in reports.values():
                    report["warnings"] = []
            self.copy(f"organ-{i:03}", change)

    def report(self, *words, folder=None, **options):
        self.run_tool(folder or self.out, "-o", self.page, "--force", *words, **options)
        text = self.page.read_text(encoding="utf-8") if self.page.exists() else ""
        return self.done, text, Page(text)


class CasePage(ReportTest):
    def test_says_what_the_reports_say(self):
        self.copy("aneurysm")
        _, text, page = self.report()
        result = json.loads((self.case / "simulate.json").read_text())["result"]
        relax = json.loads((self.case / "relax.json").read_text())["result"]
        numbers = re.findall(r"<dd><b>([^<]*)</b>", text)
        for told, value in zip(numbers, (1e3 * result["wall"]["membrane_p99_mpa"], result["max_displacement_mm"],
                                         relax["hausdorff_mm"]["upper"])):
            self.assertAlmostEqual(float(told) / value, 1, delta=0.005)
        self.assertEqual(len(numbers), 3)
        self.assertEqual(len(page.of("h1")), 1)
        for needed in ("Done and converged", "Not a medical device", "Comas", "SHA-256", "Inputs as stated", "as resolved, SI units",
                       "Time and memory", "MIT", "certified to be at most", "GPL-3.0-or-later", "Young's modulus"):
            self.assertIn(needed, page.text)
        self.assertIn("was not estimated: --accuracy", page.text)
        self.assertNotIn("without load", page.text)
        self.assertIn(cases.sha256(self.case / "shell.ply"), page.text)
        self.assertIn(json.loads((self.case / "relax.json").read_text())["command"], page.text)
        self.assertTrue(all(column.get("scope") for column in page.of("th")))
        self.assertEqual(len(page.of("caption")), len(page.of("table")))
        levels = [int(tag[1]) for tag, _ in page.elements if re.fullmatch("h[1-6]", tag)]
        self.assertTrue(all(after - before <= 1 for before, after in zip(levels, levels[1:])), levels)

    def test_methods_name_the_elements(self):
        folder = self.copy("aneurysm")
        _, _, page = self.report()
        methods = page.text[page.text.index("Methods, to paste"):]
        for told in ("optimal ANDES triangles with drilling freedoms [4], whose higher-order part is reduced where the shell "
                     "curves within an element (adapt)", "four fifths discrete Kirchhoff triangles [5] and one fifth the 9-term "
                     "cubic of [3] with the mean curvature that its boundary gives (dkt-comas)", "Batoz", "Felippa",
                     "with the nodes of its boundary held", "A pressure of 1 kPa that follows the surface was put on it with"):
            self.assertIn(told, methods)
        self.assertNotIn("one cubic shape function", methods)
        load = ["--pressure", "1kPa", "--young", "1MPa", "--poisson", "0.45", "--thickness", "1.5mm", "--fix", "boundary", "--static"]
        run_tool("simulate", folder / "shell.ply", folder / "result.hdf", *load, "--bending", "comas", "--membrane", "cst",
                 "--quiet", "--force", report=folder / "simulate.json")
        _, _, page = self.report()
        methods = page.text[page.text.index("Methods, to paste"):]
        self.assertIn("constant-strain triangles (cst), in bending the 9-term cubic of [3] (comas)", methods)
        self.assertNotIn("Batoz", methods, "only what is used is cited")

    def test_methods_name_regions_and_beds(self):
        folder = self.copy("aneurysm")
        mesh = folder / "shell.ply"
        (folder / "scene.toml").write_text(f"""
[run]
kind = "static"
geometry = "nonlinear"
[[shell]]
name = "organ"
mesh = "{mesh}"
thickness = "1.5mm"
young = "1MPa"
poisson = 0.45
[[fix]]
body = "organ"
where = {{boundary = true}}
translation = "xyz"
rotation = "xyz"
[[support]]
body = "organ"
stiffness = "1e6N/m3"
direction = "normal"
where = {{above = {{axis = "z", at = "0mm"}}}}
[[load]]
body = "organ"
kind = "pressure"
value = "1kPa"
where = {{below = {{axis = "z", at = "10mm"}}}}
[[load]]
body = "organ"
kind = "force"
value = ["0N", "0N", "1mN"]
where = {{nodes = [1]}}
""", encoding="utf-8")
        run_tool("simulate", "--scene", folder / "scene.toml", folder / "result.hdf", "--quiet", "--force",
                 report=folder / "simulate.json")
        _, _, page = self.report()
        methods = page.text[page.text.index("Methods, to paste"):]
        for told in ("A pressure of 1 kPa that follows the surface was put on it in the region 'below z=10mm'",
                     "a load of the kind 'force' was put on it in the region '1 node'",
                     "on an elastic bed of 1e+06 N/m³ along its normals in the region 'above z=0mm'"):
            self.assertIn(told, methods)

    def test_methods_say_what_was_done_and_no_more(self):
        folder = self.copy("aneurysm")
        path = folder / "simulate.json"
        report = json.loads(path.read_text())
        report["stated"].update(loads=[{"kind": "pressure", "where": None, "follower": True, "ramped": True}],
                                fix=["below z=0mm", "above z=12mm, moved by (0, 0, 0.1) mm"], imaged_at_mpa=None)
        report["result"]["prestress"] = {"pressure_mpa": 0.001, "residual": 0, "stable": True}
        path.write_text(json.dumps(report), encoding="utf-8")
        for name in ("extract", "decimate"):
            (folder / f"{name}.json").unlink()
        _, _, page = self.report(folder=folder)
        methods = page.text[page.text.index("Methods, to paste"):]
        for told in ("times a table over time or load factor", "the region 'above z=12mm, moved by (0, 0, 0.1) mm' held",
                     "taken under a pressure of 1 kPa"):
            self.assertIn(told, methods)
        for false in ("marching cubes", "decimated", "taken as unloaded"):
            self.assertNotIn(false, methods)

    def test_inputs_are_told_as_they_were_stated(self):
        report = json.loads((self.case / "simulate.json").read_text())
        stated = report["stated"]
        self.assertEqual({key: stated[key] for key in ("young_mpa", "poisson", "thickness_mm", "imaged_at_mpa", "law", "support",
                                                       "fix", "kind", "geometry")},
                         {"young_mpa": 1, "poisson": 0.45, "thickness_mm": 1.5, "imaged_at_mpa": None, "law": "linear",
                          "support": None, "fix": ["boundary"], "kind": "static", "geometry": "nonlinear"})
        self.assertAlmostEqual(stated["pressure_mpa"], 1e-3)
        self.assertAlmostEqual(stated["density_kg_per_m3"], 1100)
        self.assertEqual([stated["typed"][key] for key in ("young", "thickness", "pressure", "imaged_at")],
                         ["1MPa", "1.5mm", "1kPa", None])

        def in_mercury(reports):
            reports["simulate"]["stated"].update(pressure_mpa=120 * 133.322387415e-6, imaged_at_mpa=80 * 133.322387415e-6)
            reports["simulate"]["stated"]["typed"].update(pressure="120mmHg", imaged_at="80 mmHg", thickness="1500um")
        self.copy("aneurysm", in_mercury)
        _, _, page = self.report("--tsv", self.folder / "cohort.tsv")
        for told in ("under 120 mmHg (16.0 kPa)", "Pressure120 mmHg (16.0 kPa)", "Imaged at80 mmHg (10.7 kPa)",
                     "Thickness1500 um (1.5 mm)", "A pressure of 120 mmHg (16.0 kPa) that", "under a pressure of 80 mmHg (10.7 kPa)"):
            self.assertIn(told, page.text)
        with open(self.folder / "cohort.tsv", encoding="utf-8", newline="") as file:
            row, = csv.DictReader(file, delimiter="\t")
        self.assertAlmostEqual(float(row["pressure_kpa"]), 15.9986865, delta=1e-6)
        self.assertAlmostEqual(float(row["imaged_at_kpa"]), 10.6657910, delta=1e-6)
        self.assertEqual((row["young_mpa"], row["density_kg_per_m3"]), ("1", "1100"))

    def test_settings_are_not_told_with_all_digits(self):
        with tempfile.TemporaryDirectory() as folder:
            path = cases.make_case(pathlib.Path(folder), pressure="7mmHg")
            _, _, page = self.report(folder=path)
        self.assertIn("load \u00b7 value933.257 Pa", page.text)
        self.assertIn("under 7 mmHg (0.933 kPa)", page.text)
        self.assertNotIn("933.2567", page.text)

    def test_scenes_state_their_inputs_too(self):
        with tempfile.TemporaryDirectory() as folder:
            case = cases.make_case(pathlib.Path(folder), "sphere")
            cases.add_solid(case)
            stated = json.loads((case / "simulate.json").read_text())["stated"]
        self.assertEqual((stated["typed"]["pressure"], stated["typed"]["young"], stated["poisson"]), ("1kPa", "1MPa", 0.3))
        self.assertEqual(stated["fix"], ["organ: rigid-motions", "block: below x=61mm"])
        self.assertAlmostEqual(stated["pressure_mpa"], 1e-3)

    def test_an_accuracy_that_was_not_reached_has_its_numbers(self):
        """The answer stands there with its error, and what is next helps."""
        def missed(reports):
            reports["simulate"]["arguments"].update({"--accuracy": "5%", "--max-shells": "4000"})
            reports["simulate"].update(ok=False, error="shell.ply: stress 159 kPa with 3200 shells, ...")
            reports["simulate"]["result"]["wall"]["stress_p99_mpa"] = 0.159
            reports["simulate"]["result"]["shells"] = 3200
            reports["simulate"]["result"]["accuracy"] = {
                "of": "stress", "value": 0.159, "requested_percent": 5, "estimate_percent": 12, "credible": False,
                "reasons": ["the next level would have 12800 shells, more than 4000"], "levels": [{"shells": 3200}]}
            del reports["simulate"]["result"]["wall"]["membrane_p99_mpa"]  # of an older tool
        self.copy("missed", missed)
        table = self.folder / "cohort.tsv"
        done, text, page = self.report("--tsv", table)
        self.assertIn("Accuracy not reached: stress 159 kPa, estimated error 12 %, 5 % asked. Why: the next level would have",
                      page.text)
        self.assertEqual(re.findall(r"<dd><b>([^<]*)</b>", text)[0], "159")
        self.assertNotIn("not computed", page.text)
        self.assertIn("estimated error 12 %; von Mises", page.text)
        self.assertRegex(page.text,
                         r"Next, finer \(up to 51200 shells\): tunica-simulate .* --accuracy 5% --max-shells 51200 --force\n")
        self.assertRegex(page.text,
                         r"Or, content with what was reached: tunica-simulate .* --accuracy 15% --max-shells 4000 --force\n")
        self.assertIn("estimated at 12 %, which is not credible", page.text[page.text.index("Methods, to paste"):])
        self.assertRegex(done.stdout, r"missed/1 +simulate .* 3200 .* 159 +12 ")
        with open(table, encoding="utf-8", newline="") as file:
            row, = csv.DictReader(file, delimiter="\t")
        self.assertEqual((row["stress_p99_kpa"], row["stress_error_percent"], row["status"]), ("159", "12", "failed"))

    def test_what_is_next_reaches_an_accuracy(self):
        """Of a run that was stopped by the number of shells, with the tools."""
        folder = self.copy("aneurysm")
        load = ["--pressure", "1kPa", "--young", "1MPa", "--poisson", "0.45", "--thickness", "4mm", "--fix", "boundary", "--static",
                "--accuracy", "0.02%", "--of", "displacement", "--target", folder / "surface.ply", "--max-shells", 3500]
        run_tool("simulate", folder / "shell.ply", folder / "result.hdf", *load, "--quiet", "--force", code=4,
                 report=folder / "simulate.json")
        _, _, page = self.report()
        found = re.search(r"Or, content with what was reached: (tunica-simulate .*)\n", page.text)
        if found is None:
            self.assertIn("Next, finer", page.text, "another reason than the number of shells")
            return
        run_tool("simulate", *shlex.split(found[1])[1:])

    def test_a_run_that_ended_early_has_no_answer(self):
        """Its last state is one under a part of the load."""
        self.copy("limit", lambda reports: reports["simulate"].update(ok=False, error="no equilibrium at load factor .1"))
        table = self.folder / "cohort.tsv"
        _, text, page = self.report("--tsv", table)
        self.assertEqual(re.findall(r"<dd><b>([^<]*)</b>", text)[:2], ["–", "–"])
        self.assertEqual(page.text.count("not computed"), 2)
        self.assertNotIn("Strain energy", page.text)
        with open(table, encoding="utf-8", newline="") as file:
            row, = csv.DictReader(file, delimiter="\t")
        self.assertEqual([row[key] for key in ("stress_p99_kpa", "strain_p99_percent", "max_displacement_mm", "pressure_kpa")],
                         ["n/a", "n/a", "n/a", "1"])
        self.assertNotEqual(row["distance_mm"], "n/a")

    def test_an_unloaded_shape_is_told(self):
        def change(reports):
            reports["simulate"]["result"].update(
                unloaded={"volume_mm3": 4321.0, "distance_mm": {"mean": 0.0125, "max": 0.05}, "iterations": 7})
            reports["simulate"].update(warnings=[], warning_kinds=[], warning_weights=[])  # of another run

        self.copy("aneurysm", change)
        _, _, page = self.report()
        self.assertIn(" kPa, from the shape without load", page.text)
        self.assertIn("Volume within the shells, without load4.32 ml", page.text)
        self.assertIn("was not estimated: a second run", page.text)
        self.assertNotIn("ACCURACY=", page.text, "it is refused with an imaging pressure")
        self.assertIn("Off the image under its pressure, mean0.0125 mm", page.text)

    def test_loads_nothing_and_runs_its_own_script_alone(self):
        self.copy("aneurysm")
        _, text, page = self.report()
        policy = next(meta["content"] for meta in page.of("meta") if meta.get("http-equiv"))
        self.assertTrue(policy.startswith("default-src 'none';"))
        run = [data for (_, attributes), data in page.scripts if attributes.get("type") != "text/plain"]
        self.assertEqual(len(run), 2, "a style and a script")
        for kind, code in zip(("style", "script"), run):
            digest = base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()
            self.assertIn(f"{kind}-src 'sha256-{digest}'", policy)
        for _, attributes in page.elements:
            self.assertFalse([name for name in attributes if name.startswith("on") or name == "style"])
            self.assertTrue(re.match("data:|#|$", attributes.get("src") or attributes.get("href") or ""))

    def test_organ_is_packed(self):
        self.copy("aneurysm")
        _, _, page = self.report()
        header, arrays = unpacked(page)
        result = json.loads((self.case / "simulate.json").read_text())["result"]
        self.assertEqual(header["states"], ["As imaged", "Loaded"])
        self.assertAlmostEqual(header["tops"]["displacement"] / result["max_displacement_mm"], 1, delta=0.03)
        points, edges = header["shell"]["points"], header["edges"]
        self.assertEqual(header["shell"]["triangles"], 16 * result["shells"])
        surface = header["surface"]
        size = (6 * points + 6 * header["shell"]["triangles"] + 4 * edges + points + 2 * (6 * points + 2 * points) +
                6 * surface["points"] + 6 * surface["triangles"])
        self.assertEqual(len(arrays), size)
        pictures = [image["src"] for image in page.of("img")]
        self.assertEqual(len(pictures), 2, "the organ, and the slices")
        self.assertTrue(all(base64.b64decode(src.split(",")[1]).startswith(b"\x89PNG") for src in pictures))

    def test_slices_of_several_labels(self):
        self.copy("aneurysm")
        path = self.case / "extract.json"
        said = path.read_text()
        self.assertIn("--label 1 ", said)
        path.write_text(said.replace("--label 1 ", "--label 1+2 "))
        _, _, page = self.report()
        self.assertEqual(len(page.of("img")), 2)

    def test_every_state_of_a_static_path_is_drawn(self):
        # Small loads: the states of a path are the last one times their load.
        with tempfile.TemporaryDirectory() as folder:
            path = cases.make_case(pathlib.Path(folder), pressure="1Pa", solve=["--load-steps", "4"])
            _, text, page = self.report(folder=path)
            header, arrays = unpacked(page)
            self.assertEqual(header["states"], ["As imaged", "Load \u00d7 0.25", "Load \u00d7 0.5", "Load \u00d7 0.75", "Loaded"])
            states, _ = moves(header, arrays)
            last, stress = states[-1]
            self.assertGreater(stress.max(), 250)
            for part, (displacement, level) in zip((0, 0.25, 0.5, 0.75), states):
                np.testing.assert_allclose(displacement, part * last, atol=2e-3 * header["displacement"])
                np.testing.assert_allclose(level.astype(float), part * stress, atol=1.6)
            self.assertIn("Loaded; displacement drawn", text)

    def test_damaged_data_of_a_page_are_named(self):
        folder = self.copy("aneurysm")
        path = folder / "result.page"
        whole = path.read_bytes()
        line, _, numbers_behind = whole.partition(b"\n")
        header = json.loads(line)

        def with_header(**changes):
            return json.dumps({**header, **changes}).encode() + b"\n" + numbers_behind

        corners = len(line) + 1 + 12 * header["points"]
        damaged = [b"", b"\x89PNG", line, whole[:-1], whole + b"\0", b"[" * 100_000 + whole, b"[1]\n" + numbers_behind,
                   with_header(format="tunica page 2"), with_header(points=-1), with_header(points=2**40), with_header(kind="flight"),
                   with_header(states=[]), with_header(states=[[0, 0]]), with_header(states=[[0, 0, 0]] * 2000), with_header(pieces=3),
                   with_header(points=header["points"] + 1),
                   whole[:corners] + struct.pack("<I", header["points"]) + whole[corners + 4:],
                   whole[:len(line) + 1] + struct.pack("<f", float("nan")) + whole[len(line) + 5:]]
        for data in damaged:
            path.write_bytes(data)
            _, text, page = self.report(folder=folder)
            self.assertIn("result.page: is damaged, or no page of this version: run the simulation again", page.text)
            self.assertIn("Drawn as imaged", text)
        path.unlink()
        os.mkfifo(path)
        self.assertIn("result.page: is not a regular file", self.report(folder=folder)[2].text)

    def test_a_result_of_an_older_version_is_told(self):
        folder = self.copy("aneurysm")
        (folder / "result.page").unlink()
        _, text, page = self.report(folder=folder)
        told = re.search(r"result\.page is missing, as in results of older versions: the loaded organ is not drawn; (.*) draws it", page.text)
        self.assertRegex(told[1], r"^tunica-simulate .* --force$")
        self.assertIn("Drawn as imaged", text)
        self.assertIn("Membrane stress", page.text)

    def test_a_long_motion_has_no_more_states_than_a_page_shows(self):
        with tempfile.TemporaryDirectory() as folder:
            case = cases.make_case(pathlib.Path(folder))
            run_tool("simulate", case / "shell.ply", case / "result.hdf", "--pressure", "1kPa", "--young", "1MPa", "--poisson",
                     "0.45", "--thickness", "1.5mm", "--density", "1100kg/m3", "--fix", "boundary", "--duration", "50ms",
                     "--step", "0.5ms", "--quiet", "--force", report=case / "simulate.json")
            header, arrays = unpacked(self.report(folder=case)[2])
            states, _ = moves(header, arrays)
            self.assertEqual((len(states), header["states"][0], header["states"][-1]), (41, "As imaged", "At 0.05 s"))
            seconds = [float(label.split()[1]) for label in header["states"][1:]]
            self.assertLess(np.diff(seconds).max(), 2.1 * np.diff(seconds).min())
            # The last of them is the last one of the result.
            with h5py.File(case / "result.hdf") as file:
                points = file["VTKHDF/NumberOfPoints"][0]
                moved = np.abs(file["VTKHDF/PointData/displacement"][-points:]).max()
            self.assertAlmostEqual(np.abs(states[-1][0]).max(), moved, delta=1e-4 * header["displacement"])
            self.assertLess((case / "result.page").stat().st_size, 0.25 * (case / "result.hdf").stat().st_size)

    def test_states_of_a_bending_path_agree_with_those_that_the_grid_has(self):
        # The last state but one, against that of a run that ends there.
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            (folder / "path").mkdir()
            (folder / "half").mkdir()
            drawn = []
            for name, pressure, steps in (("path", "8kPa", 2), ("half", "4kPa", 1)):
                case = cases.make_case(folder / name, pressure=pressure, solve=["--load-steps", str(steps)])
                header, arrays = unpacked(self.report(folder=case)[2])
                drawn.append((header, moves(header, arrays)[0][1]))
            (long, (moved, stress)), (short, (expected, expected_stress)) = drawn
            self.assertEqual(long["shell"], short["shell"])
            np.testing.assert_allclose(moved, expected, atol=1e-3 * long["displacement"])
            np.testing.assert_allclose(stress * long["tops"]["stress"], expected_stress * short["tops"]["stress"],
                                       atol=0.01 * 255 * long["tops"]["stress"])

    def test_solids_are_drawn_by_their_outer_faces(self):
        with tempfile.TemporaryDirectory() as folder:
            case = cases.make_case(pathlib.Path(folder), "sphere")
            cases.add_solid(case)
            header, arrays = unpacked(self.report(folder=case)[2])
            self.assertEqual(header["solids"], {"points": 26, "triangles": 48}, "not the point in its middle")
            states, rest = moves(header, arrays)
            surface, points = header["surface"], 26
            rest = rest[6 * surface["points"] + 6 * surface["triangles"] + 6 * points + 6 * 48:]
            self.assertEqual((len(rest), len(states)), (5 * 6 * points, 5))
            shift = (numbers(rest[-6 * points:], 3 * points).astype(float) - 32768) / 32767 * header["displacement"]
            self.assertGreater(np.abs(shift).max(), 0)

    def test_case_folder_alone_and_the_same_bytes_again(self):
        folder = self.copy("aneurysm")
        _, first, page = self.report(folder=folder, report=False)  # the page has the command
        _, again, _ = self.report("--threads", 1, folder=folder, report=False)
        self.assertEqual(first.replace(" --threads 1", ""), again.replace(" --threads 1", ""))
        self.assertIn("The organ", page.text)

    def test_what_cannot_be_drawn_is_told(self):
        folder = self.copy("aneurysm")
        (folder / "result.page").write_bytes(b"{}\nno more")
        (folder / "surface.ply").write_text("ply\nno more")
        self.copy("other", lambda reports: reports["extract"]["inputs"][0].update(path="missing.nii.gz"))
        _, _, page = self.report()
        for told in ("result.page: is damaged", "surface.ply: ", "missing.nii.gz: "):
            self.assertIn(told, page.text)

    def test_changed_volume_is_not_shown(self):
        self.copy("aneurysm", lambda reports: reports["extract"]["inputs"][0].update(sha256="0" * 64))
        _, _, page = self.report()
        self.assertIn("is not the volume that was extracted any more", page.text)
        self.assertEqual(len(page.of("img")), 1)


class CohortPage(ReportTest):
    def test_counts_failures_and_outliers(self):
        self.cohort(8)

        def fail(reports):
            reports["relax"].update(ok=False, error="shell.ply: the tolerance cannot be held", result={})
        failed = self.copy("zz-failed", fail)
        (failed / "simulate.json").unlink()

        def stand_out(reports):
            for report in reports.values():
                report["warnings"] = []
            reports["simulate"]["result"]["wall"]["stress_p99_mpa"] = 0.05
            reports["extract"]["result"]["voxel_volume_mm3"] = 40400
            reports["simulate"]["warnings"] = ["shells wave"]
        self.copy("zz-out", stand_out)
        done, text, page = self.report()
        self.assertRegex(done.stdout, r"zz-failed/1 +relax .*the tolerance cannot be held")
        self.assertIn("read its warnings first: 1 of 9 cases done have some", done.stdout)
        self.assertEqual(re.findall(r"<dd>(\d+)</dd>", text), ["8", "1", "1"], "each case is counted once")
        self.assertRegex(page.text, r"zz-failed/1: relax: shell.ply: the tolerance cannot be held\s*Next: tunica-relax .* --verbose")
        self.assertRegex(page.text, r"zz-out/1: Stress p99 50 kPa \(robust z \+\d+")
        self.assertEqual(text.count("(robust z"), 1)
        self.assertEqual(page.of("details")[0]["class"], "case failed", "failures first")
        self.assertEqual(text.count('<svg viewBox="0 0 320 58" role="img"'), 8)
        self.assertEqual(len(page.of("caption")), len(page.of("table")))

    def test_warnings_are_counted_by_kind(self):
        def warn(*kinds, stage="relax"):
            def change(reports):
                for report in reports.values():
                    report.update(warnings=[], warning_kinds=[], warning_weights=[], notes=[])
                reports[stage].update(warnings=[f"shell.ply: of {kind}" for kind, _ in kinds], warning_kinds=[kind for kind, _ in kinds],
                                      warning_weights=[weight for _, weight in kinds], notes=["units are taken as mm"])
            return change
        both = self.copy("a-both", warn(("coarse shells", "minor"), ("thick wall", "minor")))
        report = json.loads((both / "simulate.json").read_text())
        report.update(warnings=["shell.ply: of limit load"], warning_kinds=["limit load"], warning_weights=["major"])
        (both / "simulate.json").write_text(json.dumps(report))
        self.copy("b-one", warn(("thick wall", "minor")))
        self.copy("c-note", warn())

        def older(reports):
            for report in reports.values():
                for key in ("warning_kinds", "warning_weights", "notes"):
                    report.pop(key, None)
                report["warnings"] = []
            reports["relax"]["warnings"] = ["shells wave"]
        self.copy("d-older", older)
        table = self.folder / "cohort.tsv"
        done, text, page = self.report("--tsv", table)
        self.assertEqual(re.findall(r"<dd>(\d+)</dd>", text), ["1", "0", "3"], "notes alone are no warning")
        lines = done.stdout[done.stdout.index("warnings, by kind:"):].splitlines()[1:5]
        self.assertEqual(lines, ["  limit load, 1 of 4 cases: e.g. a-both/1: simulate: shell.ply: of limit load",
                                 "  thick wall, 2 of 4 cases: e.g. a-both/1: relax: shell.ply: of thick wall",
                                 "  of an older report, 1 of 4 cases: e.g. d-older/1: relax: shells wave",
                                 "  coarse shells, 1 of 4 cases: e.g. a-both/1: relax: shell.ply: of coarse shells"])
        for told in ("Warnings by kind", "limit load (serious)1a-both/1: simulate: shell.ply: of limit load",
                     "thick wall2a-both/1: relax: shell.ply: of thick wall", "relax: units are taken as mm"):
            self.assertIn(told, page.text)
        own = page.text[page.text.index("Case by case"):]
        self.assertLess(own.index("of limit load"), own.index("of coarse shells"), "the heaviest first")
        with open(table, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE))
        self.assertEqual([(row["status"], row["warnings"], row["warning_kinds"]) for row in rows],
                         [("warned", "3", "limit load (1); coarse shells (1); thick wall (1)"), ("warned", "1", "thick wall (1)"),
                          ("done", "0", "n/a"), ("warned", "1", "of an older report (1)")])

    def test_the_table_of_a_run_has_the_answer(self):
        self.cohort(2)
        summary = self.folder / "summary.tsv"
        done, _, page = self.report("--summary", summary)
        with open(summary, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE))
        self.assertEqual(list(rows[0]), ["case", "stage", "exit", "message", "shells", "distance_percent", "membrane_p99_kpa",
                                         "membrane_error_percent", "membrane_mean_kpa", "stress_p99_kpa", "stress_error_percent",
                                         "max_displacement_mm", "displacement_error_percent",
                                         "strain_p99_percent", "warnings", "seconds"])
        self.assertEqual([(row["stress_p99_kpa"], row["stress_error_percent"], row["warnings"]) for row in rows],
                         [("20", "", "0"), ("20.1", "", "0")])
        result = json.loads((self.case / "simulate.json").read_text())["result"]
        self.assertAlmostEqual(float(rows[0]["max_displacement_mm"]) / result["max_displacement_mm"], 1, delta=1e-5)
        head = done.stdout.splitlines()[0]
        for name in ("membrane kPa", "faces kPa", "displ. mm", "strain %", "distance %"):
            self.assertIn(name, head)
        self.assertNotIn("+-", head, "no error is known")
        self.assertNotIn("error", head)
        self.assertIn("not the error of stress", done.stdout)
        scale = re.search(r"share one scale of stress, up to the largest 99th percentile among them: 0 to ([0-9.]+) kPa\.", page.text)
        self.assertAlmostEqual(float(scale[1]) / (1e3 * result["wall"]["membrane_p99_mpa"]), 1, delta=0.01)

    def test_labels_are_compared_apart(self):
        self.cohort(10)
        _, text, _ = self.report()
        self.assertEqual((text.count("(robust z"), text.count('<svg viewBox="0 0 320 58" role="img"')), (0, 8))
        self.assertNotIn("<h3>Label", text)

        def liver(reports):
            for report in reports.values():
                report["warnings"] = []
            reports["extract"]["arguments"]["--label"] = "<i>liver"
            reports["extract"]["result"]["voxel_volume_mm3"] = 1600000
        self.assertEqual(json.loads((self.case / "extract.json").read_text())["arguments"]["--label"], "1")
        self.copy("zz-liver", liver)
        _, text, _ = self.report()
        self.assertEqual((text.count("(robust z"), text.count('<svg viewBox="0 0 320 58" role="img"')), (0, 8))
        self.assertIn("Too few cases", text)
        self.assertEqual(re.findall("<h3>(Label .*)</h3>", text), ["Label 1", "Label &lt;i&gt;liver"])

    def test_files_of_one_name_in_many_folders_are_organs(self):
        """As in patient/segmentations/aorta.nii.gz, where every file has a label 1."""
        for i in range(6):
            for organ in ("aorta", "bladder") if i < 2 else ("aorta",):
                def of_organ(reports, i=i, organ=organ):
                    for report in reports.values():
                        report["warnings"] = []
                    reports["extract"]["inputs"][0]["path"] = f"p{i}/{organ}.nii.gz"
                    reports["extract"]["result"]["voxel_volume_mm3"] = 40000 if organ == "aorta" else 400000
                self.copy(f"p{i}_{organ}", of_organ)
        _, text, _ = self.report()
        self.assertEqual(re.findall("<h3>(Label .*)</h3>", text), ["Label 1 of aorta.nii.gz", "Label 1 of bladder.nii.gz"])
        self.assertNotIn("(robust z", text)

    def test_error_of_an_accuracy_is_told(self):
        def asked(credible, **distance):
            return lambda reports: reports["simulate"]["result"].update(
                shells=4 * reports["relax"]["result"]["shells"],
                accuracy={"of": "stress", "value": 0.159, "requested_percent": 5, "estimate_percent": 4.2, "credible": credible,
                          "reasons": [], **distance,
                          "levels": [{"mean_distance_mm": 0.5}, {"mean_distance_mm": 0.125}]})
        known = self.copy("known", asked(True))
        shutil.copy(known / "shell.ply", known / "refined.ply")
        self.copy("vain", asked(False))
        _, _, page = self.report()
        self.assertEqual([image["alt"] for image in page.of("img") if "slices" in image["alt"]],
                         ["Nine slices of the image with the outline of the shells"])
        self.assertIn("vain/1/refined.ply: ", page.text, "the shells before are not those that the page is about")
        self.assertIn("The error of the stress by number of shells and model is below 4.2 % (5 % were asked for).", page.text)
        self.assertIn("The error of the stress by number of shells and model is estimated at 4.2 % (5 % were asked for), "
                      "which is not credible.", page.text)
        self.assertNotIn("certified to be at most", page.text, "that is known of the shells before")
        self.assertIn(", 0.125 mm from the extracted surface in the mean", page.text)
        self.assertNotIn("Normals, mean error", page.text)
        self.copy("certified", asked(True, hausdorff_mm={"upper": 0.625}, hausdorff_percent={"upper": 1.375}))
        done, _, page = self.report()
        self.assertIn("is certified to be at most 0.625 mm (1.38% of its diagonal)", page.text)
        self.assertRegex(done.stdout, r"certified/1 .* 1.38 ")
        self.assertNotIn("certified/1/map.png", done.stdout, "that is of the shells before")
        self.assertIn("Too few cases to tell outliers.", page.text)

        def missed(reports):
            asked(False)(reports)
            reports["simulate"].update(ok=False, error="5% of stress is not credible")
        shells = json.loads((self.copy("missed", missed) / "relax.json").read_text())["result"]["shells"]
        done, _, page = self.report()
        self.assertRegex(done.stdout, rf"missed/1 +simulate .* {4 * shells} ", "the answer is that of the finer ones")

    def test_table_and_what_its_columns_mean(self):
        self.cohort(3)
        self.report("--tsv", self.folder / "cohort.tsv")
        with open(self.folder / "cohort.tsv", newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE))
        columns = json.loads((self.folder / "cohort.json").read_text())
        self.assertEqual(list(rows[0]), list(columns))
        for name, column in columns.items():
            self.assertEqual(set(column), {"Description", "Units", "Source"}, name)
        self.assertEqual([row["case"] for row in rows], [f"organ-{i:03}/1" for i in range(3)])
        self.assertEqual([float(row["stress_p99_kpa"]) for row in rows], [20, 20.1, 20.2])
        self.assertEqual((rows[0]["pressure_kpa"], rows[0]["poisson"], rows[0]["status"]), ("1", "0.45", "done"))
        self.assertEqual(rows[0]["volume_change_percent"], "n/a", "an open organ has no volume")

    def test_without_paths_no_name_is_told(self):
        names = ["Mustermann_Erika", "O'Hara-Jane", "p x 19540312"]
        for name in names:
            def rename(reports, name=name):
                volume = f"/data/ward 7/{name}.nii.gz"
                text = json.dumps(reports["extract"])
                for report in reports.values():
                    report["warnings"] = [f"{self.out}/{name}/1/shell.ply: its normals", f"{name}.nii.gz: odd", volume]
                    report["command"] = f"tunica-extract '{volume}' '{self.out}/{name}/1/surface.ply' --label 1"
                    report["arguments"] = {"VOLUME": volume, "OUT.ply": f"{self.out}/{name}/1/surface.ply", "--label": "1"}
                self.assertTrue(text)
                reports["extract"]["inputs"][0]["path"] = volume
                reports["relax"].update(error=f"{self.out}/{name}/1/coarse.ply: of {volume}: no")
            self.copy(name, rename)
        tsv = self.folder / "c.tsv"
        self.report("--no-paths", "--tsv", tsv)
        for written in (self.page.read_text(), tsv.read_text()):
            for name in [*names, "Mustermann", "Hara", "19540312", "/data", "ward 7", str(self.folder),
                         str(self.source), str(cases.shells_of("aneurysm").parents[2]), "aneurysm"]:
                for way in (name, name.replace("'", "&#39;")):
                    self.assertNotIn(way, written)
        self.assertIn("case 2", self.page.read_text())
        for flag in ("--summary", "--chart"):
            done, _, _ = self.report("--no-paths", flag, self.folder / "names.tsv", code=2)
            self.assertIn("name the cases", done.stderr)

    def test_two_hundred_organs_within_25_mb(self):
        folder = self.copy("organ-000")
        for i in range(1, 10):
            shutil.copytree(folder.parent, self.out / f"organ-{i:03}")
        record = [f"organ-{i:03}/1\torgan-{i % 10:03}/1\tsimulate\t0\tdone\n" for i in range(200)]
        (self.out / ".cases").write_text("".join(record))
        self.run_tool(self.out, "-o", self.page, "--quiet")
        self.assertLess(self.page.stat().st_size, 25e6)


class HostileNames(ReportTest):
    NAMES = ["<script>alert(1)</script>", "\"><img src=x onerror=alert(1)>", "'-alert(1)-'", "</title><script>x</script>",
             "a\nb\t<b>", "&lt;i&gt;", "{0} {1} %s", "\u202egnp.exe", "\u0130\u0000x".replace("\0", ""), "javascript:alert(1)",
             "]]><!--", "`${alert(1)}`", "gro\u00dfe \u5fc3"]

    def test_names_are_text(self):
        for i, name in enumerate(self.NAMES):
            def poison(reports, name=name):
                for report in reports.values():
                    report["warnings"] = [name]
                    report["command"] = name
                    report["arguments"] = {name: name, "--label": name, "VOLUME": name}
                    report["version"] = name
                reports["relax"].update(ok=False, error=name)
                reports["extract"]["inputs"][0]["path"] = name
            folder = self.copy(f"{i}-plain", poison)
            folder.parent.rename(self.out / name.replace("/", "\u2215"))
        _, text, page = self.report()
        self.check(text, page)
        shown = page.text.replace("\u2215", "/")
        for name in self.NAMES:
            self.assertIn(re.sub("[\x00-\x08\u202e]", "\ufffd", name), shown)

    def check(self, text, page):
        """Nothing of a name became an element or an attribute."""
        known = {"html", "head", "meta", "title", "style", "body", "header", "p", "h1", "h2", "h3", "main", "dl", "div",
                 "dt", "dd", "ul", "li", "a", "bdi", "br", "code", "pre", "table", "caption", "thead", "tbody", "tr",
                 "th", "td", "small", "span", "img", "figure", "figcaption", "svg", "defs", "lineargradient", "stop",
                 "rect", "line", "circle", "text", "details", "summary", "script", "strong", "b", "ol", "footer"}
        self.assertEqual({tag for tag, _ in page.elements} - known, set())
        run = [data for (tag, attributes), data in page.scripts if tag == "script" and "type" not in attributes]
        self.assertEqual(len(run), 1)
        self.assertNotIn("alert", run[0][:0] + "".join(data for (_, attributes), data in page.scripts if "id" in attributes))
        for _, attributes in page.elements:
            self.assertFalse([name for name in attributes if name.startswith("on")])
        self.assertNotIn("\u202e", text)

    def test_bytes_that_are_no_text(self):
        folder = self.copy("plain")
        os.rename(os.fsencode(folder.parent), os.path.join(os.fsencode(self.out), b"\xff\xfe<b>\xc0\xaf"))
        self.copy("other")
        table = self.folder / "cohort.tsv"
        _, text, page = self.report("--tsv", table)
        self.check(text, page)
        self.assertIn("\ufffd\ufffd<b>", page.text)
        self.assertIn("\n\ufffd\ufffd<b>", table.read_text(encoding="utf-8"))


class Errors(ReportTest):
    def refuse(self, code, *words, says, folder=None):
        self.report(*words, folder=folder, code=code)
        self.assertEqual(self.done.stderr.count("\n"), 1, self.done.stderr)
        self.assertIn(says, self.done.stderr)

    def test_verify_names_what_differs(self):
        folder = self.copy("aneurysm")
        self.report("--verify")
        self.assertIn("verified: every file is what its report says", self.done.stdout)
        with open(folder / "shell.ply", "ab") as file:
            file.write(b"x")
        (folder / "coarse.ply").unlink()  # where the case was made it is still there
        self.refuse(4, "--verify", says="shell.ply: is not what relax wrote")
        self.refuse(4, "--verify", says="coarse.ply: that decimate wrote, is missing")
        self.assertIn("Outputs that are not what the reports say", self.page.read_text())

    def test_verify_names_a_chain_of_two_cases(self):
        case = self.copy("aneurysm")
        solved = {path.name: path.read_bytes() for path in case.iterdir() if path.stem in ("result", "simulate")}
        run_tool("decimate", case / "surface.ply", case / "coarse.ply", "--triangles", 150, "--force", report=case / "decimate.json")
        self.refuse(4, "--verify", says="relax.json: relax read another coarse.ply than decimate wrote")
        run_tool("relax", case / "coarse.ply", case / "surface.ply", case / "shell.ply", "--force", report=case / "relax.json")
        for name, content in solved.items():
            (case / name).write_bytes(content)
        self.refuse(4, "--verify", says="simulate.json: simulate read another shell.ply than relax wrote")

    def test_verify_names_folders_that_were_exchanged(self):
        for name in ("one", "two"):
            folder = self.copy(name)
            for path in folder.glob("*.json"):
                path.write_text(path.read_text().replace("/out/aneurysm/1/", f"/out/{name}/1/"))
        self.report("--verify")
        out = folder.parent.parent
        for before, after in (("one", "other"), ("two", "one"), ("other", "two")):
            (out / before).rename(out / after)
        self.refuse(4, "--verify", says="one/1/simulate.json: simulate wrote it for two/1")

    def test_verify_names_files_that_no_report_tells_of(self):
        case = self.copy("aneurysm")
        (case / "map.png").write_bytes(b"of another case")
        self.refuse(4, "--verify", says="map.png: no report of relax tells what it wrote")
        (case / "map.png").unlink()
        (case / "refined.ply").write_bytes(b"of another run")
        self.refuse(4, "--verify", says="refined.ply: no report of simulate tells what it wrote")

    def test_verify_names_every_file_that_no_report_tells_of(self):
        case = self.copy("aneurysm")
        for name in (".relax.flags", "relax.log", "page.html", "result.hdf.part"):  # the pipeline's own, and a page
            (case / name).write_text("x", encoding="utf-8")
        self.report("--verify")
        shutil.copy(case / "shell.ply", case / "other.ply")
        (case / "other.json").write_text("{}", encoding="utf-8")
        self.refuse(4, "--verify", says="other.ply: no report tells of it: move it out of the case's folder")
        self.refuse(4, "--verify", says="other.json: no report tells of it")

    def test_verify_finds_files_whose_names_are_left_out(self):
        def left_out(reports):
            reports["decimate"]["arguments"]["--no-paths"] = True
            reports["decimate"]["outputs"][0]["path"] = "OUT.ply"
        case = self.copy("aneurysm", left_out)
        self.report("--verify")
        (case / "coarse.ply").write_text("ply")
        self.refuse(4, "--verify", says="decimate.json: no file beside it is the OUT.ply that decimate wrote")

    def test_a_report_that_has_gone_is_no_case_that_is_done(self):
        folder = self.copy("aneurysm")
        (self.out / ".cases").write_text(f"aneurysm/1\t{folder.relative_to(self.out)}\tsimulate\t0\tdone\n")
        self.report("--verify")
        (folder / "simulate.json").unlink()
        self.refuse(4, "--verify", says="simulate.json: is missing")
        self.assertNotIn("exit code 0", self.page.read_text(encoding="utf-8"))
        _, _, page = self.report()
        self.assertIn("Failed", page.text)
        (self.out / ".cases").unlink()
        self.refuse(4, "--verify", says="result.hdf: no report of simulate tells what it wrote")

    def test_verify_wants_hashes(self):
        def older(reports):
            reports["extract"]["outputs"] = [entry["path"] for entry in reports["extract"]["outputs"]]
        self.copy("aneurysm", older)
        self.refuse(4, "--verify", says="extract.json: tells no hashes of the outputs")

    def test_folders_that_hold_no_case(self):
        self.refuse(3, says="is not a folder")
        self.out.mkdir()
        self.refuse(3, says="holds no case")
        (self.out / ".cases").write_text("a\t../b\tnone\t\tx\n")
        self.refuse(3, says=".cases: is not what Makefile.pipeline writes")

    def test_damaged_reports_are_failures(self):
        folder = self.copy("aneurysm")
        (folder / "simulate.json").write_text("{")
        _, _, page = self.report()
        self.assertIn("simulate.json: is not a JSON report", page.text)
        self.assertIn("Failed", page.text)

    def test_an_existing_page_is_5_unless_forced(self):
        self.copy("aneurysm")
        self.page.write_text("mine")
        self.run_tool(self.out, "-o", self.page, code=5, says="exists")
        self.assertEqual(self.page.read_text(), "mine")
        self.run_tool(self.out, "-o", "page.txt", code=2, says=".html")
        self.run_tool(self.out, "-o", self.page, "--force", "--report", "-", report=False)
        report = json.loads(self.done.stdout)
        self.assertEqual(report["outputs"], [{"path": str(self.page), "sha256": cases.sha256(self.page)}])
        self.assertEqual([pathlib.Path(entry["path"]).name for entry in report["inputs"]],
                         ["decimate.json", "extract.json", "relax.json", "simulate.json"])
        self.assertEqual(report["result"]["cases"], 1)


if __name__ == "__main__":
    unittest.main()
