"""tests/bench/history.py on made-up histories: what it calls slower, and what it holds a line against. No time is measured."""
import os
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(os.environ.get("TUNICA_SOURCE", Path(__file__).resolve().parents[3]))
sys.path.insert(0, str(ROOT / "tests" / "bench"))

import history  # noqa: E402  (from the folder above)


def line(commit="c", processor="some processor", instruction_set="x86-64-v3", **numbers):
    row = dict(zip(history.ABOUT, ("2026-01-01", commit, "1.0.0", instruction_set, processor)))
    return {**row, **{name.replace("_counted", history.COUNTED): f"{number}" for name, number in numbers.items()}}


class History(unittest.TestCase):
    def test_slower_than_the_median(self):
        earlier = [line(relax=number) for number in (1.0, 1.1, 0.9, 5.0, 1.0)]  # one line of a disturbed run
        for number, expected in ((1.24, 0), (1.26, 1), (0.1, 0)):
            found, count = history.slower(earlier, line(relax=number, extract=9.0), 1.25)
            self.assertEqual((len(found), count), (expected, 5), number)
        found, _ = history.slower(earlier, line(relax="2.000", extract="1.0"), 1.25)
        self.assertEqual(found, ["relax: 2.000 is 2.00 times the median 1.000 of 5 lines"])
        self.assertEqual(len(history.slower(earlier, line(relax=2.0), 2.5)[0]), 0)

    def test_counts_have_a_factor_of_their_own(self):
        earlier = [line(relax_counted=1000.0)] * 3
        self.assertEqual(len(history.slower(earlier, line(relax_counted=1029.0), 9)[0]), 0)
        self.assertEqual(len(history.slower(earlier, line(relax_counted=1031.0), 9)[0]), 1)

    def test_too_few_lines_say_nothing(self):
        for count in range(history.LEAST):
            found, lines = history.slower([line(relax=1.0)] * count, line(relax=9.0))
            self.assertEqual((found, lines), ([], count))
        # A benchmark that is new has none of its own.
        earlier = [line(relax=1.0), line(relax=1.0), line(relax=1.0, compare=1.0)]
        self.assertEqual([words[:5] for words in history.slower(earlier, line(relax=9.0, compare=9.0))[0]], ["relax"])

    def test_other_processors_and_instruction_sets_are_no_measure(self):
        others = [line(relax=1.0, processor="another")] * 5 + [line(relax=1.0, instruction_set="x86-64")] * 5
        self.assertEqual(history.slower(others, line(relax=9.0)), ([], 0))
        self.assertEqual(len(history.slower([line(relax=1.0)] * 3 + others, line(relax=9.0))[0]), 1)

    def test_only_the_latest_lines_count(self):
        earlier = [line(relax=1.0)] * 50 + [line(relax=3.0)] * history.EARLIER
        self.assertEqual(history.slower(earlier, line(relax=3.1)), ([], history.EARLIER))

    def test_a_table_is_read_as_it_was_written(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "history.tsv"
            self.assertEqual(history.read_table(path), [])
            rows = [line(relax=1.0), line(relax=2.0, compare=0.5)]
            history.write_table(path, rows)
            found = history.read_table(path)
            self.assertEqual(found, [{**rows[0], "compare": ""}, rows[1]])
            self.assertEqual(history.slower([found[0]] * 3, found[1])[0],
                             ["relax: 2.0 is 2.00 times the median 1.000 of 3 lines"])
            self.assertEqual([entry.name for entry in Path(folder).iterdir()], ["history.tsv"])

    def test_a_table_that_is_none_is_refused_by_line(self):
        head = "\t".join((*history.ABOUT, "relax"))
        about = "\t".join("abcde")
        for text, words in (("", ":1: is not the head"), ("a\tb\n", ":1: is not the head"), (f"{head}\trelax\n", ":1: "),
                            (f"{head}\n{about}\n", ":2: has 5 cells, the head has 6"),
                            (f"{head}\n{about}\t1.0\n{about}\tnan\n", ":3: relax: 'nan' is no number"),
                            (f"{head}\n{about}\t-1\n", "'-1'"), (f"{head}\n{about}\t1e5\n", "'1e5'")):
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "history.tsv"
                path.write_text(text)
                with self.assertRaises(history.Refused) as refusal:
                    history.read_table(path)
                self.assertIn(words, str(refusal.exception))

    def test_the_stored_table_can_be_read(self):
        history.read_table(ROOT / "docs" / "tables" / "history.tsv")


if __name__ == "__main__":
    unittest.main()
