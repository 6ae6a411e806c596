#!/usr/bin/python3
"""Tables of cases with damage: tools/cases.py reads them, or refuses them in words, and does nothing else."""

import os
import random
import sys
import unittest
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest import mock

SOURCE = Path(os.environ.get("TUNICA_SOURCE", Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(SOURCE / "tools"))
import cases  # noqa: E402  it stands beside the pipeline, not among the tests

FOLDER = SOURCE / "tests" / "fuzz"
EXTREME = (b"\t", b"\n", b"\r", b'"', b"'", b"\0", b"\x1b", b"\xff", b"\xe2\x80\xa8", b"\xef\xbb\xbf", b"/", b"..", b"~", b"~root/",
           b"$(shell false)", b"*[", b"%", b"#", b"case", b"label", b"volume", b"9" * 5000, b"-" * 200000)


def damaged(table, seed):
    """A copy with one to four places replaced, removed, repeated or moved; the same seed gives the same copy."""
    dice = random.Random(seed)
    for _ in range(dice.randint(1, 4)):
        at = dice.randint(0, len(table))
        end = min(len(table), at + dice.randint(0, 40))
        kind = dice.randrange(5)
        if kind == 0:
            table = table[:at] + dice.choice(EXTREME) + table[end if dice.random() < 0.5 else at:]
        elif kind == 1:
            table = table[:at] + table[end:]
        elif kind == 2:
            table = table[:end] + table[at:]
        elif kind == 3:
            table = table[:at] + bytes([dice.randrange(256)]) + table[at + 1:]
        else:
            rest = table[:at] + table[end:]
            to = dice.randint(0, len(rest))
            table = rest[:to] + table[at:end] + rest[to:]
    return table


class DamagedTables(unittest.TestCase):
    COPIES = int(os.environ.get("TUNICA_FUZZ_COPIES", "1000"))

    def read(self, bytes_, what):
        """True where the table was read."""
        with TemporaryDirectory() as folder:
            path = Path(folder) / "cases.tsv"
            path.write_bytes(bytes_)
            with mock.patch.dict(os.environ, {"CASES": str(path), "KIND": "static", "IMAGED_AT": "0kPa"}), mock.patch.object(cases, "say"):
                try:
                    found = cases.find_cases(os.path.join(folder, "out"))
                except cases.Refused as refused:
                    self.assertTrue(refused.args, what)
                    for line in refused.args:
                        self.assertTrue(line and "\n" not in line and "\0" not in line, (what, line))
                    found = None
            if found is None:
                return False
            self.assertTrue(found, what)
            self.assertEqual(len({case.name for case in found}), len(found), what)
            for case in found:
                if case.refused is None:
                    self.assertEqual(os.path.normpath(case.folder), case.folder, (what, "results stay in their folder"))
                    self.assertTrue(case.folder.startswith(os.path.join(folder, "out") + os.sep), what)
            return True

    def test_each_is_read_or_refused_in_words(self):
        tables = sorted((FOLDER / "seeds" / "cases").iterdir()) + sorted((FOLDER / "found").glob("cases/*"))
        read = 0
        for path in tables:
            whole = path.read_bytes()
            if path.parent.parent.name == "seeds":
                self.assertTrue(self.read(whole, path))
            else:
                self.read(whole, path)
            read += sum(self.read(damaged(whole, seed), (path, seed)) for seed in range(self.COPIES))
        self.assertGreater(read, self.COPIES // 20, "some damage is harmless")
        self.assertLess(read, self.COPIES * len(tables) // 2, "most damage is felt")


if __name__ == "__main__":
    unittest.main()
