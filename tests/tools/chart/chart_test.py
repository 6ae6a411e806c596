#!/usr/bin/python3
"""tunica-chart from outside: what it draws, what it refuses, and with which exit code."""

import csv
import json
import math
import os
import random
import re
import unittest
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from running import ToolTest

SVG = "{http://www.w3.org/2000/svg}"


def report(tool="tunica-relax", ok=True, seconds=None, **result):
    return {"tool": tool, "version": "0", "ok": ok, "error": None if ok else "went wrong", "command": tool,
            "inputs": [], "outputs": [], "seconds": {"total": 2.0, **(seconds or {})}, "peak_mib": 1.0, "threads": 1,
            "result": result}


def relax(shells, error, seconds, **more):
    return report(seconds={"total": 1.5 * seconds, "relax": seconds}, shells=shells,
                  hausdorff_percent={"lower": None if error is None else 0.9 * error, "upper": error}, **more)


def probe(times, scale):
    return {"time_s": times, "load_factor": times, "displacement_mm": [[0, 0, scale * t] for t in times],
            "rotation_rad": [[0, 0, 0]] * len(times)}


class ChartCase(ToolTest):
    verb = "chart"

    def setUp(self):
        super().setUp()
        self.out = self.folder / "chart.svg"

    def write(self, name, content):
        path = self.folder / name
        path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
        return str(path)

    def draw(self, *arguments, warnings=0):
        self.run_tool(*arguments, "-o", self.out, "--csv", self.folder / "chart.csv", "--force")
        self.assertEqual(self.done.stderr.count("warning"), warnings, self.done.stderr)
        root = ElementTree.parse(self.out).getroot()
        with open(self.folder / "chart.csv", newline="", encoding="utf-8", errors="replace") as file:
            rows = list(csv.reader(file))
        return root, rows[0], rows[1:]

    def refused(self, code, *arguments, **options):
        self.run_tool(*arguments, "-o", self.out, code=code, **options)
        self.assertEqual(self.done.stderr.count("\n"), 1, self.done.stderr)
        self.assertEqual(sorted(p.name for p in self.folder.glob("chart.svg*")), [], "an output was left behind")


def marks(root):
    """Centres of the marks, in the order they were drawn."""
    centres = []
    for element in root.iter():
        if element.get("class") == "mark":
            if element.tag == SVG + "circle":
                centres.append((float(element.get("cx")), float(element.get("cy"))))
            else:
                corners = [tuple(map(float, pair.split(","))) for pair in element.get("points").split()]
                centres.append((sum(x for x, _ in corners) / len(corners), sum(y for _, y in corners) / len(corners)))
    return centres


def texts(root):
    return ["".join(element.itertext()) for element in root.iter(SVG + "text")]


class WhatIsDrawn(ChartCase):
    def test_default_is_time_against_error_one_mark_per_run(self):
        runs = [relax(100, 2.0, 0.1), relax(400, 0.5, 0.5), relax(1600, 0.12, 2.5)]
        root, head, rows = self.draw(*[self.write(f"{i}.json", run) for i, run in enumerate(runs)])
        self.assertEqual(head[4:6], ["seconds.relax", "result.hausdorff_percent.upper"])
        self.assertEqual([(float(r[4]), float(r[5])) for r in rows], [(0.1, 2.0), (0.5, 0.5), (2.5, 0.12)])
        self.assertEqual(len(marks(root)), 3)
        self.assertIn("Time to relax (s)", texts(root))
        self.assertIn("Hausdorff distance, upper bound (% of the diagonal)", texts(root))
        self.assertIn("Pareto front: no run is better in both", texts(root))

    def test_marks_stand_where_the_ticks_say(self):
        points = [(0.013, 7.0), (0.4, 0.3), (31.0, 0.02)]
        root, _, _ = self.draw(*[self.write(f"{i}.json", relax(1, y, x)) for i, (x, y) in enumerate(points)])
        ticks = {}
        for element in root.iter(SVG + "text"):
            anchor = element.get("text-anchor")
            if anchor == "middle" and re.fullmatch(r"[\d.]+", element.text or "") and not element.get("transform"):
                ticks[float(element.text)] = float(element.get("x"))
        self.assertGreaterEqual(len(ticks), 3)
        (a, xa), (b, xb) = sorted(ticks.items())[0], sorted(ticks.items())[-1]
        for (x, _), (px, _) in zip(points, marks(root)):
            part = (math.log(x) - math.log(a)) / (math.log(b) - math.log(a))
            self.assertAlmostEqual(px, xa + part * (xb - xa), delta=0.2)

    def test_linear_axes_for_a_narrow_range(self):
        root, _, _ = self.draw(*[self.write(f"{i}.json", relax(1, 2 + i, 1 + i)) for i in range(3)])
        x = [mark[0] for mark in marks(root)]
        y = [mark[1] for mark in marks(root)]
        self.assertAlmostEqual(x[2] - x[1], x[1] - x[0], delta=0.05)
        self.assertAlmostEqual(y[2] - y[1], y[1] - y[0], delta=0.05)
        self.assertGreater(x[1], x[0])
        self.assertLess(y[1], y[0])

    def test_key_through_a_list_gives_a_line_per_report(self):
        for name, factor in (("slow", 2), ("fast", 1)):
            steps = [{"shells": 10, "seconds": factor * k, "hausdorff_percent": {"lower": 1, "upper": 5.0 / k}}
                     for k in range(1, 6)]
            self.write(name + ".json", relax(10, 1.0, 5.0, iterations=steps))
        root, _, rows = self.draw(self.folder / "slow.json", self.folder / "fast.json", "--x",
                                  "result.iterations.seconds", "--y", "result.iterations.hausdorff_percent.upper")
        self.assertEqual(len(marks(root)), 10)
        self.assertEqual([row[2] for row in rows], [str(i) for i in range(5)] * 2)
        self.assertIn("slow", texts(root))
        self.assertIn("fast", texts(root))
        lines = [e for e in root.iter(SVG + "path") if e.get("class") != "front"]
        self.assertEqual(len(lines), 2)
        # The same against one value per report: it is repeated.
        _, _, rows = self.draw(self.folder / "slow.json", "--x", "result.shells", "--y", "result.iterations.seconds")
        self.assertEqual([row[4] for row in rows], ["10"] * 5)
        # One element by its number, the last by -1.
        _, _, rows = self.draw(self.folder / "slow.json", "--x", "result.shells", "--y", "result.iterations.-1.seconds")
        self.assertEqual([row[5] for row in rows], ["10"])

    def test_series_are_named_in_the_legend_numbers_in_order(self):
        runs = [self.write(f"{i}.json", relax(n, 1.0 + i, 1.0 + i)) for i, n in enumerate((800, 50, 800, 200))]
        root, head, rows = self.draw(*runs, "--series", "result.shells")
        legend = [text for text in texts(root) if text in ("50", "200", "800")]
        self.assertEqual(legend, ["50", "200", "800"])
        self.assertEqual(head[3], "series result.shells")
        self.assertEqual([row[3] for row in rows], ["800", "50", "800", "200"])
        root, _, _ = self.draw(*runs, "--series", "file", "--label", "result.shells", "--lines")
        self.assertTrue({"0", "1", "2", "3"} <= set(texts(root)))

    def test_pareto_front_in_the_table_is_the_undominated_set(self):
        points = [(1, 5), (2, 4), (2, 6), (3, 4), (4, 1), (5, 2), (6, 1), (1, 5)]
        _, head, rows = self.draw(*[self.write(f"{i}.json", relax(1, float(y), float(x)))
                                    for i, (x, y) in enumerate(points)])
        self.assertEqual(head[6], "pareto_front")
        expected = [not any((a <= x and b <= y) and (a < x or b < y) for a, b in points) for x, y in points]
        self.assertEqual([row[6] == "1" for row in rows], expected)

    def test_no_front_against_a_count(self):
        runs = [self.write(f"{n}.json", relax(n, 200 / n, n / 1000)) for n in (100, 400)]
        root, _, rows = self.draw(*runs, "--x", "result.shells")
        self.assertNotIn("Pareto front", texts(root))
        self.assertEqual([row[6] for row in rows], ["0", "0"])

    def test_natural_errors_and_times_of_the_tools(self):
        extract = report("tunica-extract", seconds={"extract": 0.2}, volume_mm3=990.0, voxel_volume_mm3=1000.0)
        _, _, rows = self.draw(self.write("e.json", extract))
        self.assertEqual((float(rows[0][4]), round(float(rows[0][5]), 9)), (0.2, 1.0))
        decimate = report("tunica-decimate", seconds={"decimate": 0.3}, hausdorff_percent={"lower": 0.1, "upper": 0.2})
        _, _, rows = self.draw(self.write("d.json", decimate))
        self.assertEqual((float(rows[0][4]), float(rows[0][5])), (0.3, 0.2))
        compare = report("tunica-compare", seconds={"compare": 0.4}, hausdorff_percent={"lower": 0.1, "upper": 0.3})
        root, _, rows = self.draw(self.write("c.json", compare), self.folder / "d.json", "--series", "tool")
        self.assertEqual([float(row[4]) for row in rows], [0.4, 0.3])
        self.assertIn("tunica-compare", texts(root))
        simulate = report("tunica-simulate", seconds={"solve": 3.0}, ms_per_step={"median": 7.5, "max": 9},
                          residual=1e-9)
        _, head, rows = self.draw(self.write("s.json", simulate))
        self.assertEqual(head[4:6], ["result.ms_per_step.median", "result.residual"])
        simulate["result"]["ms_per_step"] = {"median": None, "max": None}
        _, head, rows = self.draw(self.write("s.json", simulate))
        self.assertEqual(head[4], "seconds.solve")

    def test_default_error_of_a_simulation_is_what_it_estimates(self):
        simulate = report("tunica-simulate", seconds={"solve": 3.0}, ms_per_step={"median": 7.5, "max": 9},
                          algebraic_error_percent=1e-7, estimates={"membrane_p99_mpa": {"percent": 2.5}})
        root, head, rows = self.draw(self.write("s.json", simulate))
        self.assertEqual((head[4:6], float(rows[0][5])),
                         (["result.ms_per_step.median", "result.estimates.membrane_p99_mpa.percent"], 2.5))
        self.assertIn("Estimated error, membrane stress p99 (%)", texts(root))
        simulate["result"]["accuracy"] = {"estimate_percent": 1.5}
        root, head, rows = self.draw(self.write("s.json", simulate))
        self.assertEqual((head[4:6], [float(number) for number in rows[0][4:6]]),
                         (["seconds.solve", "result.accuracy.estimate_percent"], [3.0, 1.5]))
        self.assertIn("Accuracy, estimated error (%)", texts(root))

    def test_reports_of_one_name_are_told_apart_by_their_folders(self):
        paths = []
        for organ, error in (("aorta", 0.2), ("bladder", 0.4)):
            (self.folder / "out" / organ / "1").mkdir(parents=True)
            paths.append(self.write(f"out/{organ}/1/relax.json", relax(100, error, 1)))
        root, _, _ = self.draw(*paths, "--label", "file")
        self.assertLessEqual({"aorta", "bladder"}, set(texts(root)))
        root, _, _ = self.draw(paths[0], self.write("out/aorta/1/fit.json", relax(90, 0.1, 1)), "--label", "file")
        self.assertLessEqual({"relax", "fit"}, set(texts(root)))

    def test_title_and_labels_are_escaped(self):
        root, _, _ = self.draw(self.write("a.json", relax(1, 1.0, 1.0, note="<&\">")), "--title", "a < b & \"c\" é",
                               "--x-label", "x<y", "--y-label", "]]>", "--series", "result.note")
        self.assertTrue({'a < b & "c" é', "x<y", "]]>", '<&">'} <= set(texts(root)))

    def test_file_names_of_any_bytes(self):
        path = os.path.join(os.fsencode(self.folder), b"a,\"\xff\n<b>.json")
        with open(path, "w", encoding="utf-8") as file:
            json.dump(relax(1, 1.0, 1.0), file)
        self.run_tool(path, "-o", self.out, "--series", "file", "--label", "file", "--csv", "c.csv")
        ElementTree.parse(self.out)

    def test_same_bytes_every_time(self):
        runs = [self.write(f"{i}.json", relax(i, 1.0 / i, float(i))) for i in range(1, 20)]
        self.draw(*runs, "--series", "result.shells")
        first = self.out.read_bytes()
        self.draw(*runs, "--series", "result.shells", "--threads", "3")
        self.assertEqual(self.out.read_bytes(), first)

    def test_everything_stays_inside_the_picture(self):
        names = ["a long name of a run that goes on and on " * 3, "W" * 60, "漢字" * 30]
        for i, name in enumerate(names):
            self.write(f"{i}.json", relax(i, 10.0 ** (3 * i - 7), 10.0 ** (4 * i - 3), name=name))
        root, _, _ = self.draw(*[self.folder / f"{i}.json" for i in range(3)], "--series", "result.name", "--title",
                               "T" * 400, "--label", "result.name")
        width = float(root.get("width"))
        for element in root.iter(SVG + "text"):
            size = float(element.get("font-size"))
            length = 0.5 * size * len("".join(element.itertext()))
            left = float(element.get("x")) - {"middle": length / 2, "end": length}.get(element.get("text-anchor"), 0)
            if not element.get("transform"):
                self.assertGreaterEqual(left, 0)
                self.assertLessEqual(left + length, width)

    def test_failed_runs_stand_on_the_rim_with_their_code(self):
        good = [self.write(f"{i}.json", relax(1, 1.0 / i, float(i), way="a")) for i in (1, 100)]
        late = self.write("late.json", {**report(ok=False, seconds={"relax": 10.0}, way="a"), "exit": "exit 4"})
        lost = self.write("lost.json", {**report(ok=False, way="b"), "exit": "exit 3"})
        root, head, rows = self.draw(*good, late, lost, "--failed", "exit", "--series", "result.way")
        failures = [e for e in root.iter() if e.get("class") == "failure"]
        self.assertEqual(len(failures), 2)
        self.assertEqual(len(marks(root)), 2)
        self.assertTrue({"exit 4", "exit 3", "a", "b"} <= set(texts(root)))
        (first, top), (last, _) = marks(root)
        self.assertAlmostEqual(float(failures[0].get("cx")), (first + last) / 2, delta=0.1)
        self.assertLess(float(failures[0].get("cy")), top)
        self.assertEqual([row[3:6] + row[7:8] for row in rows[2:]], [["a", "10", "", "exit 4"], ["b", "", "", "exit 3"]])
        self.assertEqual([row[6] for row in rows], ["1", "1", "0", "0"])
        self.out.unlink()
        self.refused(3, lost, "--failed", "exit", says=["every run failed"])
        self.refused(3, good[0], late, "--failed", "nothing", says=["late.json", "nothing"])

    def test_guides_to_read_marks_by(self):
        run = self.write("a.json", relax(1, 0.5, 1.0))
        root, _, _ = self.draw(run, "--guide", "diagonal", "--guide-label", "as asked for")
        self.assertIn("as asked for", texts(root))
        root, _, _ = self.draw(run, self.write("b.json", relax(1, 100.0, 2.0)), "--guide", "1000")
        self.assertIn("y = 1000", texts(root))
        self.assertIn("1,000", texts(root), "the axis does not reach the guide")
        for line in ("steep", "1e999", "nan"):
            self.run_tool(run, "-o", "none.svg", "--guide", line, code=2)

    def test_commands_stand_in_the_table(self):
        _, head, rows = self.draw(self.write("a.json", {**relax(1, 0.5, 1.0), "command": "tunica-relax a 'b c'"}))
        self.assertEqual(rows[0][head.index("command")], "tunica-relax a 'b c'")

    def test_a_title_breaks_between_words(self):
        title = "one two three four five six seven eight nine ten " * 2
        root, _, _ = self.draw(self.write("a.json", relax(1, 0.5, 1.0)), "--title", title.strip())
        lines = [text for text in texts(root) if "three" in text or "nine" in text]
        self.assertGreater(len(lines), 1)
        self.assertEqual(" ".join(lines), title.strip())

    def test_report_of_the_run(self):
        runs = [self.write("a.json", relax(1, 1.0, 1.0)), self.write("b.json", report(ok=False))]
        self.draw(*runs, warnings=1)
        made = self.done.report
        self.assertEqual(len(made["inputs"]), 2)
        self.assertEqual([Path(entry["path"]).name for entry in made["outputs"]], ["chart.svg", "chart.csv"])
        self.assertEqual(made["result"]["marks"], 1)
        self.assertEqual(made["result"]["skipped"], [runs[1]])
        self.assertTrue({"read", "draw", "write"} <= set(made["seconds"]))


class Reference(ChartCase):
    def simulation(self, name, **result):
        return self.write(name, report("tunica-simulate", seconds={"solve": 1.0}, **result))

    def test_probes_at_common_times(self):
        fine = self.simulation("fine.json", probes={"tip": probe([0, 0.5, 1], 2.0), "base": probe([0, 1], 0.0)})
        same = self.simulation("same.json", probes={"tip": probe([0, 0.25, 0.75, 1], 2.0)})
        off = self.simulation("off.json", probes={"tip": probe([0, 0.2, 1], 2.2), "other": probe([0, 1], 9)})
        late = self.simulation("late.json", probes={"tip": probe([0, 0.5, 1, 5], 2.2)})
        root, head, rows = self.draw(same, off, late, "--reference", fine)
        self.assertEqual(head[5], "error_percent")
        for row, expected in zip(rows, (0, 10, 10)):
            self.assertAlmostEqual(float(row[5]), expected, places=9)
        self.assertIn("Error of the probes' displacement (%)", texts(root))

    def test_largest_displacement_where_there_are_no_probes(self):
        fine = self.simulation("fine.json", max_displacement_mm=4.0, probes={})
        _, _, rows = self.draw(self.simulation("a.json", max_displacement_mm=5.0), fine, "--reference", fine)
        self.assertEqual([float(row[5]) for row in rows], [25, 0])

    def test_stress_where_nothing_moves(self):
        fine = self.simulation("fine.json", max_displacement_mm=0.0, wall={"membrane_p99_mpa": 0.2})
        run = self.simulation("a.json", max_displacement_mm=0.0, wall={"membrane_p99_mpa": 0.21})
        root, _, rows = self.draw(run, "--reference", fine)
        self.assertAlmostEqual(float(rows[0][5]), 5, places=9)
        self.assertIn("Error of the membrane stress (%)", texts(root))

    def test_runs_of_other_inputs_than_the_reference_are_named(self):
        def stating(name, displacement, **stated):
            return self.write(name, {**report("tunica-simulate", seconds={"solve": 1.0}, max_displacement_mm=displacement),
                                     "stated": {"pressure_mpa": 0.016, "membrane": "adapt", **stated}})

        fine = stating("fine.json", 4.0)
        self.draw(stating("a.json", 4.4, membrane="opt"), "--reference", fine)
        other = stating("b.json", 2.0, pressure_mpa=0.008)
        self.draw(other, fine, "--reference", fine, warnings=1)
        self.run_tool(other, fine, "--reference", fine, "-o", self.out, "--force",
                      says=("1 of 2 runs", "b.json", "pressure_mpa 0.008, 0.016 in the reference"))

    def test_runs_that_act_elsewhere_than_the_reference_are_named(self):
        def stating(name, displacement, **where):
            load = {"body": name, "kind": "pressure", "value": "1000Pa", **where}
            return self.write(name, {**report("tunica-simulate", seconds={"solve": 1.0}, max_displacement_mm=displacement),
                                     "stated": {"pressure_mpa": 0.001, "scene": {"load": [load]}}})

        region = {"where": {"above": {"axis": "z", "at": "0.001m"}}}
        fine = stating("fine.json", 4.0, **region)
        self.draw(stating("same.json", 4.4, **region), "--reference", fine)
        for other in (stating("b.json", 2.0), stating("c.json", 2.0, where={"above": {"axis": "x", "at": "0.001m"}})):
            self.draw(other, fine, "--reference", fine, warnings=1)
            self.run_tool(other, fine, "--reference", fine, "-o", self.out, "--force", says=("1 of 2 runs", "[[load]]"))
        nodes = [stating(f"n{i}.json", 4.0 + i, where={"nodes": [i]}) for i in range(2)]
        self.draw(nodes[1], "--reference", nodes[0])

    def test_no_front_across_organs(self):
        def run(name, seconds, error, target):
            return self.write(name, {**relax(8, error, seconds), "arguments": {"TARGET": "surface.ply"},
                                     "inputs": [{"path": "surface.ply", "sha256": target}]})

        self.draw(run("c.json", 1.0, 2.0, "a"), "--reference", run("d.json", 2.0, 1.0, "b"), warnings=1)
        for targets, fronts in ((("a", "a"), 1), (("a", "b"), 0)):
            runs = [run(f"{i}.json", 1.0 + i, 2.0 - i, target) for i, target in enumerate(targets)]
            root, _, rows = self.draw(*runs)
            self.assertEqual("Pareto front: no run is better in both" in texts(root), fronts == 1)
            self.assertEqual(sum(int(row[6]) for row in rows), 2 * fronts)

    def test_a_distance_is_held_against_the_reference(self):
        fine = self.write("fine.json", relax(9, 0.5, 1.0))
        _, _, rows = self.draw(self.write("a.json", relax(1, 2.0, 1.0)), "--reference", fine)
        self.assertEqual(float(rows[0][5]), 1.5)

    def test_a_key_against_the_reference(self):
        fine = self.simulation("fine.json", strain_energy_mj=8.0)
        root, _, rows = self.draw(self.simulation("a.json", strain_energy_mj=6.0), "--reference", fine, "--y",
                                  "result.strain_energy_mj")
        self.assertEqual(float(rows[0][5]), 25)
        self.assertIn("Error of the strain energy (%)", texts(root))

    def test_reference_that_is_zero_or_null(self):
        fine = self.simulation("fine.json", max_displacement_mm=0.0, strain_energy_mj=None)
        run = self.simulation("a.json", max_displacement_mm=1.0, strain_energy_mj=1.0)
        self.refused(3, run, "--reference", fine, says=["nothing to draw"])
        self.refused(3, run, "--reference", fine, "--y", "result.strain_energy_mj", says=["fine.json"])

    def test_references_that_do_not_fit_are_named(self):
        run = self.simulation("a.json", max_displacement_mm=1.0, probes={"p": probe([0, 1], 1)})
        self.refused(3, run, "--reference", self.write("f.json", report(ok=False)), says=["f.json", "failed"])
        self.refused(3, run, "--reference", self.folder / "none.json", says=["none.json"])
        self.refused(3, run, "--reference", self.write("r.json", relax(1, 1.0, 1.0)), says=["a.json", "r.json"])
        for damage in ({"displacement_mm": []}, {"displacement_mm": [[1, 2]]}, {"displacement_mm": [[1, 2, "x"]]}, {},
                       [1], None, {"displacement_mm": 3}):
            bad = self.simulation("b.json", probes={"p": damage})
            self.refused(3, run, "--reference", bad, says=["b.json", "probe 'p'"])
            self.refused(3, bad, "--reference", run, says=["b.json", "probe 'p'"])


class WhatIsLeftOut(ChartCase):
    def test_failed_runs_are_skipped_with_a_warning(self):
        good = self.write("good.json", relax(1, 1.0, 1.0))
        bad = self.write("bad.json", report(ok=False))
        _, _, rows = self.draw(bad, good, warnings=1)
        self.assertEqual(len(rows), 1)
        self.run_tool(bad, bad, "-o", "none.svg", code=3, says="every run failed")
        self.assertFalse((self.folder / "none.svg").exists())

    def test_runs_without_a_value_are_left_out_with_a_warning(self):
        null = self.write("null.json", relax(1, None, 1.0))
        _, _, rows = self.draw(null, self.write("good.json", relax(1, 1.0, 1.0)), warnings=1)
        self.assertEqual(len(rows), 1)
        self.run_tool(null, "-o", "none.svg", code=3, says="nothing to draw")

    def test_one_point_equal_values_zero_and_negative(self):
        for values in ([(1, 1)], [(1, 1)] * 3, [(0, 0)], [(0, 1), (5, 1)], [(-5, 3), (900, 3)], [(0, 0.1), (1, 0), (1000, 5)],
                       [(1e-300, 1e300), (1e300, 1e-300)], [(1, 1e-320)]):
            runs = [self.write(f"{i}.json", relax(1, float(y), float(x))) for i, (x, y) in enumerate(values)]
            root, _, rows = self.draw(*runs)
            self.assertEqual(len(marks(root)), len(values))
            self.assertNotIn("nan", self.out.read_text())
            self.assertEqual([(float(r[4]), float(r[5])) for r in rows], values)

    def test_negative_on_a_logarithmic_axis_is_left_out_with_a_warning(self):
        runs = [self.write(f"{i}.json", relax(1, 1.0, x)) for i, x in enumerate((-1.0, 0.0, 10.0))]
        root, _, _ = self.draw(*runs, "--x-scale", "log", warnings=1)
        self.assertEqual(len(marks(root)), 2)
        root, _, _ = self.draw(*runs, "--x-scale", "linear")
        self.assertEqual(len(marks(root)), 3)


class WhatIsRefused(ChartCase):
    def test_missing_key_names_the_file_and_the_keys_there_are(self):
        a = self.write("a.json", relax(1, 1.0, 1.0))
        for flags in (["--x", "seconds.solve"], ["--y", "result.nothing"], ["--series", "nope"], ["--label", "nope"],
                      ["--x", ""], ["--x", "result.shells.more"], ["--x", "."]):
            self.refused(3, a, *flags, says=["a.json", "result.shells", "result.hausdorff_percent.upper"])
        self.refused(3, a, "--x", "result.hausdorff_percent", says=["a.json", "result.hausdorff_percent.lower"])
        self.refused(3, a, "--x", "tool", says=["a.json", "not a number"])

    def test_lists_that_do_not_pair_up(self):
        a = self.write("a.json", relax(1, 1.0, 1.0, p=[1, 2, 3], q=[1, 2]))
        self.refused(3, a, "--x", "result.p", "--y", "result.q", says=["a.json", "pair"])

    def test_files_that_are_no_reports(self):
        deep = b'{"tool":"tunica-relax","ok":true,"seconds":{},"result":{"a":' + b"[" * 100000 + b"]" * 100000 + b"}}"
        good = json.dumps(relax(1, 1.0, 1.0)).encode()
        cases = {"empty": b"", "text": b"hello\n", "cut": good[: len(good) // 2], "list": b"[1, 2]", "number": b"3",
                 "null": b"null", "nan": good.replace(b'"upper": 1.0', b'"upper": NaN'),
                 "overflow": good.replace(b'"upper": 1.0', b'"upper": 1e999'), "deep": deep, "opened": b"[" * 1000000,
                 "other": b'{"a": 1}', "foreign": good.replace(b"tunica-relax", b"another-tool"),
                 "no ok": good.replace(b'"ok": true, ', b""), "ok text": good.replace(b'"ok": true', b'"ok": "yes"'),
                 "result list": good[: good.index(b'"result"')] + b'"result": []}', "binary": bytes(range(256)) * 10,
                 "trailing": good + b"x", "bad utf-8": good.replace(b"tunica-relax", b"tunica-\xff\xfe")}
        for name, content in cases.items():
            with self.subTest(name):
                self.refused(3, self.write(name + ".json", content), says=[name + ".json"])

    def test_missing_and_odd_files(self):
        self.refused(3, self.folder / "none.json", says=["none.json"])
        self.refused(3, self.folder, says=[str(self.folder)])

    def test_a_file_larger_than_any_report_is_not_read(self):
        path = self.folder / "huge.json"
        with open(path, "wb") as file:
            file.truncate(1 << 40)
        self.refused(3, path, says=["huge.json", "too large"], report=False)  # which would say the sum of its bytes

    def test_random_damage_never_crashes(self):
        generator = random.Random(7)
        good = json.dumps(relax(1, 1.0, 1.0, iterations=[{"seconds": 1, "hausdorff_percent": {"upper": 1}}] * 3),
                          indent=1).encode()
        for round in range(40):
            data = bytearray(good)
            for _ in range(generator.randint(1, 5)):
                data[generator.randrange(len(data))] = generator.choice(b'{}[]",:0e-.\xff\x00n')
            with self.subTest(round=round):
                self.run_tool(self.write("x.json", bytes(data)), "-o", self.out, "--force", code=(0, 3))

    def test_existing_outputs_are_kept_without_force(self):
        a = self.write("a.json", relax(1, 1.0, 1.0))
        self.out.write_text("mine")
        self.run_tool(a, "-o", self.out, code=5, says="--force")
        self.assertEqual(self.out.read_text(), "mine")
        table = self.folder / "t.csv"
        table.write_text("mine")
        self.run_tool(a, "-o", "new.svg", "--csv", table, code=5)
        self.assertEqual(table.read_text(), "mine")
        self.assertFalse((self.folder / "new.svg").exists())
        self.run_tool(a, "-o", self.out, "--force")
        self.assertIn("<svg", self.out.read_text())
        self.run_tool(a, "-o", "no/c.svg", code=5)

    def test_wrong_usage_is_2(self):
        a = self.write("a.json", relax(1, 1.0, 1.0))
        self.run_tool(a, code=2)
        self.run_tool("-o", self.out, code=2)
        self.refused(2, a, "--x-scale", "cubic")
        self.refused(2, a, "--nonsense")
        self.run_tool(a, "-o", self.out, "--csv", self.out, code=2)

    def test_help_and_version(self):
        self.run_tool("--help", report=False)
        self.assertIn("Example", self.done.stdout)
        self.run_tool("--version", report=False)


if __name__ == "__main__":
    unittest.main()
