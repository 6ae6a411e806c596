#!/usr/bin/python3
"""What cmake --install leaves: every tool with a manual page and a bash completion that know its flags, and the library,
against which the examples are built as somebody else's project."""

import os
import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

TOOLS = ["phantom", "extract", "decimate", "relax", "compare", "simulate", "chart", "report"]
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
        cls.programs = sorted(path.name for path in (cls.prefix / "bin").iterdir())
        cls.tools = [name for name in cls.programs if name != "tunica-batch"]

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
        self.assertEqual(self.programs, sorted("tunica-" + verb for verb in TOOLS + ["batch"]))

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
        for tool in self.programs:
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

    def test_examples_are_built_and_run_against_the_package(self):
        build = self.prefix / "examples"
        cmake = os.environ["CMAKE"]
        subprocess.run([cmake, "-S", Path(os.environ["TUNICA_SOURCE"]) / "examples", "-B", build,
                        f"-DCMAKE_PREFIX_PATH={self.prefix}", "-DCMAKE_BUILD_TYPE=Debug"], check=True, capture_output=True)
        made = subprocess.run([cmake, "--build", build, "--parallel", "2"], capture_output=True, text=True)
        self.assertEqual(made.returncode, 0, made.stdout[-4000:])

        def run(name, *arguments):
            done = subprocess.run([build / name, *arguments], capture_output=True, text=True)
            self.assertEqual((done.returncode, done.stderr), (0, ""), name)
            return done.stdout

        self.assertRegex(run("extract_and_fit"), r"^\d+ shells, certainly within \d+\.\d+ mm of \d+ triangles\n$")
        self.assertIn("by Laplace's law 0.017", run("wall_stress"))
        for name, height in (("a", 0), ("b", 2)):
            (self.prefix / f"{name}.off").write_text(f"OFF\n3 1 0\n0 0 {height}\n1 0 {height}\n0 1 {height}\n3 0 1 2\n")
        lower, upper = map(float, re.match(r"(\S+) to (\S+) mm", run("certified_distance", self.prefix / "a.off",
                                                                     self.prefix / "b.off")).groups())
        self.assertLessEqual(lower, 2)
        self.assertGreaterEqual(upper, 2)
        self.assertLess(upper - lower, 0.001)

    def test_installed_headers_need_nothing_else(self):
        """Each public header compiles alone, from the installed ones only."""
        headers = sorted(path.relative_to(self.prefix / "include") for path in (self.prefix / "include").rglob("*.hpp"))
        self.assertGreater(len(headers), 40)
        self.assertEqual([header for header in headers if "detail" in header.parts or "cli" in header.parts], [])
        source = self.prefix / "all.cpp"
        source.write_text("".join(f"#include <{header}>\n" for header in headers) + "int main() {}\n")
        made = subprocess.run(["c++", "-std=c++20", "-fsyntax-only", "-isystem", "/usr/include/eigen3",
                               "-I", self.prefix / "include", source], capture_output=True, text=True)
        self.assertEqual(made.returncode, 0, made.stderr[:3000])


if __name__ == "__main__":
    unittest.main()
