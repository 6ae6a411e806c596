#!/usr/bin/python3
"""The pages of tunica-report in a browser, and the script they carry: built anew from web/ it has the same bytes."""

import atexit
import functools
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

import cases
from running import run_tool

SOURCE = pathlib.Path(os.environ["TUNICA_SOURCE"])
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@functools.cache
def with_packages():
    """A copy of web/ with the packages that its lock file names, once for all tests. @return its folder, and why there is none"""
    if not shutil.which("npm"):
        return None, "npm is not installed"
    folder = pathlib.Path(tempfile.mkdtemp(prefix="tunica-web-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    shutil.copytree(SOURCE / "web", folder / "web", ignore=shutil.ignore_patterns("node_modules", "dist"))
    done = subprocess.run(["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund"], cwd=folder / "web",
                          capture_output=True, text=True)
    if done.returncode != 0:
        if "E40" in done.stderr or "ENOTFOUND" in done.stderr or "EAI_AGAIN" in done.stderr or "ECONN" in done.stderr:
            return None, "npm reaches no registry"
        raise AssertionError(done.stderr)
    return folder, ""


class WithPackages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder, missing = with_packages()
        if missing:
            raise unittest.SkipTest(missing)
        cls.web = cls.folder / "web"


class Bundle(WithPackages):
    def test_built_anew_has_the_same_bytes(self):
        subprocess.run(["node", "build.mjs", self.folder / "dist"], cwd=self.web, check=True)
        built = {path.name: path.read_bytes() for path in (self.folder / "dist").iterdir()}
        kept = {path.name: path.read_bytes() for path in (SOURCE / "web" / "dist").iterdir()}
        self.assertEqual(set(built), set(kept))
        for name in kept:
            self.assertEqual(built[name] == kept[name], True, f"web/dist/{name}: run npm run build in web/")

    def test_bundle_fits_into_a_page(self):
        text = (SOURCE / "web" / "dist" / "report.js").read_text(encoding="ascii")
        for end in ("</script", "<!--", "eval(", "new Function", "import("):
            self.assertNotIn(end, text)
        self.assertIn("Permission is hereby granted", (SOURCE / "web" / "dist" / "LICENCES.txt").read_text())


@unittest.skipUnless(CHROMIUM, "chromium is not installed")
class Browser(WithPackages):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.case = cases.make_case(cls.folder)

    def look_at(self, out, scheme):
        page = self.folder / "page.html"
        run_tool("report", out, "-o", page, "--force", "--quiet")
        with tempfile.TemporaryDirectory(prefix="tunica-profile-") as profile:
            run = subprocess.run(["node", pathlib.Path(__file__).with_suffix(".mjs"), self.web, CHROMIUM, profile, scheme,
                                  page], capture_output=True, text=True, timeout=300)
        self.assertEqual(run.returncode, 0, run.stderr)
        seen = json.loads(run.stdout)
        self.assertEqual(seen["errors"], [])
        self.assertEqual(seen["requests"], [], "a page loads nothing")
        self.assertEqual(seen["violations"], [], "axe-core")
        for place in seen["middle"]:
            self.assertAlmostEqual(place, 0.5, delta=0.05, msg="what is drawn is in the middle of the canvas")
        self.assertEqual([name for name, changed in seen["changes"].items() if not changed], [])
        return seen

    def test_a_case_can_be_turned(self):
        for scheme in ("light", "dark"):
            seen = self.look_at(self.case, scheme)
            self.assertIn("Displacement", seen["legend"])
            self.assertIn("As imaged", seen["legend"])
            self.assertNotIn("solids", seen["changes"])

    def test_solids_and_all_states(self):
        with tempfile.TemporaryDirectory() as folder:
            case = cases.make_case(pathlib.Path(folder), "sphere")
            cases.add_solid(case)
            seen = self.look_at(case, "light")
        self.assertIn("solids", seen["changes"])
        self.assertEqual(seen["states"], ["As imaged", *(f"Load \u00d7 {part}" for part in (0.25, 0.5, 0.75)), "Loaded"])

    def test_cohort_sorts_and_filters(self):
        out = self.folder / "cohort"
        stresses = [0.03, 0.01, 0.02]
        for i, stress in enumerate(stresses):
            def change(reports, stress=stress):
                reports["simulate"]["result"]["wall"]["stress_p99_mpa"] = stress
            cases.copy_case(self.case, out, f"organ-{i:03}", change)

        def fail(reports):
            reports["simulate"].update(ok=False, error="no equilibrium <img src=x onerror=alert(1)>", result={})
        cases.copy_case(self.case, out, "<script>alert(1)<\u2215script>", fail)
        seen = self.look_at(out, "light")
        self.assertEqual(seen["rows"], ["", "30", "10", "20"], "the failed case first")
        self.assertEqual(seen["ascending"], ["ascending", ["10", "20", "30", ""]])
        self.assertEqual(seen["descending"], ["descending", ["30", "20", "10", ""]])
        self.assertEqual(seen["filtered"], [["10"], "1 of 4 cases"])
        self.assertEqual(seen["opened"], ["organ-001/1"])


if __name__ == "__main__":
    unittest.main()
