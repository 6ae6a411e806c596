#!/usr/bin/env python3
"""Makefile.pipeline: its rules with tools that do nothing but write their files, and the whole chain with the real ones."""

import csv
import json
import os
import pathlib
import shutil
import stat
import subprocess
import sys
import tempfile
import unittest

SOURCE = pathlib.Path(__file__).resolve().parents[2]
TOOLS = pathlib.Path(os.environ.get("TUNICA_BIN", SOURCE / "build" / "release" / "bin"))
LOAD = {"PRESSURE": "1kPa", "YOUNG": "1MPa", "POISSON": "0.45", "THICKNESS": "1.5mm", "DENSITY": "1100kg/m3"}
STAGES = ["extract", "decimate", "relax", "simulate"]


class Pipeline(unittest.TestCase):
    """A folder of its own with the results of `make`."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tunica-pipeline-"))
        self.addCleanup(shutil.rmtree, self.folder)
        self.out = self.folder / "out"
        self.bin = TOOLS

    def make(self, *flags, environment=None, **variables):
        words = [f"{name}={value}" for name, value in variables.items()]
        settings = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
        settings.update(environment or {})
        return subprocess.run(
            ["make", "-f", SOURCE / "Makefile.pipeline", f"BIN={self.bin}", f"OUT={self.out}", *flags, *words],
            cwd=self.folder, env=settings, capture_output=True, text=True, timeout=500)

    def summary(self):
        with open(self.out / "summary.tsv", newline="") as file:
            return {row["case"]: row for row in csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE)}


class Rules(Pipeline):
    """What is run when, with stub tools."""

    def setUp(self):
        super().setUp()
        self.bin = self.folder / "bin"
        self.bin.mkdir()
        for verb in STAGES + ["chart"]:
            shutil.copy(SOURCE / "tests" / "pipeline" / "stub_tool", self.bin / f"tunica-{verb}")
        for name in ("a.nii.gz", "b.seg.nrrd"):
            (self.folder / name).write_text("a volume")

    def calls(self):
        """The tools' command lines since the last call."""
        log = self.bin / "calls"
        lines = log.read_text().splitlines() if log.exists() else []
        log.unlink(missing_ok=True)
        return [line for line in lines if not line.startswith("chart")]

    def verbs(self):
        return sorted(line.split()[0] for line in self.calls())

    def touch_later(self, path):
        """Makes `path` newer than everything there is."""
        newest = max(p.stat().st_mtime_ns for p in self.folder.rglob("*"))
        os.utime(path, ns=(newest + 1_000_000, newest + 1_000_000))

    def test_case_leaves_the_files_of_the_contract(self):
        done = self.make(VOLUMES="a.nii.gz", LABEL=3, **LOAD)
        self.assertEqual(done.returncode, 0, done.stderr)
        present = {path.name for path in (self.out / "a" / "3").iterdir() if not path.name.startswith(".")}
        self.assertLessEqual({"surface.ply", "coarse.ply", "shell.ply", "map.png", "result.hdf", "extract.json",
                              "decimate.json", "relax.json", "simulate.json"}, present)
        row = self.summary()["a/3"]
        self.assertEqual((row["stage"], row["exit"], row["message"]), ("simulate", "0", "done"))
        self.assertEqual((row["shells"], row["error_percent"], row["seconds"]), ("42", "0.625", "1.00"))
        for name in ("result.hdf", "map.png"):
            self.assertIn(str(self.out / "a" / "3" / name), done.stdout)
        self.assertIn(str(self.out / "chart.svg"), done.stdout)

    def test_variables_reach_the_tools(self):
        self.make(VOLUMES="a.nii.gz", LABEL=3, SMOOTH="none", LARGEST=0, FILL=0, OPEN=1, SHELLS=123, TOLERANCE="0.5%",
                  METHOD="barycentre", THREADS=3, FIX="below z=-10mm", EXTRACT="--frame 2", **LOAD)
        extract, decimate, relax, simulate = self.calls()
        self.assertIn("--label 3 --smooth none --open-border --frame 2 --threads 3", extract)
        self.assertIn("--triangles 123", decimate)
        self.assertIn("--tolerance 0.5% --refine --method barycentre", relax)
        self.assertIn("--fix below z=-10mm --pressure=1kPa --young 1MPa --poisson 0.45 --thickness 1.5mm "
                      "--density 1100kg/m3 --static", simulate)

    def test_defaults(self):
        self.make(VOLUMES="a.nii.gz", ISOVALUE=-0.5, **LOAD)
        extract, decimate, relax, simulate = self.calls()
        self.assertIn("--isovalue=-0.5 --smooth staircase --largest --fill-cavities", extract)
        self.assertNotIn("--open-border", extract)
        self.assertIn("--triangles 800", decimate)
        self.assertNotIn("--tolerance", relax)
        self.assertTrue((self.out / "a" / "iso-0.5" / "result.hdf").exists())

    def test_dynamic(self):
        done = self.make(VOLUMES="a.nii.gz", LABEL=1, KIND="dynamic", DURATION="1s", STEP="10ms", **LOAD)
        self.assertEqual(done.returncode, 0, done.stderr)
        simulate = self.calls()[3]
        self.assertIn("--duration 1s --step 10ms", simulate)
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
        arguments = dict(VOLUMES="a.nii.gz", LABEL=1, **LOAD)
        self.make(**arguments)
        self.calls()
        for changed, redone in (({"PRESSURE": "2kPa"}, STAGES[3:]), ({"FIX": "boundary"}, STAGES[3:]),
                                ({"TOLERANCE": "1%"}, STAGES[2:]), ({"SHELLS": "99"}, STAGES[1:]),
                                ({"SMOOTH": "none"}, STAGES)):
            arguments.update(changed)
            self.assertEqual(self.make(**arguments).returncode, 0)
            self.assertEqual(self.verbs(), sorted(redone), changed)
        for path, redone in ((self.folder / "a.nii.gz", STAGES), (self.out / "a" / "1" / "coarse.ply", STAGES[2:]),
                             (self.bin / "tunica-simulate", STAGES[3:])):
            self.touch_later(path)
            self.make(**arguments)
            self.assertEqual(self.verbs(), sorted(redone), path)
        (self.out / "a" / "1" / "map.png").unlink()
        self.make(**arguments)
        self.assertEqual(self.verbs(), sorted(STAGES[2:]))

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
        for name in ("coarse.ply", "shell.ply", "map.png", "result.hdf"):
            self.assertFalse((self.out / "a" / "1" / name).exists(), name)
        self.assertEqual(self.summary()["a/1"]["stage"], "decimate")

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

    def test_a_killed_command_is_a_failed_case(self):
        killer = self.folder / "killer"
        killer.write_text("#!/bin/sh\nkill -9 $$\n")
        killer.chmod(0o755)
        done = self.make(VOLUMES="a.nii.gz", LABEL=1, RUN=killer, **LOAD)
        self.assertNotEqual(done.returncode, 0)
        self.assertEqual(self.summary()["a/1"]["exit"], "137")

    def refusal(self, *flags, **variables):
        done = self.make(*flags, **variables)
        self.assertNotEqual(done.returncode, 0)
        self.assertFalse(self.out.exists(), "refused before any work")
        return done.stderr

    def test_nothing_physical_is_assumed_for_a_users_volume(self):
        for name in LOAD:
            rest = {key: value for key, value in LOAD.items() if key != name}
            self.assertIn(f"{name} not given", self.refusal(VOLUMES="a.nii.gz", LABEL=1, **rest))
        self.assertIn("PRESSURE YOUNG POISSON THICKNESS DENSITY not given", self.refusal(VOLUMES="a.nii.gz", LABEL=1))
        self.assertIn("LABELS not given", self.refusal(VOLUMES="a.nii.gz", **LOAD))
        self.assertIn("DURATION STEP not given", self.refusal(VOLUMES="a.nii.gz", LABEL=1, KIND="dynamic", **LOAD))

    def test_contradictions_are_refused(self):
        self.assertIn("KIND=quick", self.refusal(VOLUMES="a.nii.gz", LABEL=1, KIND="quick", **LOAD))
        self.assertIn("exclude each other", self.refusal(VOLUMES="a.nii.gz", LABEL=1, ISOVALUE=2, **LOAD))
        self.assertIn("nothing matches none*.nii", self.refusal(VOLUMES="none*.nii", LABEL=1, **LOAD))
        (self.folder / "other").mkdir()
        (self.folder / "other" / "a.nii").write_text("another")
        self.assertIn("same stem", self.refusal(VOLUMES="a.nii.gz other/a.nii", LABEL=1, **LOAD))
        self.assertIn("without spaces", self.refusal(VOLUMES="a.nii.gz", LABEL=1, OUT=f"{self.out} 2", **LOAD))
        self.assertIn("names with the sign '", self.refusal(VOLUMES="a'.nii", LABEL=1, **LOAD))

    def test_a_glob_that_matches_a_name_with_a_space_is_refused(self):
        (self.folder / "a b.nii.gz").write_text("a volume")
        self.assertIn("has a space in its name", self.refusal(VOLUMES="a*.nii.gz", LABEL=1, **LOAD))

    def test_names_with_spaces_are_explained(self):
        (self.folder / "my scan.nii").write_text("a volume")
        done = self.make(VOLUMES="my scan.nii", LABEL=1, **LOAD)
        self.assertIn("no such volume: my (a name with spaces cannot stand in VOLUMES", done.stderr)


@unittest.skipUnless(all((TOOLS / f"tunica-{verb}").exists() for verb in STAGES + ["phantom", "chart"]),
                     "the tools are not built")
class WholeChain(Pipeline):
    """The real tools on tiny phantoms."""

    def phantom(self, shape, size=24):
        path = self.folder / f"{shape}.nii.gz"
        subprocess.run([TOOLS / "tunica-phantom", shape, path, "--size", str(size), "--spacing", "2"], check=True,
                       capture_output=True)
        return path

    def test_phantoms_to_results(self):
        for shape in ("sphere", "aneurysm"):
            self.phantom(shape)
        done = self.make("-j2", VOLUMES="*.nii.gz", LABELS=1, SHELLS=200, **LOAD)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        for shape in ("sphere", "aneurysm"):
            folder = self.out / shape / "1"
            report = json.loads((folder / "simulate.json").read_text())
            self.assertTrue(report["ok"] and report["result"]["converged"])
            self.assertGreater(report["result"]["max_displacement_mm"], 0)
            self.assertLessEqual(json.loads((folder / "decimate.json").read_text())["result"]["triangles"], 200)
            self.assertGreater((folder / "map.png").stat().st_size, 1000)
            self.assertEqual((folder / "result.hdf").read_bytes()[:4], b"\x89HDF")
        self.assertIn("<svg", (self.out / "chart.svg").read_text())

    def test_sphere_inflates_as_the_formula_says(self):
        """u = p R^2 (1 - nu) / (2 E t) of a thin sphere, at 1 % of pressure and thickness."""
        self.phantom("sphere", 32)
        arguments = dict(LOAD, PRESSURE="0.1kPa")
        done = self.make(VOLUMES="sphere.nii.gz", LABEL=1, SHELLS=600, **arguments)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        result = json.loads((self.out / "sphere" / "1" / "simulate.json").read_text())["result"]
        radius = (result["volume_before_mm3"] * 3 / 4 / 3.141592653589793) ** (1 / 3)
        expected = 1e-4 * radius**2 * (1 - 0.45) / (2 * 1.0 * 1.5)
        grown = (result["volume_after_mm3"] * 3 / 4 / 3.141592653589793) ** (1 / 3) - radius
        self.assertAlmostEqual(grown / expected, 1, delta=0.1)

    def test_one_impossible_case_among_good_ones(self):
        self.phantom("sphere")
        done = self.make("-k", VOLUMES="sphere.nii.gz missing.nii.gz", LABELS="1 9", SHELLS=100, **LOAD)
        self.assertNotEqual(done.returncode, 0)
        rows = self.summary()
        self.assertEqual(rows["sphere/1"]["message"], "done")
        for name in ("sphere/9", "missing/1", "missing/9"):
            self.assertEqual((rows[name]["stage"], rows[name]["exit"]), ("extract", "3"), name)
            self.assertFalse((self.out / name / "surface.ply").exists())
        self.assertIn("missing.nii.gz", rows["missing/1"]["message"])

    @unittest.skipUnless(shutil.which("srun") and subprocess.run(["srun", "-n1", "true"], capture_output=True,
                                                                  timeout=30).returncode == 0, "no Slurm here")
    def test_on_slurm(self):
        self.phantom("sphere")
        done = self.make("-j2", VOLUMES="sphere.nii.gz", LABELS=1, SHELLS=100, THREADS=1, MEM=1000,
                         RUN="srun -n1 -c$(THREADS) --mem=$(MEM)M --quiet", **LOAD)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + ["-v"] + sys.argv[1:])
