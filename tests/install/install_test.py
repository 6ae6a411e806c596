#!/usr/bin/python3
"""What cmake --install leaves: every tool, and for each a manual page and a bash completion that know its flags."""

import os
import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

TOOLS = ["phantom", "extract", "decimate", "relax", "compare", "simulate", "chart"]
SECTIONS = ["NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "EXIT STATUS", "FILES", "ENVIRONMENT", "EXAMPLE"]


def complete(script, tool, *words):
    """What bash offers for the last word."""
    function = "_" + tool.replace("-", "_")
    lines = [f". {script}", "COMP_WORDS=(" + " ".join(f"'{word}'" for word in (tool,) + words) + ")",
             f"COMP_CWORD={len(words)}", function, 'printf "%s\\n" "${COMPREPLY[@]}"']
    run = subprocess.run(["bash", "-c", "\n".join(lines)], capture_output=True, text=True, check=True)
    assert run.stderr == "", run.stderr
    return [line for line in run.stdout.split("\n") if line]


class Installed(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="tunica-test-")
        cls.addClassCleanup(folder.cleanup)
        cls.prefix = Path(folder.name)
        subprocess.run([os.environ["CMAKE"], "--install", os.environ["TUNICA_BUILD"], "--prefix", folder.name],
                       check=True, capture_output=True)
        cls.tools = sorted(path.name for path in (cls.prefix / "bin").iterdir())

    def help_of(self, tool):
        run = subprocess.run([self.prefix / "bin" / tool, "--help"], capture_output=True, text=True, check=True)
        return run.stdout

    def flags_of(self, tool):
        names = [name for line in re.findall(r"(?m)^  (-\S+)", self.help_of(tool)) for name in line.split(",")]
        return sorted(name for name in names if name.startswith("--"))

    def page(self, tool):
        return self.prefix / "share" / "man" / "man1" / (tool + ".1")

    def completion(self, tool):
        return self.prefix / "share" / "bash-completion" / "completions" / tool

    def test_bin_holds_every_tool(self):
        self.assertEqual(self.tools, sorted("tunica-" + verb for verb in TOOLS))

    def test_every_tool_has_a_manual_page_with_its_flags(self):
        for tool in self.tools:
            with self.subTest(tool):
                text = self.page(tool).read_text()
                self.assertEqual(re.findall(r"(?m)^\.SH (.*)$", text), SECTIONS)
                plain = text.replace("\\-", "-")
                self.assertGreaterEqual(len(self.flags_of(tool)), 7)
                for flag in self.flags_of(tool):
                    self.assertIn(f"\\fB{flag}\\fR", plain)
                self.assertRegex(plain, rf"(?m)^{tool} - \w")
                self.assertIn(tool, plain.split(".SH EXAMPLE")[1])

    def test_manual_pages_are_formatted_without_warnings(self):
        groff = shutil.which("groff")
        if not groff:
            self.skipTest("needs groff")
        for tool in self.tools:
            run = subprocess.run([groff, "-man", "-ww", "-Kutf8", "-Tutf8", self.page(tool)], capture_output=True,
                                 text=True)
            if "can't find" in run.stderr or "cannot load" in run.stderr:
                self.skipTest("this groff has no man macros: " + run.stderr.split("\n")[0])
            self.assertEqual((run.returncode, run.stderr), (0, ""), tool)
            self.assertIn("EXIT STATUS", re.sub(r"\x1b\[[\d;]*m|.\x08", "", run.stdout))

    def test_completion_knows_every_flag(self):
        for tool in self.tools:
            with self.subTest(tool):
                offered = complete(self.completion(tool), tool, "--")
                self.assertEqual(sorted(o for o in offered if o.startswith("--")), self.flags_of(tool))

    def test_completion_of_values_and_files(self):
        for tool in self.tools:
            script = self.completion(tool)
            self.assertIn("--report", complete(script, tool, "--repo"))
            self.assertIn(str(script), complete(script, tool, str(script)[:-2]))
            self.assertIn(str(script), complete(script, tool, "--report", str(script)[:-2]))
            self.assertIn(str(script), complete(script, tool, "--report", "=", str(script)[:-2]))
            self.assertEqual(complete(script, tool, "--threads", ""), [])
        chart = self.completion("tunica-chart")
        self.assertEqual(complete(chart, "tunica-chart", "--x-scale", ""), ["auto", "linear", "log"])
        self.assertEqual(complete(chart, "tunica-chart", "--x-scale", "=", "li"), ["linear"])
        simulate = self.completion("tunica-simulate")
        self.assertIn("comas", complete(simulate, "tunica-simulate", "--bending", "com"))
        self.assertEqual(complete(simulate, "tunica-simulate", "--solver", "d"), ["direct"])


if __name__ == "__main__":
    unittest.main()
