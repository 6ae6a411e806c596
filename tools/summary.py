#!/usr/bin/env python3
"""Tells how the cases of Makefile.pipeline went, from the reports the tools left.

Writes OUT/summary.tsv, a line per case, prints it as a table, and lets tunica-chart draw time against error of the
cases whose shells are there. Exit code 1 when a case did not reach its result.
"""

import argparse
import json
import pathlib
import subprocess
import sys

STAGES = {"extract": "surface.ply", "decimate": "coarse.ply", "relax": "shell.ply", "simulate": "result.hdf"}
COLUMNS = ("case", "stage", "exit", "message", "shells", "error_percent", "seconds")


def read_report(path):
    try:
        report = json.loads(path.read_text())
        return report if isinstance(report, dict) else {}
    except (OSError, ValueError):
        return {}


def last_line(path):
    try:
        return ([line for line in path.read_text(errors="replace").splitlines() if line.strip()] or [""])[-1]
    except OSError:
        return ""


def describe(folder, case):
    """The case's row: the last stage that ran, its exit code and message, and what the reports say."""
    row = dict.fromkeys(COLUMNS, "")
    row.update(case=case, stage="none", message="not run")
    seconds = 0.0
    for stage, product in STAGES.items():
        exit_file = folder / f".{stage}.exit"
        report = read_report(folder / f"{stage}.json")
        if exit_file.exists():
            message = report.get("error") or last_line(folder / f"{stage}.log") or "no message"
            row.update(stage=stage, exit=exit_file.read_text().strip(), message=message)
        elif (folder / product).exists():
            row.update(stage=stage, exit="0", message="")
        else:
            break
        seconds += (report.get("seconds") or {}).get("total") or 0.0
        result = report.get("result") or {}
        if stage == "relax":
            row["shells"] = result.get("shells", "")
            upper = (result.get("hausdorff_percent") or {}).get("upper")
            row["error_percent"] = "" if upper is None else f"{upper:.4g}"
        if exit_file.exists():
            break
    else:
        row["message"] = "done"
    if row["exit"] == "0" and row["message"] == "":
        row["message"] = "stopped before the next stage"
    row["seconds"] = f"{seconds:.2f}"
    return {key: " ".join(str(value).split()) for key, value in row.items()}


def print_table(rows):
    widths = [max(len(row[column]) for row in rows) for column in COLUMNS[:3]]
    for row in rows:
        cells = [row[column].ljust(width) for column, width in zip(COLUMNS, widths)]
        numbers = [row[column].rjust(len(column)) for column in COLUMNS[4:]]
        print("  ".join(cells + numbers + [row["message"]]))


def draw_chart(tool, folder, names):
    """@return the chart's path, or None."""
    reports = [folder / name / "relax.json" for name in names]
    reports = [report for report in reports if read_report(report).get("ok")]
    chart = folder / "chart.svg"
    if not reports:
        return None
    done = subprocess.run([tool, *reports, "-o", chart, "--label", "file", "--force", "--quiet"], check=False)
    return chart if done.returncode == 0 else None


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--chart", metavar="TUNICA-CHART", required=True, help="the tool that draws")
    arguments.add_argument("out", metavar="OUT", type=pathlib.Path, help="folder of the results")
    arguments.add_argument("cases", metavar="STEM/LABEL", nargs="+", help="folders of the cases, inside OUT")
    options = arguments.parse_args()

    options.out.mkdir(parents=True, exist_ok=True)
    rows = [describe(options.out / case, case) for case in options.cases]
    summary = options.out / "summary.tsv"
    lines = ["\t".join(COLUMNS)] + ["\t".join(row[column] for column in COLUMNS) for row in rows]
    summary.write_text("\n".join(lines) + "\n")

    print_table([dict(zip(COLUMNS, COLUMNS))] + rows)
    for row in rows:
        if row["message"] == "done":
            folder = options.out / row["case"]
            print(f"result: {folder / 'result.hdf'}   error map: {folder / 'map.png'}")
    chart = draw_chart(options.chart, options.out, options.cases)
    if chart:
        print(f"chart: {chart}")
    print(f"summary: {summary}")
    return 0 if all(row["message"] == "done" for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
