#!/usr/bin/python3
"""tunica-batch of an installed tree that was moved, without the repository: usage, a cohort to its end, what it refuses."""

import os
import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

WALL = ["IMAGED_AT=0kPa", "PRESSURE=1kPa", "YOUNG=1MPa", "POISSON=0.45", "THICKNESS=1.5mm"]


class Batch(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="tunica-test-")
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        subprocess.run([os.environ["CMAKE"], "--install", os.environ["TUNICA_BUILD"], "--prefix", cls.folder / "first"],
                       check=True, capture_output=True)
        (cls.folder / "first").rename(cls.folder / "moved")
        cls.prefix = cls.folder / "moved"
        (cls.folder / "link").symlink_to(cls.prefix / "bin" / "tunica-batch")
        subprocess.run([cls.prefix / "bin" / "tunica-phantom", "sphere", cls.folder / "organ.nii.gz", "--size", "16",
                        "--spacing", "2"], check=True, capture_output=True)

    def batch(self, *words, program=None):
        environment = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL")}
        return subprocess.run([program or self.prefix / "bin" / "tunica-batch", *words], cwd=self.folder, env=environment,
                              capture_output=True, text=True, check=False)

    def test_usage_and_version(self):
        for flag in ("-h", "--help"):
            done = self.batch(flag)
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            self.assertIn("tunica-batch -j4 -k CASES=cases.tsv", done.stdout)
        done = self.batch()
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn("Usage: tunica-batch", done.stderr)
        self.assertRegex(self.batch("--version").stdout, r"^tunica-batch \d+\.\d+\.\d+")
        self.assertIn("THICKNESS", self.batch("help").stdout)

    def test_manual_page_names_what_the_usage_names(self):
        page = (self.prefix / "share" / "man" / "man1" / "tunica-batch.1").read_text().replace("\\-", "-")
        for word in ("-j", "-k", "-n", "-h", "--help", "--version", "help"):
            self.assertIn(f"\\fB{word}\\fR", page)
            self.assertIn(word, self.batch("-h").stdout)

    def complete(self, *words):
        """What bash offers for the last word."""
        script = self.prefix / "share" / "bash-completion" / "completions" / "tunica-batch"
        quoted = " ".join(f"'{word}'" for word in ("tunica-batch", *words))
        lines = [f". {script}", f"COMP_WORDS=({quoted})", f"COMP_CWORD={len(words)}", "_tunica_batch",
                 'printf "%s\\n" "${COMPREPLY[@]}"']
        done = subprocess.run(["bash", "-c", "\n".join(lines)], capture_output=True, text=True, check=True, cwd=self.folder)
        self.assertEqual(done.stderr, "")
        return done.stdout.split()

    def test_completion_knows_variables_and_values(self):
        offered = {word[:-1] for word in self.complete("") if word.endswith("=")}
        told = self.batch("help").stdout.split("Of other targets")[0]
        known = {name for line in told.splitlines() for name in re.findall(r"\b[A-Z_]{2,}\b", line.split("  ")[0])}
        self.assertEqual(offered, known - {"BIN"} | {"LABEL"})
        self.assertEqual(self.complete("PR"), ["PRESSURE="])
        self.assertEqual(self.complete("-k", "--v"), ["--version"])
        self.assertEqual(self.complete("KIND", "="), ["static", "dynamic"])
        self.assertEqual(self.complete("KIND", "=", "dy"), ["dynamic"])
        self.assertEqual(self.complete("KIND=dy"), ["KIND=dynamic"])
        self.assertEqual(self.complete("-j4", "OPEN", "=", ""), ["0", "1"])
        self.assertIn("organ.nii.gz", self.complete("VOLUMES", "=", "org"))
        self.assertEqual(self.complete("PRESSURE", "=", ""), [])

    def test_a_cohort_runs_to_its_end(self):
        (self.folder / "organ.tsv").write_text("index\tname\n1\tbladder\n")
        (self.folder / "cases.tsv").write_text("case\tvolume\tlabel\tpressure\np1\torgan.nii.gz\tbladder\t\n"
                                               "p2\torgan.nii.gz\t1\t0.5kPa\np3\torgan.nii.gz\t4\t\n")
        words = ["-k", "CASES=cases.tsv", "SHELLS=60", "THREADS=1", *WALL]
        planned = self.batch("-n", *words)
        self.assertEqual(planned.returncode, 0, planned.stderr)
        self.assertIn("tunica-simulate", planned.stdout)
        self.assertFalse((self.folder / "out").exists())
        done = self.batch(*words)
        self.assertEqual(done.returncode, 2, done.stderr)
        for name in ("p1/bladder", "p2/1"):
            self.assertTrue((self.folder / "out" / name / "result.hdf").is_file(), done.stdout + done.stderr)
        self.assertRegex(done.stdout, r"p3/4 +extract +3 .* has no voxel with label 4")
        again = self.batch(*[word for word in words if word != "-k"], "OUT=out", program=self.folder / "link")
        self.assertNotRegex(again.stdout, r"(?m)^p\d/\w+: simulate$")
        self.assertFalse(list(self.prefix.rglob("__pycache__")), "nothing is written where it is installed")

    def test_what_needs_the_source_is_refused(self):
        for goal in ("build", "check", "setup", "scene-liver"):
            done = self.batch(goal)
            self.assertEqual(done.returncode, 2)
            self.assertIn(f"{goal}: needs tunica's source", done.stderr)
        self.assertIn("VOLUMES LABELS IMAGED_AT POISSON THICKNESS not given", self.batch("-j2").stderr)
        self.assertIn("no such variable: PRESURE: did you mean PRESSURE?", self.batch("PRESURE=1kPa").stderr)

    def test_without_make(self):
        tools = self.folder / "few"
        tools.mkdir()
        for name in ("dirname", "readlink"):
            (tools / name).symlink_to(shutil.which(name))
        done = subprocess.run([self.prefix / "bin" / "tunica-batch", "-j2"], env={"PATH": str(tools)}, capture_output=True,
                              text=True, check=False)
        self.assertEqual((done.returncode, done.stderr), (1, "tunica-batch: needs make: install it\n"))


if __name__ == "__main__":
    unittest.main()
