#!/usr/bin/python3
"""A cohort of phantoms of varied shape, size and noise, with broken cases among them, run to its end: seconds, and which
cases failed other than they should.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/bench/cohort_bench.py [--cases 200] [--jobs 2]
"""
import argparse
import csv
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cohort
from running import BIN, SOURCE



def run(folder, jobs):
    """@return seconds, make's exit code and the rows of summary.tsv"""
    start = time.monotonic()
    words = {"BIN": BIN, "OUT": folder / "out", "CASES": folder / "cases.tsv", "SHELLS": "60", **cohort.WALL}
    done = subprocess.run(["make", "-f", SOURCE / "Makefile.pipeline", f"-j{jobs}", "-k", *(f"{k}={v}" for k, v in words.items())],
                          capture_output=True, check=False)
    with open(folder / "out" / "summary.tsv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE))
    return time.monotonic() - start, done.returncode, rows


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--cases", type=int, default=200, help="good ones; the broken ones come on top")
    arguments.add_argument("--jobs", type=int, default=2)
    options = arguments.parse_args()
    with tempfile.TemporaryDirectory(prefix="tunica-cohort-") as name:
        folder = Path(name)
        good = cohort.make_cohort(folder, options.cases, (16, 18, 20))
        seconds, code, rows = run(folder, options.jobs)
        own = [float(row["seconds"]) for row in rows if row["message"] == "done"]
        print(f"{len(rows)} cases, {len(own)} done, {len(rows) - len(own)} failed: {seconds:.0f} s, exit code {code}; "
              f"a case {statistics.median(own):.1f} s in the median, {max(own):.1f} s at most", flush=True)
        wrong = cohort.wrong_rows(rows, good)
        again, code, rows = run(folder, options.jobs)
        print(f"again, with nothing changed: {again:.0f} s, exit code {code}")
        wrong += cohort.wrong_rows(rows, good)
        print("\n".join(["other than expected:", *wrong]) if wrong else "every case ended as expected, both times")
        return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
