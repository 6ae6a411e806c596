"""Holds the stored maps of docs/stability: none of the default's cells is wrong, and what was right stays so."""
import csv
import os
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(os.environ["TUNICA_SOURCE"])
sys.path.insert(0, str(ROOT / "tests" / "bench"))

import stability  # noqa: E402  (from the folder above)
from atlas.judge import DOUBTFUL, RIGHT, WRONG  # noqa: E402

AGAIN = 5  # cells of every map that are run again
# Runs of seconds each.
LONG = ("near-spheres", "angled-sheets", "oscillator")


class Stored(unittest.TestCase):
    def test_every_map_is_there_and_whole(self):
        for name, (chart, _) in stability.charts().items():
            with self.subTest(name):
                verdicts = stability.stored(name)
                self.assertEqual(sorted(verdicts), sorted(chart.cells()))
                with open(stability.PAGES / f"{name}.csv", encoding="utf-8", newline="") as file:
                    for row in csv.DictReader(file):
                        self.assertEqual(row["x"], chart.x.name(int(row["column"])))
                        self.assertEqual(row["y"], chart.y.name(int(row["row"])))
                        self.assertGreaterEqual(len(row["classes_of_seeds"]), 3)
                page = (stability.PAGES.parent / "stability.md").read_text(encoding="utf-8")
                for end in ("svg", "csv"):
                    self.assertTrue((stability.PAGES / f"{name}.{end}").exists())
                self.assertIn(f"stability/{name}.svg", page)

    def test_no_cell_of_the_default_or_of_the_second_order_scheme_is_wrong(self):
        wrong = {name: [place for place, (verdict, _) in stability.stored(name).items() if verdict.letter == WRONG]
                 for name, (_, method) in stability.charts().items() if method.name in ("default", "second-order")}
        self.assertEqual({name: cells for name, cells in wrong.items() if cells}, {})


class Again(unittest.TestCase):
    def test_cells_that_were_right_are_right(self):
        """The worst seed of some cells of every map of the default, the same ones each time."""
        for name, (chart, method) in stability.charts().items():
            if method.name != "default" or chart.name in LONG:
                continue
            right = [(place, seed) for place, (verdict, seed) in sorted(stability.stored(name).items())
                     if verdict.letter == RIGHT]
            for place, seed in right[::max(1, len(right) // AGAIN)]:
                with self.subTest(cell=f"{name}/{place[0]}-{place[1]}", seed=seed), \
                        tempfile.TemporaryDirectory(prefix="tunica-stability-") as folder:
                    verdict, _ = stability.run_cell(chart, method, place, seed, folder)
                    self.assertEqual(verdict.letter, RIGHT, verdict)


    def test_long_steps_of_the_second_order_scheme_are_told(self):
        chart, method = stability.charts()["oscillator-second-order"]
        for step, letter in ((2, RIGHT), (3, DOUBTFUL)):
            with self.subTest(step=chart.x.name(step)), tempfile.TemporaryDirectory(prefix="tunica-stability-") as folder:
                verdict, _ = stability.run_cell(chart, method, (step, 2), 2, folder)
                self.assertEqual(verdict.letter, letter, verdict)


class Verdicts(unittest.TestCase):
    """What cannot fail shows nothing."""

    def test_classes(self):
        from atlas.judge import Ended, Runner, judged

        def ended(code):
            def measure(_):
                raise Ended(code, "why")
            return measure

        def warned(runner):
            runner.warnings.append("careful")
            return 0.5

        for measure, letter in ((lambda _: 0.09, "R"), (lambda _: -0.11, "W"), (lambda _: float("nan"), "W"),
                                (lambda _: float("inf"), "W"), (warned, "D"), (ended(2), "X"), (ended(3), "X"),
                                (ended(4), "X"), (ended(1), "W"), (ended(-11), "W"), (ended(-1), "W")):
            self.assertEqual(judged(measure, Runner("nowhere")).letter, letter)


if __name__ == "__main__":
    unittest.main()
