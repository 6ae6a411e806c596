"""Tells how the cases of a run of Makefile.pipeline went: OUT/summary.tsv, the same as a table, and a chart."""

import json
import os
import re
import subprocess
import sys

STAGES = ("extract", "decimate", "relax", "simulate")
COLUMNS = ("case", "stage", "exit", "message", "shells", "error_percent", "seconds")


def read_report(path):
    """A tool's report; empty when there is none."""
    try:
        with open(path, "rb") as file:
            report = json.loads(file.read())
        return report if isinstance(report, dict) else {}
    except (OSError, ValueError, RecursionError):
        return {}


def value_of(report, *keys):
    """report[key][key]..., None when there is no such thing."""
    for key in keys:
        report = report.get(key) if isinstance(report, dict) else None
    return report


def last_line(path):
    try:
        with open(path, "rb") as file:
            lines = [line for line in os.fsdecode(file.read()).splitlines() if line.strip()]
        return lines[-1] if lines else ""
    except OSError:
        return ""


def exit_of(case, stage):
    """What the stage ended with in this run: a code, "" when it did not end, None when it was not run."""
    try:
        with open(os.path.join(case.plan, f"{stage}.exit"), encoding="utf-8") as file:
            return file.read().strip()
    except OSError:
        return None


def how_it_ended(case):
    """@return the last stage, its exit code, and the message."""
    if case.refused:
        return "none", "2", case.refused
    if os.path.exists(os.path.join(case.plan, "done")):
        return STAGES[-1], "0", "done"
    last = ("none", "", "not run")
    for stage in STAGES:
        code = exit_of(case, stage)
        if code == "0":
            last = (stage, code, "stopped before the next stage")
        elif code == "":
            return stage, code, "stopped while it ran"
        elif code is not None:
            message = value_of(read_report(os.path.join(case.folder, f"{stage}.json")), "error")
            return stage, code, message or last_line(os.path.join(case.folder, f"{stage}.log")) or "no message"
    return last


def describe(case):
    """The case's row: the last stage of this run, its exit code and message, and what the reports up to it say."""
    stage, code, message = how_it_ended(case)
    row = dict.fromkeys(COLUMNS, "")
    row.update(case=case.name, stage=stage, exit=code, message=message)
    seconds = 0.0
    for reached in STAGES[:STAGES.index(stage) + 1] if stage in STAGES else ():
        report = read_report(os.path.join(case.folder, f"{reached}.json"))
        total = value_of(report, "seconds", "total")
        seconds += total if isinstance(total, (int, float)) else 0
        if reached in ("relax", "simulate"):  # an accuracy may have taken finer ones
            shells = value_of(report, "result", "shells")
            row["shells"] = row["shells"] if shells is None else shells
        if reached == "relax":
            upper = value_of(report, "result", "hausdorff_percent", "upper")
            row["error_percent"] = f"{upper:.4g}" if isinstance(upper, (int, float)) else ""
    row["seconds"] = f"{seconds:.2f}"
    return {key: re.sub(r"[\x00-\x20\x7f]+", " ", str(value)).strip() for key, value in row.items()}


def write_summary(path, rows):
    lines = ["\t".join(COLUMNS)] + ["\t".join(row[column] for column in COLUMNS) for row in rows]
    with open(path + ".part", "wb") as file:
        file.write(os.fsencode("\n".join(lines) + "\n"))
    os.replace(path + ".part", path)


def print_table(rows):
    widths = [max(len(row[column]) for row in rows) for column in COLUMNS[:3]]
    for row in rows:
        cells = [row[column].ljust(width) for column, width in zip(COLUMNS, widths)]
        numbers = [row[column].rjust(len(column)) for column in COLUMNS[4:]]
        print("  ".join(cells + numbers + [row["message"]]))


def draw_chart(tool, path, cases):
    """Draws time against error of the cases whose shells are there. @return whether there is a chart"""
    reports = [os.path.join(case.folder, "relax.json") for case in cases]
    reports = [report for report in reports if read_report(report).get("ok")]
    try:
        if not reports:
            os.remove(path)
            return False
        return subprocess.run([tool, *reports, "-o", path, "--label", "file", "--force", "--quiet"],
                              check=False).returncode == 0
    except OSError:
        return False


def tell(out, cases, chart_tool):
    """Writes and prints the summary. @return 1 when a case did not reach its result or the summary is lost, else 0"""
    rows = [describe(case) for case in cases]
    path, chart = os.path.join(out, "summary.tsv"), os.path.join(out, "chart.svg")
    lost = None
    try:
        write_summary(path, rows)
    except OSError as error:
        lost = error.strerror
    drawn = draw_chart(chart_tool, chart, [case for case, row in zip(cases, rows) if row["shells"]])
    try:
        print_table([dict(zip(COLUMNS, COLUMNS))] + rows)
        for case, row in zip(cases, rows):
            if row["message"] == "done":
                print(f"result: {os.path.join(case.folder, 'result.hdf')}   "
                      f"error map: {os.path.join(case.folder, 'map.png')}")
        if drawn:
            print(f"chart: {chart}")
        print(f"summary: {path}" if lost is None else f"summary: {path} cannot be written: {lost}", flush=True)
    except OSError:
        # Nobody reads: the file says it all, and the interpreter shall not try again.
        sys.stdout = None
    return 0 if lost is None and all(row["message"] == "done" for row in rows) else 1
