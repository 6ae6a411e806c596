#!/usr/bin/env python3
"""examples/Snakefile: what it plans for a table of cases, and one case done. Skipped where Snakemake is not installed."""

import os
import shutil
import subprocess
import sys
import unittest

import cohort
from pipeline_test import STAGES
from running import BIN, SOURCE, ToolTest, built

WALL = ("poisson=0.45",)


@unittest.skipUnless(shutil.which("snakemake"), "Snakemake is not installed")
@unittest.skipUnless(built(*STAGES, "phantom"), "the tools are not built")
class Snakefile(ToolTest):
    def setUp(self):
        super().setUp()
        for name in ("my organ", "other"):
            cohort.phantom(self.folder / f"{name}.nii.gz", "sphere", 16)
        (self.folder / "my organ.tsv").write_text("index\tname\n1\tthe organ\n")
        (self.folder / "cases.tsv").write_text("case\tvolume\tlabel\timaged_at\tthickness\n"
                                               "p1\tmy organ.nii.gz\tthe organ\t0.2kPa\t1.5mm\np2\tother.nii.gz\t1\t1kPa\t1mm\n")

    def snakemake(self, *words):
        environment = dict(os.environ, HOME=str(self.folder), XDG_CACHE_HOME=str(self.folder))
        return subprocess.run(["snakemake", "-s", SOURCE / "examples" / "Snakefile", "-j1", *words, "--config", f"bin={BIN}",
                               *WALL], cwd=self.folder, env=environment, capture_output=True, text=True, check=False)

    def test_plans_every_stage_of_every_case(self):
        done = self.snakemake("-n")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        for stage in STAGES:
            self.assertRegex(done.stdout, rf"(?m)^{stage} +2\b")
        self.assertFalse((self.folder / "out").exists())

    def test_does_a_case_and_then_no_more(self):
        done = self.snakemake("out/p1/result.hdf")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertEqual((self.folder / "out" / "p1" / "result.hdf").read_bytes()[:4], b"\x89HDF")
        again = self.snakemake("out/p1/result.hdf")
        self.assertIn("Nothing to be done", again.stdout + again.stderr)

    def test_ends_with_a_report(self):
        done = self.snakemake("report.html")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("p2", (self.folder / "report.html").read_text())


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + ["-v"] + sys.argv[1:])
