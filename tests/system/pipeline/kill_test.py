#!/usr/bin/env python3
"""Makefile.pipeline killed with SIGKILL at random moments, and an input that vanishes between two stages: whatever stands
under a final name is whole, and `make` again ends with the results of an undisturbed run.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/system/pipeline/kill_test.py [--kills 200] [--seed 1]
"""

import argparse
import collections
import csv
import io
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import unittest

from pipeline_test import LOAD, STAGES, Pipeline
from running import built

KILLS = 5
SEED = 1
TIMES = ("seconds", "peak_mib", "ms_per_step", "real_time_factor")


def without_times(value):
    """A report but for what it says of time and memory."""
    if isinstance(value, dict):
        return {key: without_times(part) for key, part in value.items() if key not in TIMES}
    return [without_times(part) for part in value] if isinstance(value, list) else value


def content(path):
    """What has to be the same from run to run; of a page and a chart, which show times, only that they are whole.
    Errors: ValueError or AssertionError when the file is not whole."""
    data = path.read_bytes()
    if path.suffix == ".json":
        return json.dumps(without_times(json.loads(data)), sort_keys=True)
    if path.suffix == ".tsv":
        rows = csv.DictReader(io.StringIO(data.decode()), delimiter="\t", quoting=csv.QUOTE_NONE)
        return json.dumps(sorted(json.dumps(without_times(row)) for row in rows))
    if path.suffix in (".html", ".svg"):
        end = b"</html>" if path.suffix == ".html" else b"</svg>"
        assert data.rstrip().endswith(end), f"{path}: is cut short"
        return path.suffix
    return data


def finals(out):
    """The files of a run under their final names, by their names in OUT. What begins with a point belongs to the pipeline
    alone, and a log grows while its stage runs."""
    files = [path for path in out.rglob("*") if path.is_file() and path.suffix not in (".part", ".log")]
    names = {path.relative_to(out): path for path in files}
    return {name: path for name, path in names.items() if not any(part.startswith(".") for part in name.parts)
            and ".part." not in name.name}


def size_of(path):
    """None of a file that is gone."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0


def there(folder, pattern):
    """The files of a folder in which others come and go."""
    try:
        return list(folder.glob(pattern))
    except FileNotFoundError:
        return []


def everything(out):
    return {str(path.relative_to(out)) for path in out.rglob("*")}


@unittest.skipUnless(built(*STAGES, "phantom", "report"), "the tools are not built")
class Kills(Pipeline):
    """Two settings take turns, so that files of an earlier run stand in the way."""

    SETTINGS = ({"SHELLS": 60, "RELAX": "--max-iterations 1"}, {"SHELLS": 90, "SMOOTH": "none", "RELAX": "--max-iterations 2"})

    def setUp(self):
        super().setUp()
        self.run_tool("phantom", "sphere", "sphere.nii.gz", "--size", 16, "--spacing", 3)
        self.whole, self.names = [], []  # per setting its files' contents, and all that is in OUT
        self.usual = 0.0                 # seconds that a run takes

    def learn(self, settings=SETTINGS):
        """What undisturbed runs leave."""
        for setting in settings:
            begin = time.monotonic()
            self.finish(setting)
            self.usual = time.monotonic() - begin
            self.whole.append({name: content(path) for name, path in finals(self.out).items()})
            self.names.append(everything(self.out))
            shutil.rmtree(self.out)

    def arguments(self, setting):
        return dict(VOLUMES="*.nii.gz", LABELS=1, THREADS=1, **LOAD, **setting)

    def finish(self, setting):
        done = self.make("-j2", "-k", **self.arguments(setting))
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def processes(self, run):
        """Of the session that the run began, as long as they live."""
        listed = subprocess.run(["ps", "-o", "pid=,stat=", "-s", str(run.pid)], capture_output=True, text=True, check=False)
        words = [line.split() for line in listed.stdout.splitlines()]
        return [int(process) for process, state in words if not state.startswith("Z")]

    def kill(self, run):
        """@return whether the run was still at work"""
        at_work = run.poll() is None
        while processes := self.processes(run):
            for process in processes:
                try:
                    os.kill(process, signal.SIGKILL)
                except ProcessLookupError:
                    pass
        run.communicate()
        return at_work

    def wait(self, moments, run):
        """To any moment of a run, of one of its stages, or to one at which something is being written."""
        begin = time.monotonic()
        aim, stage = moments.choice(("run", "stage", "stage", "writing")), moments.choice(STAGES)
        end = begin + moments.uniform(0, self.usual)
        while run.poll() is None:
            if aim == "run" and time.monotonic() > end:
                break
            if aim != "run" and stage in self.stages_at_work() and (aim == "stage" or self.is_writing()):
                time.sleep(moments.uniform(0, self.usual / 8) if aim == "stage" else moments.uniform(0, 0.003))
                break
            time.sleep(0.001)
        if run.poll() is not None:
            self.usual = time.monotonic() - begin  # the machine is less busy than it was

    def is_writing(self):
        return any(size_of(path) > 0 for path in there(self.out, "**/*.part"))

    def stages_at_work(self):
        return sorted({path.stem for path in there(self.out, ".run/*/*/*.exit") if path.exists() and size_of(path) == 0})

    def check_finals(self, moment):
        for name, path in finals(self.out).items():
            try:
                found = content(path)
            except (ValueError, KeyError, AssertionError) as error:
                self.fail(f"{moment}: {name} is not whole: {error}")
            known = [whole[name] for whole in self.whole if name in whole]
            # A summary may be of the run before, and a failure's report tells of that.
            if name.suffix != ".tsv" and '"ok": false' not in str(found):
                self.assertTrue(found in known, f"{moment}: {name} is not that of an undisturbed run:\n{found[:5000]}")

    def check_results(self, which, moment):
        self.finish(self.SETTINGS[which])
        found = {name: content(path) for name, path in finals(self.out).items()}
        self.assertEqual(set(found), set(self.whole[which]), moment)
        for name, data in found.items():
            self.assertTrue(data == self.whole[which][name], f"{moment}: {name}:\n{data[:5000]}")
        self.assertEqual(everything(self.out), self.names[which], moment)
        with self.subTest(moment):
            self.run_tool("report", self.out, "-o", "verified.html", "--verify", "--force", "--quiet")

    def test_results_are_those_of_an_undisturbed_run(self):
        self.learn()
        moments = random.Random(SEED)
        hit = collections.Counter()
        kills = too_late = completed = 0
        while kills < KILLS:
            which = moments.randrange(len(self.SETTINGS))
            run = self.start("-j2", "-k", **self.arguments(self.SETTINGS[which]))
            self.wait(moments, run)
            if not self.kill(run):
                too_late += 1
            else:
                kills += 1
                if kills % 20 == 0:
                    print(f"{kills} kills", file=sys.stderr)
                hit.update(self.stages_at_work() or ["between stages"])
            moment = f"seed {SEED}, kill {kills}, stages at work {self.stages_at_work()}"
            if self.out.exists():
                self.check_finals(moment)
            if moments.random() < 0.4:
                self.check_results(which, moment)
                completed += 1
                if moments.random() < 0.5:
                    shutil.rmtree(self.out)
        self.check_results(0, "at the end")
        print(f"{kills} kills: " + ", ".join(f"{count} in {stage}" for stage, count in sorted(hit.items())) +
              f"; {too_late} came after the end; {completed + 1} runs went to their end and were compared", file=sys.stderr)

    def test_an_input_that_vanishes_between_stages(self):
        thief = self.folder / "thief"
        thief.write_text('#!/bin/sh\ncase $1 in *tunica-$THIEF_BEFORE) rm -f "$THIEF_TAKES" ;; esac\nexec "$@"\n')
        thief.chmod(0o755)
        case = self.out / "sphere" / "1"
        self.learn(self.SETTINGS[:1])
        for stage, taken in (("relax", "surface.ply"), ("simulate", "shell.ply")):
            done = self.make("-k", RUN=thief, environment={"THIEF_BEFORE": stage, "THIEF_TAKES": str(case / taken)},
                             **self.arguments(self.SETTINGS[0]))
            self.assertNotEqual(done.returncode, 0)
            row = self.summary()["sphere/1"]
            self.assertEqual((row["stage"], row["exit"]), (stage, "3"), row)
            self.assertEqual(row["message"], f"{case / taken}: no such file")
            self.check_finals(f"without {taken}")
            self.check_results(0, f"after {taken} was gone")
            shutil.rmtree(self.out)


def main():
    global KILLS, SEED
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--kills", type=int, default=KILLS)
    arguments.add_argument("--seed", type=int, default=SEED)
    given = arguments.parse_args()
    KILLS, SEED = given.kills, given.seed
    unittest.main(argv=sys.argv[:1] + ["-v"])


if __name__ == "__main__":
    main()
