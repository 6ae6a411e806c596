"""What holds for every tool: words that are lost, two runs on one output, inputs that would be overwritten, and memory that
ends."""
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

BIN = os.environ["TUNICA_BIN"]
LOAD = ["--young", "1MPa", "--poisson", "0.3", "--thickness", "1mm", "--pressure", "1kPa", "--fix", "rigid-motions",
        "--static", "--load-steps", "2"]


def tool(verb):
    return os.path.join(BIN, "tunica-" + verb)


class WholeTools(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="tunica-tools-")
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        # One step of the chain each: what is read stays, what is written is new for every test.
        for command in (["phantom", "sphere", "ball.nii.gz", "--size", "24"],
                        ["extract", "ball.nii.gz", "surface.ply", "--label", "1", "--smooth", "staircase"],
                        ["decimate", "surface.ply", "coarse.ply", "--triangles", "200"],
                        ["relax", "coarse.ply", "surface.ply", "shell.ply", "--report", "relax.json",
                         "--tolerance", "2%", "--refine"]):
            subprocess.run([tool(command[0]), *command[1:]], cwd=cls.folder, check=True, capture_output=True)

    COMMANDS = {
        "phantom": (["sphere", "out.nii", "--size", "16"], "out.nii"),
        "extract": (["ball.nii.gz", "out.ply", "--label", "1"], "out.ply"),
        "decimate": (["surface.ply", "out.ply", "--triangles", "100"], "out.ply"),
        "relax": (["coarse.ply", "surface.ply", "out.ply", "--tolerance", "2%", "--refine", "--picture", "map.png",
                   "--verbose"], "out.ply"),
        "compare": (["coarse.ply", "surface.ply", "--map", "out.ply"], "out.ply"),
        "simulate": (["shell.ply", "out.hdf", *LOAD], "out.hdf"),
        "chart": (["relax.json", "--x", "result.iterations.seconds", "--y",
                   "result.iterations.hausdorff_percent.upper", "-o", "out.svg"], "out.svg"),
    }

    def setUp(self):
        for name in os.listdir(self.folder):
            if name.startswith(("out.", "map.", "report.")):
                os.remove(os.path.join(self.folder, name))

    def path(self, name):
        return os.path.join(self.folder, name)

    def bytes_of(self, name):
        with open(self.path(name), "rb") as file:
            return file.read()

    def report(self):
        with open(self.path("report.json"), encoding="utf-8") as file:
            return json.load(file)

    def run_shell(self, redirection, verb, *arguments):
        """The exit code with standard streams as a shell puts them."""
        program = ["bash", "-c", f'"$@" {redirection}', "bash", tool(verb), *arguments]
        return subprocess.run(program, cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                              check=False).returncode

    def test_lost_words_cost_nothing(self):
        for verb, (arguments, output) in self.COMMANDS.items():
            self.assertEqual(self.run_shell("", verb, *arguments, "--force"), 0, verb)
            size = os.path.getsize(self.path(output))
            for redirection in ("2>/dev/full", "2>&-", "0<&- 1>&- 2>&-", "2> >(exec true)"):
                for more in ([], ["--quiet"] if "--verbose" not in arguments else []):
                    words = [*arguments, *more, "--force", "--report", "report.json"]
                    self.assertEqual(self.run_shell(redirection, verb, *words), 0, (verb, redirection))
                    self.assertTrue(self.report()["ok"])
                    # As long as without, but for the command line that some files quote.
                    self.assertLess(abs(os.path.getsize(self.path(output)) - size), 4096, (verb, redirection))

    def test_lost_errors_keep_their_exit_code(self):
        for redirection in ("2>/dev/full", "2>&-", "1>&- 2>&-"):
            for verb in ("extract", "decimate", "compare"):
                words = {"extract": ["none.nii", "out.ply", "--label", "1"],
                         "decimate": ["none.ply", "out.ply", "--triangles", "9"],
                         "compare": ["none.ply", "none.ply"]}[verb]
                code = self.run_shell(redirection, verb, *words, "--force", "--report", "report.json")
                self.assertEqual(code, 3, (verb, redirection))
                self.assertFalse(self.report()["ok"])
                self.assertEqual(self.run_shell(redirection, verb, "--nonsense"), 2)

    def test_a_lost_answer_is_an_output_error(self):
        for redirection in (">/dev/full", ">&-", "> >(exec true; sleep 9)", "1</dev/null", ">&- 2>&-"):
            if "exec true" in redirection:
                redirection = "| true"  # the code is that of the tool by pipefail
            for verb, words in (("extract", ["ball.nii.gz", "--info"]), ("simulate", ["shell.ply", *LOAD, "--check"]),
                                ("relax", ["--help"]), ("relax", ["--version"])):
                if redirection == "| true":
                    # A reader that is gone for certain before anything is written.
                    reader, writer = os.pipe()
                    os.close(reader)
                    code = subprocess.run([tool(verb), *words], cwd=self.folder, stdout=writer,
                                          stderr=subprocess.DEVNULL, check=False).returncode
                    os.close(writer)
                else:
                    code = self.run_shell(redirection, verb, *words)
                self.assertEqual(code, 5, (verb, redirection))

    def test_a_second_run_on_one_output_is_refused(self):
        for verb in ("extract", "decimate", "relax", "simulate"):
            arguments, output = self.COMMANDS[verb]
            # The first is stopped with its output claimed, and goes on when the second is gone.
            first = subprocess.Popen([tool(verb), *arguments, "--force"], cwd=self.folder, stderr=subprocess.DEVNULL)
            limit = time.monotonic() + 60
            while not os.path.exists(self.path(output + ".part")) and first.poll() is None:
                self.assertLess(time.monotonic(), limit)
            first.send_signal(signal.SIGSTOP)
            if os.path.exists(self.path(output + ".part")):
                second = subprocess.run([tool(verb), *arguments, "--force"], cwd=self.folder, capture_output=True,
                                        text=True, check=False)
                self.assertEqual(second.returncode, 5, second.stderr)
                self.assertIn("another run is writing it", second.stderr)
            first.send_signal(signal.SIGCONT)
            self.assertEqual(first.wait(), 0)
            self.assertFalse(os.path.exists(self.path(output + ".part")))

    def test_many_runs_on_one_output(self):
        arguments, output = self.COMMANDS["decimate"]
        command = [tool("decimate"), *arguments, "--force", "--quiet"]
        subprocess.run(command, cwd=self.folder, check=True)
        whole = self.bytes_of(output)
        for _ in range(5):
            runs = [subprocess.Popen(command, cwd=self.folder, stderr=subprocess.DEVNULL) for _ in range(8)]
            codes = [run.wait() for run in runs]
            self.assertLessEqual(set(codes), {0, 5})
            self.assertIn(0, codes)
            self.assertEqual(self.bytes_of(output), whole)
            self.assertFalse(os.path.exists(self.path(output + ".part")))

    def test_inputs_are_never_outputs(self):
        for name in ("out.ply.part", "report.json.part"):
            shutil.copy(self.path("surface.ply"), self.path(name))
            for verb, words in (("decimate", [name, "out.ply", "--triangles", "100"]),
                                ("relax", ["coarse.ply", name, "out.ply", "--tolerance", "2%"]),
                                ("compare", ["coarse.ply", name, "--map", "out.ply"])):
                words += ["--force", "--report", "report.json"]
                self.assertEqual(self.run_shell("", verb, *words), 2, (verb, name))
                self.assertEqual(self.bytes_of(name), self.bytes_of("surface.ply"))
            os.remove(self.path(name))

    def test_a_part_that_is_no_file_of_its_own(self):
        for verb, (arguments, output) in self.COMMANDS.items():
            part = self.path(output + ".part")
            for make in (os.mkfifo, lambda path: os.symlink(self.path("out.elsewhere"), path)):
                make(part)
                done = subprocess.run([tool(verb), *arguments, "--force"], cwd=self.folder, capture_output=True, text=True,
                                      timeout=60, check=False)
                self.assertEqual(done.returncode, 5, (verb, done.stderr))
                self.assertIn(output + ".part: is a", done.stderr)
                self.assertFalse(os.path.exists(self.path("out.elsewhere")))
                os.remove(part)

    def test_memory_that_ends_has_a_code_of_its_own(self):
        """Address space from what the program needs to start to what it needs: done or exit code 6, nothing else."""
        for verb, (arguments, output) in self.COMMANDS.items():
            ended = 0
            for mebibytes in range(60, 1500, 20):
                def limit(bytes_=mebibytes << 20):
                    resource.setrlimit(resource.RLIMIT_AS, (bytes_, bytes_))

                start = subprocess.run([tool(verb), "--version"], preexec_fn=limit, capture_output=True, check=False)
                if start.returncode != 0:
                    continue  # the system could not load it
                done = subprocess.run([tool(verb), *arguments, "--force", "--threads", "2", "--report", "report.json"],
                                      cwd=self.folder, capture_output=True, text=True, preexec_fn=limit, check=False)
                if done.returncode == 0:
                    break
                ended += 1
                self.assertEqual(done.returncode, 6, (verb, mebibytes, done.stderr))
                error = [line for line in done.stderr.splitlines() if "memory" in line]
                self.assertRegex(error[-1] if error else "", rf"^tunica-{verb}: .*memory.*limit {mebibytes} MiB")
                self.assertFalse(self.report()["ok"])
                self.assertFalse(os.path.exists(self.path(output + ".part")), verb)
                self.assertIsNone(re.search("OpenCV|HDF5|terminate|BLAS", done.stderr), done.stderr)
            self.assertEqual(done.returncode, 0, verb)

    def test_memory_that_does_not_do_to_start_is_said_as_well(self):
        """The first mebibytes above what the system needs to load the program: done or exit code 6, nothing else."""
        for verb, (arguments, _) in self.COMMANDS.items():
            def run(kibibytes, words):
                def limit():
                    resource.setrlimit(resource.RLIMIT_AS, (kibibytes << 10, kibibytes << 10))
                return subprocess.run([tool(verb), *words], cwd=self.folder, capture_output=True, text=True,
                                      preexec_fn=limit, check=False)

            loaded = next(k for k in range(4 << 10, 1 << 20, 1 << 9) if run(k, ["--version"]).returncode == 0)
            # Half a mebibyte more, for libraries make objects before main().
            for kibibytes in range(loaded + (1 << 9), loaded + (5 << 10), 1 << 8):
                done = run(kibibytes, [*arguments, "--force"])
                self.assertIn(done.returncode, (0, 6), (verb, kibibytes, done.stderr))
                self.assertNotIn("terminate", done.stderr)


if __name__ == "__main__":
    unittest.main()
