#!/usr/bin/env python3
"""Makefile.pipeline: its rules with tools that do nothing but write their files, and the whole chain with the real ones."""

import csv
import fcntl
import hashlib
import json
import os
import pathlib
import random
import re
import shutil
import signal
import stat
import subprocess
import sys
import time
import unittest

from running import BIN, SOURCE, ToolTest, built, program, run_tool

LOAD = {"IMAGED_AT": "0kPa", "PRESSURE": "1kPa", "YOUNG": "1MPa", "POISSON": "0.45", "THICKNESS": "1.5mm"}
STAGES = ["extract", "decimate", "relax", "simulate"]


class Pipeline(ToolTest):
    """A folder with the results of `make`."""

    def setUp(self):
        super().setUp()
        self.out = self.folder / "out"
        self.bin = BIN

    def start(self, *flags, environment=None, **variables):
        words = [f"{name}={value}" for name, value in {"BIN": self.bin, "OUT": self.out, **variables}.items()]
        settings = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
        # The Python that runs this, without what stands before it where versions are chosen.
        settings["PATH"] = f"{os.path.dirname(sys.executable)}:{settings['PATH']}"
        settings.update(environment or {})
        return subprocess.Popen(["make", "-f", SOURCE / "Makefile.pipeline", *flags, *words], cwd=self.folder,
                                env=settings, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                errors="surrogateescape", start_new_session=True)

    def make(self, *flags, **rest):
        run = self.start(*flags, **rest)
        stdout, stderr = run.communicate(timeout=500)
        return subprocess.CompletedProcess(run.args, run.returncode, stdout, stderr)

    def summary(self):
        with open(self.out / "summary.tsv", newline="") as file:
            return {row["case"]: row for row in csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE)}


@unittest.skipUnless(built("report"), "tunica-report is not built")
class WithStubs(Pipeline):
    """Tools that do nothing, and two volumes."""

    def setUp(self):
        super().setUp()
        self.bin = self.folder / "bin"
        self.bin.mkdir()
        (self.bin / "tunica-report").symlink_to(program("report"))
        for verb in STAGES:
            shutil.copy(SOURCE / "tests" / "system" / "pipeline" / "stub_tool", self.bin / f"tunica-{verb}")
        for name in ("a.nii.gz", "b.seg.nrrd"):
            (self.folder / name).write_text("a volume")

    def calls(self):
        """The tools' command lines since the last call."""
        log = self.bin / "calls"
        lines = log.read_text().splitlines() if log.exists() else []
        log.unlink(missing_ok=True)
        return lines

    def verbs(self):
        return sorted(line.split()[0] for line in self.calls())

    def refusal(self, *flags, **variables):
        done = self.make(*flags, **variables)
        self.assertNotEqual(done.returncode, 0)
        self.assertFalse(self.out.exists(), "refused before any work")
        self.assertNotIn("Traceback", done.stderr)
        return done.stderr


class Rules(WithStubs):
    """What is run when."""

    def test_case_leaves_the_files_of_the_contract(self):
        done = self.make(VOLUMES="a.nii.gz", LABEL=3, **LOAD)
        self.assertEqual(done.returncode, 0, done.stderr)
        present = {path.name for path in (self.out / "a" / "3").iterdir() if not path.name.startswith(".")}
        self.assertLessEqual({"surface.ply", "coarse.ply", "shell.ply", "map.png", "result.hdf", "result.page", "picture.png", "extract.json",
                              "decimate.json", "relax.json", "simulate.json"}, present)
        row = self.summary()["a/3"]
        self.assertEqual((row["stage"], row["exit"], row["message"]), ("simulate", "0", "done"))
        self.assertEqual((row["shells"], row["distance_percent"], row["seconds"]), ("42", "0.625", "1.00"))
        for name in ("result.hdf", "map.png"):
            self.assertIn(str(self.out / "a" / "3" / name), done.stdout)
        self.assertIn(str(self.out / "chart.svg"), done.stdout)
        self.assertIn("<svg", (self.out / "chart.svg").read_text())
        self.assertIn("a/3", (self.out / "cohort.tsv").read_text())
        self.assertIn("stress_p99_kpa", json.loads((self.out / "cohort.json").read_text()))
        self.assertIn(f"report: {self.out / 'report.html'}", done.stdout)
        self.assertIn("surface.ply: ", (self.out / "report.html").read_text(), "the stub's files are no meshes: told")

    def test_variables_reach_the_tools(self):
        self.make(VOLUMES="a.nii.gz", LABEL=3, SMOOTH="none", LARGEST=0, FILL=0, OPEN=1, SHELLS=123, TOLERANCE="0.5%",
                  METHOD="barycentre", THREADS=3, FIX="below z=-10mm", EXTRACT="--frame 2", **LOAD)
        extract, decimate, relax, simulate = self.calls()
        self.assertIn("--label 3 --smooth none --open-border --frame 2 --threads 3", extract)
        self.assertIn("--triangles 123 --min-angle 20 --soft-angle --threads", decimate)
        self.assertIn("--tolerance 0.5% --refine --method barycentre", relax)
        self.assertIn("--fix below z=-10mm --imaged-at 0kPa --pressure 1kPa --young 1MPa --poisson 0.45 --thickness 1.5mm --static",
                      simulate)

    def test_a_misspelt_variable_is_refused(self):
        for name, near in (("PRESURE", "PRESSURE"), ("pressure", "PRESSURE"), ("ACURACY", "ACCURACY"), ("Thread", "THREADS"),
                           ("SHELL", "SHELLS")):
            said = self.refusal(VOLUMES="a.nii.gz", LABEL=1, **{name: "1kPa"}, **LOAD)
            self.assertIn(f"no such variable: {name}: did you mean {near}?", said)
        self.assertIn("no such variable: XQJ'Z: make", self.refusal(VOLUMES="a.nii.gz", LABEL=1, **{"XQJ'Z": 1}, **LOAD))

    def test_nothing_is_taken_from_the_shells_variables(self):
        shell = {"OPEN": "1", "SMOOTH": "none", "FIX": "rigid-motions", "TOLERANCE": "3%", "OUT": "elsewhere", "RUN": "false",
                 "LABEL": "9", "THREADS": "7", "KIND": "dynamic", "EXTRACT": "--frame 3", "BIN": "nowhere", "SECONDS": "5"}
        for flags in ((), ("-e",)):
            done = self.make(*flags, VOLUMES="a.nii.gz", LABELS=1, environment=shell, **LOAD)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(done.stderr.count("pipeline: exported shell variables are not used: "), 1)
            for name in shell.keys() - {"OUT", "BIN"}:
                self.assertRegex(done.stderr, rf"not used: .*\b{name}\b.*: a setting stands")
            if not flags:
                extract, _, relax, simulate = self.calls()
        self.assertEqual(self.calls(), [])
        self.assertIn("--label 1 --smooth staircase --largest --fill-cavities --threads", extract)
        self.assertNotIn("--tolerance", relax)
        self.assertIn("--static", simulate)
        self.assertNotIn("--threads 7", simulate)
        self.assertFalse((self.folder / "elsewhere").exists())

    def test_an_accuracy_chooses_the_shells(self):
        self.make(VOLUMES="a.nii.gz", LABEL=3, ACCURACY="2%", OF="energy", **LOAD)
        _, decimate, relax, simulate = self.calls()
        self.assertIn("--triangles 190 --min-angle 20 --soft-angle", decimate)
        self.assertIn("--shells 190 --max-iterations 4", relax)
        self.assertIn("--accuracy 2% --of energy", simulate)
        folder = self.out / "a" / "3"
        self.assertIn(f"--target {folder / 'surface.ply'} --shell-out {folder / 'refined.ply'}", simulate)
        self.make(VOLUMES="a.nii.gz", LABEL=3, ACCURACY="2%", OF="energy", **LOAD)
        self.assertEqual(self.calls(), [], "all is up to date")
        (folder / "refined.ply").unlink()
        self.make(VOLUMES="a.nii.gz", LABEL=3, ACCURACY="2%", OF="energy", **LOAD)
        self.assertEqual(self.verbs(), ["simulate"])
        self.make(VOLUMES="a.nii.gz", LABEL=3, SHELLS=800, **LOAD)
        self.assertFalse((folder / "refined.ply").exists(), "those of the last load")
        done = self.make(VOLUMES="a.nii.gz", LABEL=3, ACCURACY="2%", SHELLS=300, **LOAD)
        self.assertEqual(done.returncode, 2)
        self.assertIn("ACCURACY and SHELLS exclude each other: leave one out", done.stderr)
        done = self.make(VOLUMES="a.nii.gz", LABEL=3, ACCURACY="2%", MID_SURFACE="inner", **LOAD)
        self.assertEqual(done.returncode, 2)
        self.assertIn("give SHELLS or TOLERANCE instead", done.stderr)

    def test_what_was_imaged_under_pressure_needs_no_stiffness(self):
        wall = {"POISSON": "0.45", "THICKNESS": "1.5mm"}
        for given, missing in (({}, "IMAGED_AT not given"), ({"IMAGED_AT": "80mmHg", "PRESSURE": "90mmHg"}, "YOUNG not given"),
                               ({"IMAGED_AT": "0mmHg"}, "nothing loads the wall"),
                               ({"IMAGED_AT": "0 kPa"}, "nothing loads the wall")):
            self.assertIn(missing, self.refusal(VOLUMES="a.nii.gz", LABEL=3, **wall, **given))
        self.make(VOLUMES="a.nii.gz", LABEL=3, IMAGED_AT="80mmHg", **wall)
        *_, simulate = self.calls()
        self.assertIn("--imaged-at 80mmHg", simulate)
        for flag in ("--pressure", "--young"):
            self.assertNotIn(flag, simulate)

    def test_without_choices_an_accuracy_is_asked_for(self):
        self.make(VOLUMES="a.nii.gz", ISOVALUE=-0.5, **LOAD)
        extract, decimate, relax, simulate = self.calls()
        self.assertIn("--isovalue=-0.5 --smooth staircase --largest --fill-cavities", extract)
        self.assertNotIn("--open-border", extract)
        self.assertIn("--triangles 190 --min-angle 20 --soft-angle ", decimate)
        self.assertNotIn("--tolerance", relax)
        self.assertIn("--accuracy 5% --of membrane --max-seconds 60s", simulate)
        self.assertTrue((self.out / "a" / "iso-0.5" / "refined.ply").exists())
        self.make(VOLUMES="a.nii.gz", ISOVALUE=-0.5, METHOD="barycentre", **LOAD)
        self.assertNotIn("--shells", next(line for line in self.calls() if line.startswith("relax")))  # of the fit alone
        self.make(VOLUMES="a.nii.gz", ISOVALUE=-0.5, SIMULATE="--max-seconds 2min", **LOAD)
        self.assertIn("--accuracy 5% --of membrane --max-seconds 2min", self.calls()[-1])
        for own in ({"SHELLS": "800"}, {"TOLERANCE": "1%"}, {"LOAD_STEPS": "3"}, {"SIMULATE": "--unloaded u.ply"}):
            self.make(VOLUMES="a.nii.gz", ISOVALUE=-0.5, **own, **LOAD)
            self.assertNotIn("--accuracy", " ".join(self.calls()))
        self.assertTrue((self.out / "a" / "iso-0.5" / "result.hdf").exists())

    def test_a_dynamic_run_has_its_own_flags(self):
        done = self.make(VOLUMES="a.nii.gz", LABEL=1, KIND="dynamic", DENSITY="1100kg/m3", DURATION="1s", STEP="10ms",
                         **LOAD)
        self.assertEqual(done.returncode, 0, done.stderr)
        simulate = self.calls()[3]
        self.assertIn("--density 1100kg/m3 --duration 1s --step 10ms", simulate)
        self.assertNotIn("--static", simulate)

    def test_boundary_is_held_where_there_is_one(self):
        self.make(VOLUMES="a.nii.gz", LABEL=1, **LOAD)
        self.assertIn("--fix rigid-motions", self.calls()[3])
        self.make(VOLUMES="b.seg.nrrd", LABEL=1, environment={"STUB_CLOSED": "false"}, **LOAD)
        self.assertIn("--fix boundary", self.calls()[3])

    def test_second_run_does_nothing(self):
        arguments = dict(VOLUMES="*.nii.gz *.nrrd", LABELS="1 2", **LOAD)
        self.assertEqual(self.make("-j2", **arguments).returncode, 0)
        self.assertEqual(len(self.calls()), 16)
        again = self.make("-j2", **arguments)
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertEqual(self.calls(), [])
        self.assertEqual(len(self.summary()), 4)

    def test_redoes_only_what_is_out_of_date(self):
        arguments = dict(VOLUMES="a.nii.gz", LABEL=1, SHELLS="190", **LOAD)
        self.make(**arguments)
        self.calls()
        for changed, redone in (({"PRESSURE": "2kPa"}, STAGES[3:]), ({"FIX": "boundary"}, STAGES[3:]),
                                ({"TOLERANCE": "1%"}, STAGES[2:]), ({"SHELLS": "99"}, STAGES[1:]),
                                ({"SMOOTH": "none"}, STAGES)):
            arguments.update(changed)
            self.assertEqual(self.make(**arguments).returncode, 0)
            self.assertEqual(self.verbs(), sorted(redone), changed)
        (self.out / "a" / "1" / "map.png").unlink()
        self.make(**arguments)
        self.assertEqual(self.verbs(), sorted(STAGES[2:]))
        (self.out / "a" / "1" / "picture.png").unlink()
        self.make(**arguments)
        self.assertEqual(self.verbs(), sorted(STAGES[3:]))

    def test_failed_case_is_named_and_the_others_go_on(self):
        arguments = dict(VOLUMES="a.nii.gz b.seg.nrrd", LABELS="1 2", **LOAD)
        done = self.make("-k", "-j2", environment={"STUB_FAIL": "decimate/b/1"}, **arguments)
        self.assertNotEqual(done.returncode, 0)
        rows = self.summary()
        self.assertEqual(rows["b/1"]["stage"], "decimate")
        self.assertEqual(rows["b/1"]["exit"], "4")
        self.assertEqual(rows["b/1"]["message"], "decimate/b/1: it cannot hold")
        self.assertEqual([rows[name]["message"] for name in ("a/1", "a/2", "b/2")], ["done"] * 3)
        self.assertRegex(done.stdout, r"b/1 +decimate +4 .*it cannot hold")
        present = {path.name for path in (self.out / "b" / "1").iterdir()}
        self.assertIn("surface.ply", present)
        self.assertFalse({"coarse.ply", "shell.ply", "map.png", "result.hdf"} & present)
        self.calls()
        # The next run begins where that case ended.
        self.assertEqual(self.make("-k", **arguments).returncode, 0)
        self.assertEqual(self.verbs(), sorted(STAGES[1:]))
        self.assertEqual(self.summary()["b/1"]["message"], "done")

    def test_failed_stage_leaves_no_file_of_an_earlier_success(self):
        self.make(VOLUMES="a.nii.gz", LABEL=1, **LOAD)
        done = self.make(VOLUMES="a.nii.gz", LABEL=1, SHELLS=7, environment={"STUB_FAIL": "decimate/a/1"}, **LOAD)
        self.assertNotEqual(done.returncode, 0)
        for name in ("coarse.ply", "shell.ply", "map.png", "result.hdf", "result.page", "picture.png"):
            self.assertFalse((self.out / "a" / "1" / name).exists(), name)
        self.assertEqual(self.summary()["a/1"]["stage"], "decimate")

    def test_exports_of_an_earlier_run_go(self):
        self.make(VOLUMES="a.nii.gz", LABEL=1, **LOAD)
        folder = self.out / "a" / "1"
        export, report = folder / "result.glb", folder / "simulate.json"
        export.write_text("of the load before")
        said = json.loads(report.read_text())
        said["outputs"].append({"path": str(export), "sha256": None})
        report.write_text(json.dumps(said, indent=2))
        self.assertEqual(self.make(VOLUMES="a.nii.gz", LABEL=1, **{**LOAD, "THICKNESS": "2mm"}).returncode, 0)
        self.assertFalse(export.exists())
        self.assertTrue((folder / "result.hdf").exists())

    def test_what_simulate_is_told_to_hold_is_all_that_is_held(self):
        self.make(VOLUMES="a.nii.gz", LABEL=1, SIMULATE="--fix 'below z=-8mm'", **LOAD)
        [simulate] = [line for line in self.calls() if line.startswith("simulate")]
        self.assertEqual(simulate.count("--fix"), 1)

    def test_without_k_the_rest_is_not_run_and_the_table_says_so(self):
        done = self.make(VOLUMES="a.nii.gz b.seg.nrrd", LABEL=1, environment={"STUB_FAIL": "extract/a/1"}, **LOAD)
        self.assertNotEqual(done.returncode, 0)
        self.assertEqual(self.summary()["b/1"]["message"], "not run")

    def test_run_stands_before_each_heavy_command(self):
        wrapper = self.folder / "wrapper"
        wrapper.write_text(f"#!/bin/sh\necho \"$@\" >> {self.folder}/wrapped\nshift 2\nexec \"$@\"\n")
        wrapper.chmod(wrapper.stat().st_mode | stat.S_IXUSR)
        done = self.make(VOLUMES="a.nii.gz", LABEL=1, THREADS=2, MEM=500, RUN=f"{wrapper} -c$(THREADS) --mem=$(MEM)M",
                         **LOAD)
        self.assertEqual(done.returncode, 0, done.stderr)
        wrapped = [line.split() for line in (self.folder / "wrapped").read_text().splitlines()]
        self.assertEqual([words[:2] for words in wrapped], [["-c2", "--mem=500M"]] * 4)
        self.assertEqual([pathlib.Path(words[2]).name for words in wrapped], [f"tunica-{stage}" for stage in STAGES])

    def test_mem_is_the_limit_of_each_command(self):
        arguments = dict(VOLUMES="a.nii.gz", LABEL=1, **LOAD)
        self.make(**arguments)
        self.assertFalse([line for line in self.calls() if "--memory-limit" in line])
        self.assertEqual(self.make(MEM=900, **arguments).returncode, 0)
        self.assertEqual(self.calls(), [], "no other result")
        self.make(MEM=900, SMOOTH="none", **arguments)
        self.assertEqual(["--memory-limit 900MiB " in line for line in self.calls()], [True] * 4)
        self.make(MEM=0, SMOOTH="staircase", **arguments)
        self.assertEqual(["--memory-limit" in line for line in self.calls()], [False] * 4)
        shutil.rmtree(self.out)
        for wrong in ("4G", "-1", "$(shell touch pwned)", "1e3"):
            self.assertIn(f"MEM: '{wrong}' is no number of megabytes", self.refusal(MEM=wrong, **arguments))
        self.assertFalse(list(self.folder.rglob("pwned*")))

    def test_every_variable_of_the_help_can_be_given(self):
        text = self.make("help").stdout
        names = {name for line in text.splitlines() if not line.startswith(" ")
                 for name in re.findall(r"\b[A-Z_]{2,}\b", line[:line.index("  ")] if "  " in line else "")}
        self.assertLessEqual({"VOLUMES", "MEM", "STEP", "REPORTS", "PAPER", "FACTOR"}, names)
        taken = names - {"LABELS", "ACCURACY", "VOLUMES"}  # which exclude others
        self.assertEqual(self.make("help", **dict.fromkeys(taken, "1")).stderr, "")

    def test_set_up_is_for_all_goals(self):
        for goals, wanted in ((("package", "package-check"), {"g++", "debhelper", "debootstrap"}), (("package",), {"debhelper"}),
                              (("fuzz",), {"g++", "clang-16"}), (("check",), {"g++", "libgtest-dev"})):
            set_up = re.search("for package in (.*?); do", self.make("-n", *goals).stdout)[1].split()
            self.assertLessEqual(wanted, set(set_up))
            self.assertEqual("debootstrap" in set_up, "package-check" in goals)

    def test_a_killed_command_is_a_failed_case(self):
        killer = self.folder / "killer"
        killer.write_text("#!/bin/sh\nkill -9 $$\n")
        killer.chmod(0o755)
        done = self.make(VOLUMES="a.nii.gz", LABEL=1, RUN=killer, **LOAD)
        self.assertNotEqual(done.returncode, 0)
        self.assertEqual(self.summary()["a/1"]["exit"], "137")

    def test_a_tool_that_run_does_not_start_is_told(self):
        self.assertNotEqual(self.make(VOLUMES="a.nii.gz", LABEL=1, RUN="false", **LOAD).returncode, 0)
        self.assertIn("the tool was killed, or RUN did not start it", self.summary()["a/1"]["message"])

    def test_nothing_physical_is_assumed_for_a_users_volume(self):
        for name in LOAD:
            rest = {key: value for key, value in LOAD.items() if key != name}
            self.assertRegex(self.refusal(VOLUMES="a.nii.gz", LABEL=1, **rest), f"{name} (is )?not given")
        self.assertIn("IMAGED_AT POISSON THICKNESS not given", self.refusal(VOLUMES="a.nii.gz", LABEL=1))
        self.assertIn("LABELS not given", self.refusal(VOLUMES="a.nii.gz", **LOAD))
        self.assertIn("DENSITY DURATION STEP not given", self.refusal(VOLUMES="a.nii.gz", LABEL=1, KIND="dynamic", **LOAD))

    def test_flags_that_a_tool_does_not_take_cost_no_result(self):
        self.make(VOLUMES="a.nii.gz b.seg.nrrd", LABEL=3, **LOAD)
        before = {path: path.stat().st_mtime_ns for path in self.out.glob("*/*/*")}
        self.calls()
        done = self.make(VOLUMES="a.nii.gz b.seg.nrrd", LABEL=3, TOLERANCE="1", **LOAD,
                         environment={"STUB_MISUSED": "relax: --tolerance: '1' has no unit"})
        self.assertNotEqual(done.returncode, 0)
        self.assertEqual(done.stderr.count("pipeline: tunica-relax: --tolerance: '1' has no unit"), 1)
        for row in self.summary().values():
            self.assertEqual((row["stage"], row["exit"]), ("none", "2"))
            self.assertIn("'1' has no unit", row["message"])
        self.assertEqual({path: path.stat().st_mtime_ns for path in self.out.glob("*/*/*")}, before)
        self.make(VOLUMES="a.nii.gz b.seg.nrrd", LABEL=3, **LOAD)
        self.assertEqual(self.calls(), [])

    def test_a_volume_that_is_not_there_any_more_costs_no_result(self):
        self.make(VOLUMES="a.nii.gz b.seg.nrrd", LABEL=3, **LOAD)
        before = sorted(path.name for path in self.out.glob("a/*/*"))
        (self.folder / "a.nii.gz").unlink()
        self.calls()
        done = self.make(VOLUMES="a.nii.gz b.seg.nrrd", LABEL=3, **LOAD)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("a.nii.gz: no such file: the results in", self.summary()["a/3"]["message"])
        self.assertEqual(self.summary()["b/3"]["message"], "done")
        self.assertEqual((sorted(path.name for path in self.out.glob("a/*/*")), self.calls()), (before, []))

    def test_a_number_without_its_unit_is_refused_before_any_work(self):
        for name in ("PRESSURE", "YOUNG", "THICKNESS", "DENSITY", "IMAGED_AT"):
            said = self.refusal(VOLUMES="a.nii.gz", LABEL=1, **{**LOAD, name: "1.5e3"})
            self.assertIn(f"{name}: '1.5e3' has no unit", said)
        self.assertIn("outer or inner", self.refusal(VOLUMES="a.nii.gz", LABEL=1, MID_SURFACE="middle", **LOAD))
        self.assertIn("OPEN: 'nein' is not understood: 1 or 0", self.refusal(VOLUMES="a.nii.gz", LABEL=1, OPEN="nein", **LOAD))

    def test_a_users_own_values_take_the_place_of_the_samples(self):
        for given in ({"LABEL": 2}, {"ISOVALUE": "0.5"}, {"IMAGED_AT": "80mmHg"}, {"OPEN": 0}):
            done = self.make("-n", **given)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("aneurysm.nii.gz", done.stdout)

    def test_contradictions_are_refused(self):
        self.assertIn("KIND: 'quick' is not understood", self.refusal(VOLUMES="a.nii.gz", LABEL=1, KIND="quick", **LOAD))
        self.assertIn("exclude each other", self.refusal(VOLUMES="a.nii.gz", LABEL=1, ISOVALUE=2, **LOAD))
        self.assertIn("nothing matches none*.nii", self.refusal(VOLUMES="none*.nii", LABEL=1, **LOAD))
        (self.folder / "a.nii").write_text("another")
        self.assertIn("same stem", self.refusal(VOLUMES="a.nii.gz a.nii", LABEL=1, **LOAD))
        self.assertIn("LABELS: a quotation mark", self.refusal(VOLUMES="a.nii.gz", LABELS="'aorta", **LOAD))
        self.assertIn("VOLUMES not given", self.refusal(VOLUMES="", LABEL=1, **LOAD))
        self.assertIn("OUT: has no name", self.refusal(VOLUMES="a.nii.gz", LABEL=1, **{**LOAD, "OUT": ""}))
        self.assertIn("folder", self.refusal(VOLUMES="a.nii.gz", LABELS="../1", **LOAD))
        for given, words in (({"DURATION": "1s"}, "DURATION has no effect: it belongs to KIND=dynamic: leave it out"),
                             ({"SHELLS": "800", "OF": "stress"}, "OF has no effect: it belongs to ACCURACY, and SHELLS is given: leave it out"),
                             ({"SIMULATE": "--accuracy 2%", "OF": "stress"}, "OF has no effect: it belongs to ACCURACY, and SIMULATE=--accuracy is given"),
                             ({"KIND": "dynamic", "DENSITY": "1g/cm3", "DURATION": "1s", "STEP": "1ms", "LOAD_STEPS": "3"},
                              "LOAD_STEPS has no effect: it belongs to KIND=static: leave it out")):
            self.assertIn(words, self.refusal(VOLUMES="a.nii.gz", LABEL=1, **given, **LOAD))
        (self.bin / "tunica-relax").unlink()
        self.assertIn("no tunica-relax", self.refusal(VOLUMES="a.nii.gz", LABEL=1, **LOAD))

    def test_the_users_own_angle_goes_before(self):
        for words in ("--min-angle 0", "--min-angle=5"):
            self.make(VOLUMES="a.nii.gz", LABEL=1, DECIMATE=words, **LOAD)
            self.assertIn(f"--triangles 190 {words} ", [line for line in self.calls() if line.startswith("decimate")][0])

    def test_labels_and_supports_of_several_parts(self):
        done = self.make(VOLUMES="a.nii.gz", LABELS="1+2 'left atrium+7'", FIX="below z=-1mm;; above z=2 mm ;", **LOAD)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(sorted(path.name for path in (self.out / "a").iterdir()), ["1+2", "left atrium+7"])
        calls = self.calls()
        self.assertIn("--label 1+2 ", calls[0])
        self.assertIn(" --fix below z=-1mm --fix above z=2 mm --imaged-at 0kPa --pressure", calls[3])
        self.assertIn("give one", self.refusal_of(LABEL=1, LABELS=2))

    def test_cuts_and_beds(self):
        done = self.make(VOLUMES="a.nii.gz", LABEL=1, CUT="above z=40mm; below z=-6cm", FIX="rims:slide", SUPPORT="1e5N/m3",
                         **LOAD)
        self.assertEqual(done.returncode, 0, done.stderr)
        calls = self.calls()
        self.assertIn(" --cut above z=40mm --cut below z=-6cm", calls[0])
        self.assertIn(" --fix rims:slide --support 1e5N/m3", calls[3])
        self.assertIn("1e5N/m3", self.refusal_of(LABEL=1, SUPPORT="100000"))

    def refusal_of(self, **variables):
        return self.make(VOLUMES="a.nii.gz", **LOAD, **variables).stderr

    def test_a_stage_is_done_when_its_files_are_there(self):
        arguments = dict(VOLUMES="a.nii.gz", LABEL=1, **LOAD)
        for flags, more, stage in (((), {"EXTRACT": "--nothing"}, "extract"), (("-k", "-j"), {"RUN": "true"}, "extract"),
                                   (("-k",), {"SIMULATE": "--nothing"}, "simulate")):
            done = self.make(*flags, **more, **arguments)
            self.assertEqual(done.returncode, 2, more)
            row = self.summary()["a/1"]
            self.assertEqual((row["stage"], row["exit"]), (stage, "1"), more)
            self.assertIn(f"tunica-{stage}: ended with exit code 0, but without ", row["message"])
            self.assertNotIn("done", done.stdout)
            self.calls()
        self.assertEqual(self.make(**arguments).returncode, 0)
        self.assertEqual(self.verbs(), ["simulate"], "what a try without a result left is no result")
        done = self.make(SIMULATE="--help", **arguments)
        self.assertEqual((done.returncode, self.calls()), (2, []))
        self.assertIn("tunica-simulate: one of its flags ends it before its work", self.summary()["a/1"]["message"])
        self.assertTrue((self.out / "a" / "1" / "result.hdf").is_file())

    def test_flags_of_make_that_take_things_for_done(self):
        arguments = dict(VOLUMES="a.nii.gz", LABEL=1, **LOAD)
        for flag in ("-i", "-t", "-ik"):
            self.assertIn("use -k", self.refusal(flag, **arguments))
        self.assertIn("use -k", self.refusal(environment={"MAKEFLAGS": "i"}, **arguments))
        asked = self.make("-q", **arguments)
        self.assertNotEqual(asked.returncode, 0, "there is something to do")
        self.assertEqual((self.out.exists(), self.calls()), (False, []))
        self.assertEqual(self.make("--no-print-directory", **arguments).returncode, 0)
        self.assertEqual(len(self.calls()), 4)
        self.assertEqual((self.make("-q", **arguments).returncode, self.calls()), (0, []))
        self.assertEqual(self.make("-B", **arguments).returncode, 0)
        self.assertEqual(self.verbs(), sorted(STAGES), "all anew")

    def test_values_are_no_code(self):
        arguments = dict(VOLUMES="a.nii.gz", LABEL=1, **LOAD)
        for code in ("1; touch pwned", "$(shell touch pwned)", "1 `touch pwned`", "1\ntouch pwned", "'$(touch pwned)'"):
            self.assertIn("is no number of threads", self.refusal(THREADS=code, **arguments))
            self.make("-B", **dict.fromkeys(("EXTRACT", "DECIMATE", "RELAX", "SIMULATE", "FIX", "SMOOTH"), code), **arguments)
            self.make("help", "-n", **dict.fromkeys(("MAPS", "CELL", "PARSER", "SECONDS", "DATA"), code))
            shutil.rmtree(self.out)
        self.assertFalse(list(self.folder.rglob("pwned*")))
        self.calls()
        self.make(EXTRACT="--names 'my table.tsv' \\$HOME", **arguments)
        self.assertIn("--names my table.tsv $HOME ", self.calls()[0])
        self.assertIn("EXTRACT: a quotation mark is not closed", self.make(EXTRACT="'", **arguments).stderr)

    def test_a_comma_is_no_decimal_point(self):
        for name, value, right in (("THICKNESS", "1,5mm", "1.5mm"), ("POISSON", "0,45", "0.45"), ("TOLERANCE", "0,5%", "0.5%"),
                                   ("SHELLS", "1,000", "1000")):
            said = self.refusal(VOLUMES="a.nii.gz", LABEL=1, **{**LOAD, name: value})
            self.assertIn(f"{name}: '{value}' has a comma: write {right}", said)

    def test_pythons_own_variables_change_nothing(self):
        done = self.make(VOLUMES="a.nii.gz", LABEL=1, environment={"PYTHONOPTIMIZE": "2", "PYTHONSAFEPATH": "1"}, **LOAD)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_dry_run_names_what_would_be_done_and_writes_nothing(self):
        arguments = dict(VOLUMES="a.nii.gz", LABEL=1, **LOAD)
        planned = self.make("-n", **arguments)
        self.assertEqual(planned.returncode, 0, planned.stderr)
        self.assertFalse(self.out.exists())
        for stage in STAGES:
            self.assertIn(f"tunica-{stage} ", planned.stdout)
        self.make(**arguments)
        self.calls()
        before = {path: path.stat().st_mtime_ns for path in self.out.rglob("*")}
        planned = self.make("-n", SHELLS=9, **arguments)
        self.assertNotIn("tunica-extract", planned.stdout)
        for stage in STAGES[1:]:
            self.assertIn(f"tunica-{stage} ", planned.stdout)
        self.assertNotIn("tunica-", self.make("-n", **arguments).stdout)
        self.assertEqual({path: path.stat().st_mtime_ns for path in self.out.rglob("*")}, before)
        self.assertEqual(self.calls(), [])


class Inputs(WithStubs):
    """What a stage read, by its own report, is what it depends on."""

    def setUp(self):
        super().setUp()
        self.read = [self.folder / "a.nii.gz", self.folder / "data.raw"]
        self.read[1].write_text("voxels")

    def run_again(self, volumes="a.nii.gz"):
        inputs = [{"path": str(path), "sha256": hashlib.sha256(path.read_bytes()).hexdigest()} for path in self.read]
        text = ", ".join(json.dumps(entry) for entry in inputs)
        done = self.make(VOLUMES=volumes, LABEL=1, environment={"STUB_INPUTS": text}, **LOAD)
        self.assertEqual(done.returncode, 0, done.stderr)
        return self.verbs()

    def test_changed_data_beside_a_header(self):
        self.assertEqual(self.run_again(), sorted(STAGES))
        self.assertEqual(self.run_again(), [])
        self.read[1].write_text("other voxels")
        self.assertEqual(self.run_again(), sorted(STAGES))
        self.assertEqual(self.run_again(), [])

    def test_an_older_file_moved_into_place(self):
        other = self.folder / "other.raw"
        other.write_text("VOXELS")
        os.utime(other, (1, 1))
        self.run_again()
        other.rename(self.read[1])
        self.assertEqual(self.run_again(), sorted(STAGES))
        os.chmod(self.read[1], 0o600)
        self.assertEqual(self.run_again(), [], "the same content")

    def test_slices_of_a_folder(self):
        slices = self.folder / "slices"
        slices.mkdir()
        self.read = [slices / f"{number}.png" for number in range(3)]
        for path in self.read:
            path.write_text("a slice")
        self.assertEqual(self.run_again("slices/"), sorted(STAGES))
        self.assertEqual(self.run_again("slices"), [])
        self.read[1].write_text("another slice")
        self.assertEqual(self.run_again("slices"), sorted(STAGES), "a changed slice")
        self.read.append(slices / "3.png")
        self.read[3].write_text("a slice")
        self.assertEqual(self.run_again("slices"), sorted(STAGES), "one more")
        self.read.pop().unlink()
        self.assertEqual(self.run_again("slices"), sorted(STAGES), "one less")
        self.assertEqual(self.run_again("slices"), [])

    def again(self, arguments, **rest):
        self.assertEqual(self.make(**arguments, **rest).returncode, 0)
        return self.verbs()

    def test_times_say_nothing(self):
        arguments = dict(VOLUMES="a.nii.gz", LABEL=1, **LOAD)
        self.again(arguments)
        for time_ in (1, 5_000_000_000):  # 1970 and 2128
            for path in [self.folder / "a.nii.gz", *self.bin.iterdir(), *self.out.rglob("*")]:
                os.utime(path, (time_, time_))
            self.assertEqual(self.again(arguments), [])
        tool = self.bin / "tunica-relax"
        tool.write_text(tool.read_text() + "# another one\n")
        os.utime(tool, (1, 1))
        self.assertEqual(self.again(arguments), sorted(STAGES[2:]))
        self.assertEqual(self.again(arguments, environment={"STUB_VERSION": "2"}), sorted(STAGES), "another shared library")

    def test_damaged_files_are_made_anew(self):
        arguments = dict(VOLUMES="a.nii.gz", LABEL=1, **LOAD)
        self.again(arguments)
        for name, redone in (("surface.ply", STAGES), ("coarse.ply", STAGES[1:]), ("map.png", STAGES[2:]), ("result.hdf", STAGES[3:]),
                             ("result.page", STAGES[3:])):
            path = self.out / "a" / "1" / name
            good, state = path.read_text(), path.stat()
            path.write_text("damaged")
            os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))
            self.assertEqual(self.again(arguments), sorted(redone), name)
            self.assertEqual(path.read_text(), good)

    def test_files_of_another_case_are_none_of_this(self):
        arguments = dict(VOLUMES="a.nii.gz", LABELS="1 2", **LOAD)
        stub = self.bin / "tunica-extract"  # whose surfaces differ from case to case
        stub.write_text(stub.read_text().replace('echo "$verb" > "$output"', 'echo "$output" > "$output"'))
        self.again(arguments)
        for stage, files in (("decimate", ["coarse.ply"]), ("relax", ["shell.ply", "map.png"]),
                             ("simulate", ["result.hdf", "result.page", "picture.png"])):
            for name in (*files, f"{stage}.json", f".{stage}.flags"):
                shutil.copy2(self.out / "a" / "1" / name, self.out / "a" / "2" / name)
        self.assertEqual(self.again(arguments), sorted(STAGES[1:]))

    def test_results_of_another_case_are_not_taken_for_ones_own(self):
        arguments = dict(VOLUMES="a.nii.gz", LABELS="1 2", **LOAD)
        stub = self.bin / "tunica-extract"  # whose surfaces differ from case to case
        stub.write_text(stub.read_text().replace('echo "$verb" > "$output"', 'echo "$output" > "$output"'))
        self.again(arguments)
        for path in (self.out / "a" / "1").iterdir():
            if not path.name.startswith("."):  # as cp folder/* takes them
                shutil.copy2(path, self.out / "a" / "2" / path.name)
        self.assertEqual(self.again(arguments), sorted(STAGES))

    def test_a_table_of_names_that_comes_first_now(self):
        arguments = dict(VOLUMES="a.nii.gz", LABEL=1, **LOAD)
        self.again(arguments)
        table = self.folder / "a.tsv"
        for text in ("index\tname\n1\taorta\n", "index\tname\n2\taorta\n"):
            table.write_text(text)
            os.utime(table, (1, 1))
            self.assertEqual(self.again(arguments), sorted(STAGES))
        (self.folder / "another.tsv").write_text(text)
        self.assertEqual(self.again(arguments), [])

    def test_results_that_were_moved(self):
        arguments = dict(VOLUMES="a.nii.gz", LABEL=1, **LOAD)
        self.again(arguments)
        moved = self.folder / "moved"
        self.out.rename(moved)
        self.assertEqual(self.again({**arguments, "OUT": "moved"}), [])

    def test_another_volume_of_the_same_relative_name(self):
        self.run_again()
        for name in ("here", "there"):
            (self.folder / name).mkdir()
            (self.folder / name / "a.nii.gz").write_text(name)
        self.run_again("here/a.nii.gz")
        os.utime(self.folder / "there" / "a.nii.gz", (1, 1))
        self.assertEqual(self.run_again("there/a.nii.gz"), sorted(STAGES))

    def test_a_result_without_its_report_is_none(self):
        self.run_again()
        (self.out / "a" / "1" / "relax.json").unlink()
        self.assertEqual(self.run_again(), sorted(STAGES[2:]))


class Names(WithStubs):
    """Any name a file may have works, or is refused by name, and none is ever run."""

    def setUp(self):
        super().setUp()
        self.scans = self.folder / "scans"
        self.scans.mkdir()

    def run_on(self, *names, volumes="scans/*", flags=("-k", "-j2"), **variables):
        for name in names:
            (self.scans / name).write_text("a volume")
        done = self.make(*flags, VOLUMES=volumes, LABEL=1, **LOAD, **variables)
        self.assertNotIn("Traceback", done.stderr)
        return done

    def test_names_of_every_sign_are_done(self):
        signs = "".join(chr(code) for code in range(0x20, 0x7f) if chr(code) != "/")
        names = [signs, signs[::-1], "`touch pwned`", "$(touch pwned)", "$(shell touch pwned)", "x'\"; touch pwned; '",
                 "a b  c", "--help", "-rf", "${HOME}", "#", "=", "%", "a:b", "~", ".b", "(1)", "a\u00a0b",
                 "gro\u00dfe Gef\u00e4\u00dfe \u5fc3", "l" * 240]
        done = self.run_on(*(name + ".nii.gz" for name in names), volumes="scans/* scans/.b.nii.gz")
        self.assertEqual(done.returncode, 0, done.stderr)
        for name in names:
            self.assertTrue((self.out / name / "1" / "result.hdf").is_file(), name)
        self.assertFalse(list(self.folder.rglob("pwned*")))
        with open(self.out / "summary.tsv", encoding="utf-8") as file:
            self.assertEqual(len(file.read().split("\n")), len(names) + 2)
        self.calls()
        again = self.run_on(volumes="scans/* scans/.b.nii.gz")
        self.assertEqual((again.returncode, self.calls()), (0, []), again.stderr)

    def test_a_name_that_begins_like_a_flag_is_no_flag(self):
        (self.folder / "-rf.nii.gz").write_text("a volume")
        self.assertEqual(self.make(VOLUMES="-rf.nii.gz", LABEL=1, **LOAD).returncode, 0)
        self.assertTrue(self.calls()[0].startswith("extract ./-rf.nii.gz "))
        self.assertEqual(self.make(VOLUMES="*rf.nii.gz", LABEL=1, **{**LOAD, "OUT": "-out"}).returncode, 0)
        self.assertTrue(all(" ./-out/" in line for line in self.calls()))

    def test_names_with_blanks_in_a_list(self):
        for name in ("my scan.nii", "a  b.nii", "c.nii"):
            (self.folder / name).write_text("a volume")
        for volumes in ("my scan.nii a  b.nii c.nii", "c.nii a  b.nii my sc*.nii", "'"):
            expected = {"'"} if volumes == "'" else {"my scan", "a  b", "c"}
            self.make("-k", VOLUMES=volumes, LABEL=1, **LOAD)
            self.assertEqual({path.name for path in self.out.iterdir() if path.is_dir()}, expected)
            shutil.rmtree(self.out)

    def test_whole_name_in_the_list_is_never_expanded(self):
        for name in ("a$(shell touch pwned)b.nii", "$(PRESSURE).nii", "$$.nii", "`touch pwned`.nii", "a#b.nii",
                     "[x].nii"):
            (self.folder / name).write_text("a volume")
            done = self.make(VOLUMES=name, LABEL=1, **LOAD)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertTrue((self.out / name[:-4] / "1" / "result.hdf").is_file(), name)
            self.assertFalse(list(self.folder.rglob("pwned*")))

    def test_bytes_that_are_no_text(self):
        name = os.fsdecode(b"\xff\xfe.nii.gz")
        done = self.run_on(name)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue((self.out / name[:-7] / "1" / "result.hdf").is_file())
        self.assertIn("\n\ufffd\ufffd/1\t", (self.out / "summary.tsv").read_text(encoding="utf-8"))

    def test_control_signs_are_refused_by_name_and_the_others_go_on(self):
        for flags in ((), ("-k", "-j2")):
            done = self.run_on("a\nb.nii.gz", "tab\t.nii.gz", "good.nii.gz", flags=flags)
            self.assertNotEqual(done.returncode, 0)
            rows = self.summary()
            self.assertEqual(rows["good/1"]["message"], "done")
            refused = [row for row in rows.values() if row["message"] != "done"]
            self.assertEqual([(row["stage"], row["exit"]) for row in refused], [("none", "2")] * 2)
            self.assertIn(r"scans/a\nb.nii.gz: has a control character", refused[0]["message"])
            self.assertIn(r"pipeline: scans/tab\t.nii.gz: has a control character", done.stderr)
            shutil.rmtree(self.out)

    def test_names_of_the_pipelines_own_files_are_refused(self):
        own = ("summary.tsv", "cohort.tsv", "cohort.json", "report.html.part", ".lock", ".run", ".cases.part")
        done = self.run_on(*(f"{name}.nii.gz" for name in own), "good.nii.gz", "bin.nii.gz", "cases.nii.gz",
                           volumes="scans/* scans/.[lrc]*")
        self.assertNotEqual(done.returncode, 0)
        rows = self.summary()
        self.assertEqual([rows[f"{name}/1"]["message"] for name in ("good", "bin", "cases")], ["done"] * 3)
        for name in own:
            self.assertIn(f"cannot be called '{name}'", rows[f"{name}/1"]["message"])

    def test_names_that_are_alike_to_make_stay_apart(self):
        done = self.run_on("a b.nii.gz", "a+b.nii.gz", "a_b.nii.gz", "a_b_2.nii.gz")
        self.assertEqual(done.returncode, 0, done.stderr)
        for name in ("a b", "a+b", "a_b", "a_b_2"):
            self.assertTrue((self.out / name / "1" / "result.hdf").is_file(), name)
        self.assertEqual(len(self.calls()), 16)

    def test_a_folder_that_cannot_be_made_is_one_failed_case(self):
        self.out.mkdir()
        (self.out / "a").write_text("in the way")
        done = self.make(VOLUMES="a.nii.gz b.seg.nrrd", LABEL=1, **LOAD)
        self.assertNotEqual(done.returncode, 0)
        rows = self.summary()
        self.assertEqual((rows["a/1"]["exit"], rows["b/1"]["message"]), ("2", "done"))
        self.assertIn("cannot be written", rows["a/1"]["message"])

    def test_settings_are_single_words(self):
        done = self.make(VOLUMES="a.nii.gz", LABEL=1, FIX="below z=-1mm & touch pwned",
                         **{**LOAD, "PRESSURE": "$(touch pwned)"})
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("--fix below z=-1mm & touch pwned --imaged-at 0kPa --pressure $(touch pwned) ", self.calls()[3])
        self.assertFalse(list(self.folder.rglob("pwned*")))


class Runs(WithStubs):
    """Runs that are killed, run into each other, or cannot write; the summary is that of the run."""

    ARGUMENTS = dict(VOLUMES="a.nii.gz b.seg.nrrd", LABELS="1 2", **LOAD)

    def wait_for(self, count):
        """Until so many commands have begun."""
        while len((self.bin / "calls").read_text().splitlines() if (self.bin / "calls").exists() else []) < count:
            time.sleep(0.01)

    def tree(self, run, program=""):
        """The processes of a run, or those of a program in it, the first first."""
        listed = subprocess.run(["ps", "-o", "pid=,comm=", "-s", str(run.pid)], capture_output=True, text=True, check=True)
        processes = (line.split() for line in listed.stdout.splitlines())
        return sorted(int(pid) for pid, name, *_ in processes if program in name)

    def test_a_run_that_waits_says_for_what(self):
        self.out.mkdir()
        with open(self.out / ".lock", "w") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            run = self.start(**self.ARGUMENTS)
            self.assertIn("another run", run.stderr.readline())
            self.assertEqual(list(self.out.iterdir()), [self.out / ".lock"])
        run.communicate()
        self.assertEqual(run.returncode, 0)

    def test_the_next_run_waits_for_what_a_kill_left(self):
        slow = {"STUB_SECONDS": "0.3"}
        for victims in (1, 2, 3):  # the top make, the program, the make of the cases
            run = self.start("-j2", "-k", environment=slow, SHELLS=victims, **self.ARGUMENTS)
            self.wait_for(3)
            for process in self.tree(run)[:victims]:
                os.kill(process, signal.SIGKILL)
            done = self.make("-j2", "-k", SHELLS=victims, **self.ARGUMENTS)
            run.communicate()
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual([row["message"] for row in self.summary().values()], ["done"] * 4)
            self.assertNotIn("collision", self.calls())
            self.assertFalse((self.out / ".run").exists())

    def test_runs_on_one_folder_come_one_after_the_other(self):
        slow = {"STUB_SECONDS": "0.2"}
        runs = [self.start("-j2", "-k", environment=slow, SHELLS=count, **self.ARGUMENTS) for count in (5, 6, 7)]
        for run in runs:
            stdout, stderr = run.communicate(timeout=100)
            self.assertEqual(run.returncode, 0, stderr)
            self.assertEqual(stdout.count(" done\n"), 4, stdout)
        self.assertNotIn("collision", self.calls())

    def test_random_kills_leave_nothing_wrong(self):
        choice = random.Random(1)
        for attempt in range(4):
            run = self.start("-j2", "-k", environment={"STUB_SECONDS": "0.05"}, SHELLS=attempt, **self.ARGUMENTS)
            time.sleep(choice.uniform(0.2, 1.5))
            victims = self.tree(run)
            for process in choice.sample(victims, min(len(victims), choice.randint(1, 4))):
                try:
                    os.kill(process, signal.SIGKILL)
                except ProcessLookupError:
                    pass
            self.make("-j2", "-k", SHELLS=attempt, **self.ARGUMENTS)
            run.communicate()
            for busy in self.out.rglob("*.busy"):  # of a stub that was killed
                busy.rmdir()
            done = self.make("-j2", "-k", SHELLS=attempt, **self.ARGUMENTS)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.calls()
            self.assertEqual(self.make("-j2", SHELLS=attempt, **self.ARGUMENTS).returncode, 0)
            self.assertEqual(self.calls(), [])

    def test_makes_wait_for_no_job_slots_of_each_other(self):
        run = self.start("-j2", environment={"STUB_SECONDS": "0.2"}, **self.ARGUMENTS)
        self.wait_for(2)  # two at once: the slots are there
        makes = subprocess.run(["pgrep", "-x", "-s", str(run.pid), "make"], capture_output=True, text=True, check=True).stdout
        of_cases = next(process for process in makes.split() if process != str(run.pid))
        environment = pathlib.Path(f"/proc/{of_cases}/environ").read_text().split("\0")
        run.communicate()
        self.assertEqual(run.returncode, 0)
        flags = next(setting for setting in environment if setting.startswith("MAKEFLAGS="))
        self.assertIn("-j2", flags)
        self.assertNotIn("jobserver", flags)

    def test_a_stopped_run_says_so_leaves_nothing_at_work_and_goes_on(self):
        for stop in (lambda run: os.kill(run.pid, signal.SIGTERM), lambda run: os.killpg(run.pid, signal.SIGINT)):
            run = self.start("-j2", environment={"STUB_SECONDS": "1000"}, **self.ARGUMENTS)
            # Both asleep: a shell that is stopped just before it sleeps does so first.
            while len(self.tree(run, "sleep")) < 2:
                time.sleep(0.01)
            stop(run)
            stdout, stderr = run.communicate(timeout=100)
            self.assertNotEqual(run.returncode, 0)
            with open(self.out / ".lock") as file:
                fcntl.flock(file, fcntl.LOCK_EX)  # the last process of the run has ended
            self.assertNotIn("Traceback", stderr)
            self.assertNotIn("done", stdout)
            self.assertEqual({row["message"] for row in self.summary().values()}, {"stopped while it ran: the next run begins this stage again", "not run"})
            for busy in self.out.rglob("*.busy"):  # of a stub that was stopped
                busy.rmdir()
            self.calls()
        self.assertEqual(self.make("-j2", **self.ARGUMENTS).returncode, 0)
        self.assertEqual([row["message"] for row in self.summary().values()], ["done"] * 4)

    def test_what_an_earlier_run_did_is_not_told(self):
        self.make("-k", environment={"STUB_FAIL": "relax/b/1"}, **self.ARGUMENTS)
        self.assertEqual(self.summary()["b/1"]["stage"], "relax")
        self.make(SHELLS=9, environment={"STUB_FAIL": "decimate/a/1"}, **self.ARGUMENTS)
        rows = self.summary()
        self.assertEqual((rows["a/1"]["stage"], rows["a/1"]["exit"]), ("decimate", "4"))
        for name in ("a/2", "b/1", "b/2"):
            self.assertEqual((rows[name]["stage"], rows[name]["message"], rows[name]["shells"]), ("none", "not run", ""))

    def test_folder_of_results_that_is_a_file(self):
        self.out.write_text("in the way")
        done = self.make(**self.ARGUMENTS)
        self.assertNotEqual(done.returncode, 0)
        self.assertNotIn("Traceback", done.stderr)
        self.assertIn(f"pipeline: {self.out}: File exists", done.stderr)

    def test_summary_that_cannot_be_written(self):
        (self.out / "summary.tsv").mkdir(parents=True)
        done = self.make(**self.ARGUMENTS)
        self.assertNotEqual(done.returncode, 0)
        self.assertNotIn("Traceback", done.stderr)
        self.assertIn(f"tunica-report: {self.out / 'summary.tsv'}: ", done.stderr)
        self.assertEqual(done.stdout.count("  done\n"), 4)

    @unittest.skipIf(os.geteuid() == 0, "the superuser may write anywhere")
    def test_a_folder_that_cannot_be_written_to_is_named(self):
        self.out.mkdir(mode=0o500)
        done = self.make(**self.ARGUMENTS)
        self.assertNotEqual(done.returncode, 0)
        self.assertNotIn("Traceback", done.stderr)
        self.assertIn("Permission denied", done.stderr)

    def test_nobody_reads_the_table(self):
        full = open("/dev/full", "w")
        self.addCleanup(full.close)
        words = [f"{name}={value}" for name, value in {"BIN": self.bin, "OUT": self.out, **self.ARGUMENTS}.items()]
        done = subprocess.run([SOURCE / "tools" / "pipeline.py"], cwd=self.folder, stdout=full, stderr=subprocess.PIPE,
                              env={**os.environ, **dict(word.split("=", 1) for word in words), "KIND": "static"}, text=True)
        self.assertNotIn("Traceback", done.stderr)
        self.assertEqual([row["message"] for row in self.summary().values()], ["done"] * 4)


@unittest.skipUnless(built(*STAGES, "phantom", "report"), "the tools are not built")
class WholeChain(Pipeline):
    """The real tools on tiny phantoms."""

    def phantom(self, shape, size=24):
        path = self.folder / f"{shape}.nii.gz"
        run_tool("phantom", shape, path, "--size", size, "--spacing", 2)
        return path

    def test_phantoms_to_results(self):
        for shape in ("sphere", "aneurysm"):
            self.phantom(shape, 20)
        done = self.make("-j2", VOLUMES="*.nii.gz", LABELS=1, SHELLS=200, RELAX="--max-iterations 2", **LOAD)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        for shape in ("sphere", "aneurysm"):
            folder = self.out / shape / "1"
            report = json.loads((folder / "simulate.json").read_text())
            self.assertTrue(report["ok"] and report["result"]["converged"])
            self.assertGreater(report["result"]["max_displacement_mm"], 0)
            self.assertLessEqual(json.loads((folder / "decimate.json").read_text())["result"]["triangles"], 200)
            self.assertGreater((folder / "map.png").stat().st_size, 1000)
            self.assertGreater((folder / "picture.png").stat().st_size, 1000)
            self.assertEqual((folder / "result.hdf").read_bytes()[:4], b"\x89HDF")
        self.assertIn("<svg", (self.out / "chart.svg").read_text())

    def test_sphere_inflates_as_the_formula_says(self):
        """u = p R^2 (1 - nu) / (2 E t) of a thin sphere, at 1 % of pressure and thickness."""
        self.phantom("sphere", 24)
        arguments = dict(LOAD, PRESSURE="0.1kPa")
        done = self.make(VOLUMES="sphere.nii.gz", LABEL=1, SHELLS=150, **arguments)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        result = json.loads((self.out / "sphere" / "1" / "simulate.json").read_text())["result"]
        radius = (result["volume_before_mm3"] * 3 / 4 / 3.141592653589793) ** (1 / 3)
        expected = 1e-4 * radius**2 * (1 - 0.45) / (2 * 1.0 * 1.5)
        grown = (result["volume_after_mm3"] * 3 / 4 / 3.141592653589793) ** (1 / 3) - radius
        self.assertAlmostEqual(grown / expected, 1, delta=0.1)

    def test_a_lumen_is_loaded_in_the_middle_of_its_wall(self):
        # The phantom is an open vessel with an aneurysm, whose neck is sharper than half of this wall.
        self.phantom("aneurysm")
        wall = dict(LOAD, THICKNESS="4mm")
        done = self.make(VOLUMES="aneurysm.nii.gz", LABEL=1, OPEN=1, TOLERANCE="1%", MID_SURFACE="inner", **wall)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        folder = self.out / "aneurysm" / "1"
        relaxed, solved = (json.loads((folder / f"{stage}.json").read_text())["result"] for stage in ("relax", "simulate"))
        self.assertEqual((relaxed["mid_surface"]["target"], relaxed["self_intersections"]), ("inner", 0))
        self.assertLess(relaxed["mid_surface"]["error_mm"]["mean"], relaxed["hausdorff_mm"]["upper"])
        self.assertTrue(solved["converged"])
        page = (self.out / "report.html").read_text()
        self.assertIn("Shells to middle of the wall, at most", page)
        self.assertIn("surface half of the wall&#39;s thickness outside of the extracted one", page)

    def test_one_impossible_case_among_good_ones(self):
        self.phantom("sphere", 16)
        done = self.make("-k", VOLUMES="sphere.nii.gz missing.nii.gz", LABELS="1 9", SHELLS=60, RELAX="--max-iterations 1", **LOAD)
        self.assertNotEqual(done.returncode, 0)
        rows = self.summary()
        self.assertEqual(rows["sphere/1"]["message"], "done")
        for name in ("sphere/9", "missing/1", "missing/9"):
            self.assertEqual((rows[name]["stage"], rows[name]["exit"]), ("extract", "3"), name)
            self.assertFalse((self.out / name / "surface.ply").exists())
        self.assertIn("missing.nii.gz", rows["missing/1"]["message"])

    def test_a_limit_on_memory_ends_the_case_that_needs_more(self):
        self.phantom("sphere", 16)
        table = self.folder / "cases.tsv"
        table.write_text("case\tvolume\tlabel\tmem\nenough\tsphere.nii.gz\t1\t900\nless\tsphere.nii.gz\t1\t2\n")
        done = self.make("-k", CASES=table, SHELLS=60, RELAX="--max-iterations 1", **LOAD)
        self.assertNotEqual(done.returncode, 0)
        rows = self.summary()
        self.assertEqual(rows["enough/1"]["message"], "done")
        self.assertEqual((rows["less/1"]["stage"], rows["less/1"]["exit"]), ("extract", "6"))
        self.assertIn("limit 2MiB by --memory-limit", rows["less/1"]["message"])
        self.assertEqual({path.name for path in (self.out / "less" / "1").iterdir() if not path.name.startswith(".")},
                         {"extract.json", "extract.log"})

    def test_names_that_nobody_means(self):
        """The real tools take what the stubs of Names took, and the page of the run tells of it."""
        shape = self.phantom("sphere", 16)
        signs = "".join(chr(code) for code in range(0x20, 0x7f) if chr(code) != "/")
        names = [signs, "-rf", "--help", "gro\u00dfe Gef\u00e4\u00dfe \u5fc3", os.fsdecode(b"\xff\xfe")]
        scans = self.folder / "scans of 'all'"
        scans.mkdir()
        for name in names:
            shutil.copy(shape, scans / f"{name}.nii.gz")
        arguments = dict(VOLUMES=f"{scans.name}/*", LABELS=1, SHELLS=60, RELAX="--max-iterations 1", **LOAD)
        done = self.make("-k", "-j2", **arguments)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        results = [self.out / name / "1" / "result.hdf" for name in names]
        times = [path.stat().st_mtime_ns for path in results]
        run_tool("report", self.out, "-o", self.folder / "page.html", "--verify", "--quiet")
        self.assertEqual(self.make("-k", "-j2", **arguments).returncode, 0)
        self.assertEqual([path.stat().st_mtime_ns for path in results], times, "nothing is out of date")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + ["-v"] + sys.argv[1:])
