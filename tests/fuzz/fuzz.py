#!/usr/bin/python3
"""Runs the harnesses of tests/fuzz under libFuzzer, one after the other, and says how each went.

Each keeps what it learns in BUILD/fuzz/corpus/PARSER, so that a later run goes on from there, and what it finds in
BUILD/fuzz/findings/PARSER-*: such a file goes into tests/fuzz/found/PARSER under a name that says what it does.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

SOURCE = Path(__file__).resolve().parent
SECONDS_EACH = 10  # for one input
MEGABYTES = 2048
READERS_TESTS = ("volume", "mesh", "scene")
ENDINGS = {"nifti": ("nii", "gz", "hdr"), "nrrd": ("nrrd", "nhdr"), "metaimage": ("mha", "mhd"),
           "slices": ("tif", "tiff", "png"), "label_table": ("txt", "tsv", "csv", "ctbl"), "scene": ("toml",)}


def in_memory():
    """Where the readers' files go: a folder of memory where there is one, for thousands are written each second."""
    shared = Path("/dev/shm")
    return str(shared) if os.access(shared, os.W_OK) else None


def files_of_tests(build):
    """What the readers' tests write for the readers, a folder per ending; made anew where a test is newer."""
    folder = build / "fuzz" / "tests"
    programs = [build / "tests" / "lib" / "io" / test / f"test_io_{test}" for test in READERS_TESTS]
    if not folder.is_dir() or any(program.stat().st_mtime > folder.stat().st_mtime for program in programs):
        shutil.rmtree(folder, ignore_errors=True)
        with tempfile.TemporaryDirectory(dir=folder.parent) as made:
            for program in programs:
                subprocess.run([program, "--gtest_brief=1"], env={**os.environ, "TUNICA_SEEDS": made}, check=True,
                               stdout=subprocess.DEVNULL)
            shutil.copytree(made, folder, dirs_exist_ok=True)  # two may fuzz at once
    return folder


def fuzz(program, parser, build, seconds):
    """@return executions, inputs kept, the files that were found"""
    corpus = build / "fuzz" / "corpus" / parser
    findings = build / "fuzz" / "findings"
    corpus.mkdir(parents=True, exist_ok=True)
    findings.mkdir(parents=True, exist_ok=True)
    before = set(findings.iterdir())
    seeds = [SOURCE / "found" / parser, SOURCE / "seeds" / parser, build / "fuzz" / "seeds" / parser]
    tests = files_of_tests(build)
    seeds += [tests / ending for ending in ENDINGS.get(parser, (parser,))]
    seeds = [folder for folder in seeds if folder.is_dir()]
    command = [program, f"-max_total_time={seconds}", f"-timeout={SECONDS_EACH}", f"-rss_limit_mb={MEGABYTES}",
               f"-artifact_prefix={findings}/{parser}-",
               "-print_final_stats=1", corpus, *seeds]
    with tempfile.TemporaryDirectory(prefix="tunica-fuzz-", dir=in_memory()) as folder:
        with open(build / "fuzz" / f"{parser}.log", "w", encoding="utf-8", errors="replace") as log:
            code = subprocess.run(command, env={**os.environ, "TMPDIR": folder}, stdout=log, stderr=log).returncode
    text = (build / "fuzz" / f"{parser}.log").read_text(encoding="utf-8", errors="replace")
    counts = re.findall(r"^stat::number_of_executed_units:\s*(\d+)", text, re.M) or re.findall(r"^#(\d+)\s", text, re.M)
    found = sorted(set(findings.iterdir()) - before)
    if code != 0 and not found:
        found = [build / "fuzz" / f"{parser}.log"]  # it ended without saying on what
    return int(counts[-1]) if counts else 0, len(list(corpus.iterdir())), found


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("build", type=Path, help="folder of the preset `fuzz`")
    arguments.add_argument("--seconds", type=int, default=60, help="for each parser")
    arguments.add_argument("--parser", help="only this one, or several by commas")
    given = arguments.parse_args()
    build = given.build.resolve()
    programs = {path.name.removeprefix("fuzz_"): path for path in sorted((build / "tests" / "fuzz").glob("fuzz_*"))
                if path.is_file() and os.access(path, os.X_OK) and path.name != "fuzz_seeds"}
    chosen = given.parser.split(",") if given.parser else list(programs)
    unknown = [parser for parser in chosen if parser not in programs]
    if unknown or not chosen:
        sys.exit(f"fuzz: no such parser: {', '.join(unknown)}: there are {', '.join(programs)}")
    seeds = build / "fuzz" / "seeds"
    seeds.mkdir(parents=True, exist_ok=True)
    subprocess.run([build / "tests" / "fuzz" / "fuzz_seeds", SOURCE / "seeds", seeds], check=True)
    failed = False
    for parser in chosen:
        executions, kept, found = fuzz(programs[parser], parser, build, given.seconds)
        end = f"FOUND {' '.join(map(str, found))}" if found else "no finding"
        print(f"{parser:<12} {executions:>10} executions in {given.seconds} s, {kept} inputs kept: {end}", flush=True)
        failed |= bool(found)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
