#!/usr/bin/python3
"""What cmake --install leaves: every tool with a manual page and completions for three shells that know its flags, manual
pages of the files, and the library, against which the examples are built as somebody else's project."""

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
        return sorted(re.findall(r"(?m)^  (?:-\w, )?(--[\w-]+)", self.help_of(tool)))

    def pages(self):
        return sorted((self.prefix / "share" / "man").rglob("*.[157]"))

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

    def test_files_and_the_whole_have_manual_pages(self):
        if not shutil.which("lowdown"):
            self.skipTest("needs lowdown, which makes them from the pages of docs/")
        text = {page.name: page.read_text() for page in self.pages()}
        for name, words in (("tunica-scene.5", ["[[shell]]", "frequencies", "spectral_"]),
                            ("tunica-result.5", ["VTKHDF", "von_", "iterations"]),
                            ("tunica.7", ["Exit codes", "100mmHg", *self.tools])):
            plain = text[name].replace("\\-", "-")
            self.assertRegex(plain, rf"(?m)^\.SH NAME\n{name[:-2]} - \w")
            for word in words:
                self.assertIn(word, plain, name)

    def test_manual_pages_are_formatted_without_warnings(self):
        if not shutil.which("man") or not shutil.which("groff"):
            self.skipTest("needs man and groff")
        self.assertGreaterEqual(len(self.pages()), len(TOOLS))
        for page in self.pages():
            for width in ("80", "132"):
                run = subprocess.run(["man", "-l", "--warnings", page], capture_output=True, text=True,
                                     env={**os.environ, "MANWIDTH": width, "LC_ALL": "C.UTF-8"})
                self.assertEqual((run.returncode, run.stderr), (0, ""), page)
                self.assertIn("DESCRIPTION", run.stdout)
        broken = self.prefix / "broken.1"
        broken.write_text(".TH A 1\n.SH NAME\n.fx\n")
        run = subprocess.run(["man", "-l", "--warnings", broken], capture_output=True, text=True)
        self.assertIn("fx", run.stderr, "man shows no warnings, so this test shows nothing")

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

    def test_zsh_completion_knows_every_flag(self):
        if not shutil.which("zsh"):
            self.skipTest("needs zsh")
        for tool in self.tools:
            with self.subTest(tool):
                script = self.prefix / "share" / "zsh" / "site-functions" / ("_" + tool)
                # A shell of its own on a pseudo-terminal: what the key Tab lists, between two marks.
                typed = fr"""
                    zmodload zsh/zpty; zpty shell zsh -f
                    zpty -w shell 'PS1=; stty -echo columns 1000 rows 1000; fpath=({script.parent} $fpath); autoload -U compinit; compinit -D -u'
                    zpty -w shell 'zstyle ":completion:*" list-prompt ""; LISTMAX=1000; bindkey "^I" complete-word'
                    zpty -w shell 'list-all() {{ zle list-choices; zle kill-whole-line }}; zle -N list-all; bindkey "^T" list-all'
                    zpty -w shell 'print BEG""IN'
                    zpty -r shell line '*BEGIN*'
                    zpty -w -n shell '{tool} --'$'\x14'$'\n'
                    zpty -w shell 'print EN""D'
                    zpty -r shell line '*END*'; print -r -- "$line" """
                run = subprocess.run(["zsh", "-f", "-c", typed], capture_output=True, text=True, timeout=60)
                offered = set(re.findall(r"(?m)^ *(--[a-z][a-z-]*) +-- ", re.sub(r"\x1b\[[\d;?]*[a-zA-Z]", " ", run.stdout)))
                self.assertEqual(sorted(offered), self.flags_of(tool), run.stdout + run.stderr)

    def test_fish_completion_knows_every_flag(self):
        if not shutil.which("fish"):
            self.skipTest("needs fish")

        def offered(tool, words):
            script = self.prefix / "share" / "fish" / "vendor_completions.d" / (tool + ".fish")
            # "complete -C" asks for a command that there is.
            run = subprocess.run(["fish", "--no-config", "-c", f"source '{script}'; complete -C '{tool} {words}'"],
                                 capture_output=True, text=True, check=True, cwd=self.prefix / "share",
                                 env={**os.environ, "PATH": f"{self.prefix / 'bin'}:{os.environ['PATH']}"})
            self.assertEqual(run.stderr, "")
            return [line.split("\t")[0] for line in run.stdout.splitlines()]

        for tool in self.tools:
            with self.subTest(tool):
                self.assertEqual(sorted(offered(tool, "--")), self.flags_of(tool))
                self.assertIn("man/", offered(tool, "--report ma"))
        self.assertEqual(offered("tunica-simulate", "--solver "), ["auto", "cg", "direct"])
        self.assertEqual(offered("tunica-simulate", "--threads "), [])

    def test_nothing_installed_names_the_place_it_was_built_in(self):
        texts = [path for folder in ("lib", "include", "share") for path in (self.prefix / folder).rglob("*")
                 if path.suffix in (".cmake", ".pc", ".hpp")]
        self.assertGreater(len(texts), 40)
        for path in texts:
            text = path.read_text()
            for place in (os.environ["TUNICA_SOURCE"], os.environ["TUNICA_BUILD"], self.prefix.as_posix()):
                self.assertNotIn(place, text, path)
            if path.name == "tunicaTargets.cmake":
                # No place of a library or a header either, that another machine may have elsewhere.
                self.assertEqual(re.findall(r"[\";](/\w[^\";]*)", text), [])

    def check_consumer(self, program):
        run = subprocess.run([program], capture_output=True, text=True)
        self.assertRegex(run.stdout, r"^(x86-64-v3|x86-64|other) 0.1 MPa 6 mm2\n$")

    def test_a_consumer_by_cmake(self):
        cmake = os.environ["CMAKE"]
        build = self.prefix / "by-cmake"
        subprocess.run([cmake, "-S", Path(os.environ["TUNICA_SOURCE"]) / "tests" / "system" / "install" / "consumer", "-B", build,
                        f"-DCMAKE_PREFIX_PATH={self.prefix}"], check=True, capture_output=True)
        made = subprocess.run([cmake, "--build", build], capture_output=True, text=True)
        self.assertEqual(made.returncode, 0, made.stdout[-3000:])
        self.check_consumer(build / "consumer")

    def test_a_consumer_by_pkg_config(self):
        if not shutil.which("pkg-config"):
            self.skipTest("needs pkg-config")
        moved = self.prefix / "moved"  # its prefix is where the file lies
        shutil.copytree(self.prefix / "lib", moved / "lib")
        shutil.copytree(self.prefix / "include", moved / "include")
        environment = {**os.environ, "PKG_CONFIG_PATH": str(moved / "lib" / "pkgconfig")}
        flags = subprocess.run(["pkg-config", "--cflags", "--libs", "tunica"], capture_output=True, text=True, check=True,
                               env=environment).stdout.split()
        self.assertTrue(all(Path(flag[2:]).resolve().is_relative_to(moved.resolve()) for flag in flags if "moved" in flag))
        source = Path(os.environ["TUNICA_SOURCE"]) / "tests" / "system" / "install" / "consumer" / "consumer.cpp"
        program = self.prefix / "by-pkg-config"
        made = subprocess.run(["c++", "-std=c++20", source, "-o", program, *flags], capture_output=True, text=True)
        self.assertEqual(made.returncode, 0, made.stderr[-3000:])
        self.check_consumer(program)

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

        self.assertRegex(run("whole_chain"), r"^\d+ triangles, \d+ shells, certainly within 0\.\d+ mm; membrane stress 0\.02\d+ MPa \(mesh: \+- 0\.\d+ %\), ")
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
