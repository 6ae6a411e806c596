#!/usr/bin/python3
"""How long the tools take, as a line of a table that grows from commit to commit, and what has become slower.

    TUNICA_BIN=build/release/bin tests/bench/history.py [--table docs/tables/history.tsv] [--factor 1.25] [--look]

Each number is the processor time of a tool on a fixed input, on one thread, over that of a reference kernel that is none of
tunica's and runs in turn with it, each the least of five: a slow or busy machine slows both. The lines of other processors and instruction
sets are no measure for it, since the two do not slow alike there. Columns that end in .instructions are counts in millions,
where the machine or valgrind can count them (--instructions).

A number that is above the factor times the median of the earlier ones is named, and the exit code is 1.
"""
import argparse
import os
import random
import re
import statistics
import subprocess
import sys
import tempfile
import time
import zlib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BIN = os.path.abspath(os.environ.get("TUNICA_BIN", ROOT / "build" / "release" / "bin"))
ABOUT = ("date", "commit", "version", "instruction_set", "processor")
COUNTED = ".instructions"
FACTOR, COUNTED_FACTOR = 1.25, 1.03
EARLIER = 20  # lines that a new one is held against, the latest
LEAST = 3     # without so many there is no usual time
REPEATED = 5
MATERIAL = ("--young", "1MPa", "--poisson", "0.45", "--thickness", "1.5mm", "--fix", "rigid-motions", "--force")
# Name, tool, and its words; each reads what an earlier one wrote.
BENCHMARKS = (
    ("phantom", "phantom", ("bladder", "volume.nii.gz", "--size", "64", "--force")),
    ("extract", "extract", ("volume.nii.gz", "surface.ply", "--label", "1", "--smooth", "staircase", "--force")),
    ("decimate", "decimate", ("surface.ply", "coarse.ply", "--triangles", "1000", "--force")),
    ("relax", "relax", ("coarse.ply", "surface.ply", "shell.ply", "--refine", "--tolerance", "1%", "--force")),
    ("compare", "compare", ("coarse.ply", "surface.ply")),
    ("static", "simulate", ("shell.ply", "static.hdf", "--static", "--pressure", "1kPa", "--load-steps", "3", *MATERIAL)),
    ("dynamic", "simulate", ("shell.ply", "dynamic.hdf", "--pressure", "0.1kPa", "--density", "1100kg/m3", "--duration",
                             "50ms", "--step", "5ms", *MATERIAL)),
)


class Refused(Exception):
    """A table that is none of this program's."""


# --------------------------------------------------------------------------------------------------------------- measure

def reference(text):
    """The kernel: packs a text, some tenths of a second. @return seconds of the processor"""
    begin = time.process_time()
    zlib.compress(text, 6)
    return time.process_time() - begin


def reference_text():
    words = [bytes(random.Random(number).randbytes(6)) for number in range(4000)]
    choice = random.Random(1)
    return b"".join(choice.choices(words, k=900_000))


def command(tool, words):
    return [os.path.join(BIN, "tunica-" + tool), *words, "--threads", "1", "--quiet"]


def seconds_of(tool, words, folder):
    """Seconds of the processor that a tool takes, from its start to its end."""
    before = os.times()
    subprocess.run(command(tool, words), cwd=folder, check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def instructions_of(tool, words, folder):
    """Instructions of a run in millions, by the processor's own counter or else by valgrind; none where neither counts."""
    for counter, pattern in ((["perf", "stat", "-x,", "-e", "instructions:u"], r"^(\d+),"),
                             (["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"], r"Collected : (\d+)")):
        try:
            done = subprocess.run([*counter, *command(tool, words)], cwd=folder, capture_output=True, text=True, check=False)
        except FileNotFoundError:
            continue
        count = re.search(pattern, done.stderr, re.MULTILINE)
        if done.returncode == 0 and count:
            return int(count.group(1)) / 1e6
    return None


def measure(folder, instructions):
    """@return the numbers by their columns"""
    text = reference_text()
    reference(text)
    numbers = {}
    for name, tool, words in BENCHMARKS:
        seconds_of(tool, words, folder)  # what it reads is then in the system's cache
        # Others on the machine only slow: the least is what was disturbed least.
        references, times = [], []
        for _ in range(REPEATED):
            references.append(reference(text))
            times.append(seconds_of(tool, words, folder))
        numbers[name] = f"{min(times) / min(references):.3f}"
        count = instructions_of(tool, words, folder) if instructions else None
        if count is not None:
            numbers[name + COUNTED] = f"{count:.1f}"
    return numbers


def about():
    """What is measured, and where."""
    def said(*words):
        return subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()

    changed = said("git", "status", "--porcelain", "--untracked-files=no", "--", "lib", "tools", "cmake", "CMakeLists.txt",
                   "CMakePresets.json")
    version, instruction_set = re.match(r"\S+ (\S+) \((.*)\)", said(os.path.join(BIN, "tunica-extract"), "--version")).groups()
    processor = next((line.partition(":")[2].strip() for line in Path("/proc/cpuinfo").read_text().splitlines()
                      if line.startswith("model name")), "unknown")
    return dict(zip(ABOUT, (time.strftime("%Y-%m-%d", time.gmtime()),
                            said("git", "rev-parse", "--short=10", "HEAD") + ("+" if changed else ""), version,
                            instruction_set, processor)))


# ----------------------------------------------------------------------------------------------------------------- table

def read_table(path):
    """The lines of the table, the oldest first. Errors: Refused."""
    if not path.exists():
        return []
    lines = path.read_text(encoding="utf-8").splitlines()
    columns = lines[0].split("\t") if lines else []
    if tuple(columns[:len(ABOUT)]) != ABOUT or len(set(columns)) != len(columns):
        raise Refused(f"{path}:1: is not the head of a history: {' '.join(ABOUT)} and numbers, with tabs between them")
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        cells = line.split("\t")
        if len(cells) != len(columns):
            raise Refused(f"{path}:{number}: has {len(cells)} cells, the head has {len(columns)}")
        row = dict(zip(columns, cells))
        for name in columns[len(ABOUT):]:
            if row[name] and not re.fullmatch(r"\d+(\.\d+)?", row[name], re.ASCII):
                raise Refused(f"{path}:{number}: {name}: '{row[name]}' is no number")
        rows.append(row)
    return rows


def write_table(path, rows):
    """Columns that are new come last; a line that has no number there has a blank cell."""
    columns = list(ABOUT) + list(dict.fromkeys(name for row in rows for name in row if name not in ABOUT))
    lines = ["\t".join(columns)] + ["\t".join(row.get(name, "") for name in columns) for row in rows]
    part = path.with_name(path.name + ".part")
    part.write_text("\n".join(lines) + "\n", encoding="utf-8")
    part.replace(path)


def alike(row, other):
    return all(row[name] == other[name] for name in ("instruction_set", "processor"))


def slower(earlier, row, factor=FACTOR):
    """What the line took more than `factor` times the median of the latest that are alike, or, of counts, more than
    COUNTED_FACTOR times, in words; and how many lines there were to hold it against."""
    usual = [other for other in earlier if alike(other, row)][-EARLIER:]
    found = []
    for name in (name for name in row if name not in ABOUT and row[name]):
        numbers = [float(other[name]) for other in usual if other.get(name)]
        if len(numbers) < LEAST:
            continue
        most = COUNTED_FACTOR if name.endswith(COUNTED) else factor
        median = statistics.median(numbers)
        if float(row[name]) > most * median:
            found.append(f"{name}: {row[name]} is {float(row[name]) / median:.2f} times the median {median:.3f} of "
                         f"{len(numbers)} lines" if median > 0 else f"{name}: {row[name]}, and 0 before")
    return found, len(usual)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--table", type=Path, default=ROOT / "docs" / "tables" / "history.tsv")
    parser.add_argument("--factor", type=float, default=FACTOR, help="more is slower")
    parser.add_argument("--look", action="store_true", help="compare, and write no line")
    parser.add_argument("--instructions", action="store_true", help="count instructions, too: minutes where valgrind has to")
    given = parser.parse_args()
    if not given.factor > 1:
        parser.error("--factor has to be above 1")
    try:
        earlier = read_table(given.table)
    except Refused as refusal:
        print(f"history: {refusal}", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(prefix="tunica-history-") as folder:
        row = {**about(), **measure(Path(folder), given.instructions)}
    print("\t".join(row))
    print("\t".join(row.values()))
    if not given.look:
        write_table(given.table, [*earlier, row])
    found, count = slower(earlier, row, given.factor)
    for words in found:
        print(f"history: slower: {words}")
    if count < LEAST:
        print(f"history: {count} earlier lines of this processor and instruction set: no usual time before there are {LEAST}")
    elif not found:
        print(f"history: nothing is slower than {given.factor} times the median of {count} lines")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
