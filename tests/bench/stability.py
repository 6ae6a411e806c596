#!/usr/bin/python3
"""The atlas of stability: for each method, where it is right, announced as doubtful, refused, or wrong.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/bench/stability.py [--only WORD,WORD] [--out FOLDER]
    ... stability.py --redraw
    ... stability.py --cell shrunken-sphere-default/2-3 --seed 1 --keep FOLDER

The first writes for each map NAME.svg and NAME.csv (a line per cell); the second draws the SVG again from the CSV; the
third runs one cell and keeps its mesh, scene, report and result.
"""
import argparse
import concurrent.futures
import csv
import math
import os
import sys
import tempfile
from pathlib import Path

from atlas import draw, dynamics, statics, surfaces
from atlas.judge import ORDER, Runner, Verdict, badness, judged

MAPS = statics.MAPS + dynamics.MAPS + surfaces.MAPS
SEEDS = (1, 2, 3)
COLUMNS = ("column", "row", "x", "y", "class", "classes_of_seeds", "error_percent", "seed", "exit_code", "message")
PAGES = Path(__file__).resolve().parents[2] / "docs" / "stability"


def charts():
    """Every map of every method: {name: (map, method)}."""
    return {f"{chart.name}-{method.name}": (chart, method) for chart in MAPS for method in chart.methods}


def run_cell(chart, method, place, seed, folder):
    """@return the verdict and the runner, which knows what was run"""
    runner = Runner(folder)
    x, y = chart.x.values[place[0]], chart.y.values[place[1]]
    verdict = judged(lambda tools: chart.measure(tools, method, x, y, seed), runner)
    verdict.message = verdict.message.replace(str(folder) + "/", "")
    return verdict, runner


def worst_of(chart, method, place, seeds=SEEDS):
    """@return the row of the CSV, the worst verdict"""
    found = []
    for seed in seeds:
        with tempfile.TemporaryDirectory(prefix="tunica-atlas-") as folder:
            verdict, _ = run_cell(chart, method, place, seed, folder)
            found.append((badness(verdict), seed, verdict))
    _, seed, verdict = max(found, key=lambda one: one[0])
    letters = "".join(one[2].letter for one in found)
    return (*place, chart.x.name(place[0]), chart.y.name(place[1]), verdict.letter, letters,
            "" if math.isnan(verdict.error) else f"{100 * verdict.error:.4g}", seed, verdict.code,
            verdict.message), verdict


def write_map(name, chart, method, out, jobs):
    places = chart.cells()
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        found = dict(zip(places, pool.map(lambda place: worst_of(chart, method, place), places)))
    with open(out / f"{name}.csv", "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(row for row, _ in found.values())
    verdicts = {place: verdict for place, (_, verdict) in found.items()}
    (out / f"{name}.svg").write_text(draw.svg(chart, method, verdicts, name), encoding="utf-8")
    return verdicts


def count(verdicts):
    letters = [verdict.letter for verdict in verdicts.values()]
    return "  ".join(f"{letter} {letters.count(letter)}" for letter in ORDER)


def stored(name, folder=PAGES):
    """The verdicts of a stored map: {(column, row): (Verdict, seed)}."""
    with open(folder / f"{name}.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {(int(row["column"]), int(row["row"])):
            (Verdict(row["class"], float(row["error_percent"] or "nan") / 100, int(row["exit_code"]), row["message"]),
             int(row["seed"])) for row in rows}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="maps whose names begin with one of these, by commas")
    parser.add_argument("--out", type=Path, default=PAGES)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--redraw", action="store_true", help="draw what is stored in --out")
    parser.add_argument("--cell", help="NAME/COLUMN-ROW")
    parser.add_argument("--seed", type=int, help="of --cell; the stored map's worst unless said")
    parser.add_argument("--keep", type=Path, default=Path("out/stability"), help="where --cell leaves its files")
    given = parser.parse_args()
    all_charts = charts()
    if given.cell:
        name, place = given.cell.split("/")
        place = tuple(map(int, place.split("-")))
        seed = given.seed or stored(name)[place][1]
        given.keep.mkdir(parents=True, exist_ok=True)
        verdict, _ = run_cell(*all_charts[name], place, seed, given.keep)
        print(f"{draw.WORDS[verdict.letter]}; error {100 * verdict.error:.4g} %; exit code {verdict.code}; "
              f"{verdict.message}")
        print(f"files: {given.keep}")
        return 0
    given.out.mkdir(parents=True, exist_ok=True)
    wanted = tuple(given.only.split(","))
    wrong = 0
    for name, (chart, method) in all_charts.items():
        if name.startswith(wanted) and given.redraw:
            verdicts = {place: verdict for place, (verdict, _) in stored(name, given.out).items()}
            (given.out / f"{name}.svg").write_text(draw.svg(chart, method, verdicts, name), encoding="utf-8")
        elif name.startswith(wanted):
            verdicts = write_map(name, chart, method, given.out, given.jobs)
            wrong += method.name == "default" and any(verdict.letter == "W" for verdict in verdicts.values())
            print(f"{name:32} {count(verdicts)}", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
