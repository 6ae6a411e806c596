"""What holds for every tool: words that are lost, two runs on one output, inputs that would be overwritten, and memory that
ends."""
import fcntl
import json
import os
import re
import resource
import shutil
import struct
import subprocess
import tempfile
import unittest

from running import command, run_tool, start_tool

LOAD = ["--young", "1MPa", "--poisson", "0.3", "--thickness", "1mm", "--pressure", "1kPa", "--fix", "rigid-motions",
        "--static", "--load-steps", "2"]


class WholeTools(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="tunica-tools-")
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        # One step of the chain each: what is read stays, what is written is new for every test.
        for words in (["phantom", "sphere", "ball.nii.gz", "--size", "16"],
                      ["extract", "ball.nii.gz", "surface.ply", "--label", "1", "--smooth", "staircase"],
                      ["decimate", "surface.ply", "coarse.ply", "--triangles", "100"]):
            run_tool(*words, folder=cls.folder)
        run_tool("relax", "coarse.ply", "surface.ply", "shell.ply", "--tolerance", "2%", "--refine", folder=cls.folder, report="relax.json")

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

    def run_tool(self, *words, report=False, **options):
        """run_tool() in the folder of all tests"""
        return run_tool(*words, folder=self.folder, report=report, **options)

    def run_shell(self, redirection, verb, *arguments):
        """The exit code with standard streams as a shell puts them."""
        words = ["bash", "-c", f'"$@" {redirection}', "bash", *command(verb, *arguments)]
        return subprocess.run(words, cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
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
                    code = subprocess.run(command(verb, *words), cwd=self.folder, stdout=writer, stderr=subprocess.DEVNULL,
                                          check=False).returncode
                    os.close(writer)
                else:
                    code = self.run_shell(redirection, verb, *words)
                self.assertEqual(code, 5, (verb, redirection))

    def test_help_has_the_tools_own_options_first(self):
        for verb in self.COMMANDS:
            with self.subTest(verb):
                text = self.run_tool(verb, "-h").stdout
                self.assertEqual(text, self.run_tool(verb, "--help").stdout)
                headings = re.findall(r"(?m)^([A-Z][^\n]*):$", text)
                self.assertEqual(headings[-2:], ["Options of every tool", "Example"])
                self.assertEqual(len(headings), len(set(headings)))
                self.assertGreaterEqual(len(headings), 4 if verb != "phantom" else 3)
                self.assertNotIn("\n\n\n", text)
                lines = text[:text.index("\nExample:")].splitlines()
                self.assertEqual([line for line in lines if len(line) > 80 or line.endswith(" ")], [])
                self.assertNotRegex(text, r":{|\(\d*x\)")
                common = text[text.index("Options of every tool:"):]
                for flag in ("--help", "--version", "--report", "--threads", "--quiet", "--verbose", "--force"):
                    self.assertEqual((flag in common, text.count(f"{flag} ") - common.count(f"{flag} ")), (True, 0), flag)

    def test_version_says_which_instructions_run(self):
        for verb in self.COMMANDS:
            self.assertRegex(self.run_tool(verb, "--version").stdout, rf"^tunica-{verb} \d+\.\d+\.\d+ \((x86-64|x86-64-v3|other)\)\n$")

    def test_a_bare_call_shows_the_short_usage(self):
        for verb in self.COMMANDS:
            run = self.run_tool(verb, code=2)
            self.assertEqual(run.stdout, "", verb)
            self.assertRegex(run.stderr, rf"^tunica-{verb}: usage: tunica-{verb} \[OPTIONS\] \S+.*\n$")

    def test_a_mistyped_flag_gets_the_nearest_one(self):
        for verb, flag, meant in (("relax", "--tolerence=1%", "--tolerance"), ("simulate", "--presure", "--pressure"),
                                  ("decimate", "--triangle", "--triangles"), ("extract", "--fill-cavites", "--fill-cavities")):
            self.run_tool(verb, *self.COMMANDS[verb][0], flag, code=2, says=f"did you mean {meant}?")
        self.assertNotIn("did you mean", self.run_tool("relax", "--nonsense", code=2).stderr)

    def test_report_on_standard_output(self):
        for verb, (arguments, output) in self.COMMANDS.items():
            with self.subTest(verb):
                report = json.loads(self.run_tool(verb, *arguments, "--report", "-").stdout)
                self.assertEqual((report["ok"], report["tool"]), (True, "tunica-" + verb))
                self.assertTrue(report["inputs"] or verb == "phantom")
                self.assertFalse(os.path.exists(self.path("-")))
                self.setUp()
        for code, words, says in ((3, ["relax", "none.ply", "surface.ply", "out.ply"], "none.ply"), (2, ["relax", "--nonsense"], "--nonsense"),
                                  (2, ["extract", "ball.nii.gz", "--info"], "leaves standard output to the report")):
            run = self.run_tool(*words, "--report", "-", code=code, says=says)
            self.assertFalse(json.loads(run.stdout)["ok"])
        self.assertEqual(self.run_shell(">/dev/full", "decimate", *self.COMMANDS["decimate"][0], "--report", "-"), 5)
        self.assertTrue(os.path.exists(self.path("out.ply")))

    def test_a_second_run_on_one_output_is_refused(self):
        for verb, (arguments, output) in self.COMMANDS.items():
            with self.subTest(verb), open(self.path(output + ".part"), "wb") as part:
                # What a run that writes this output does before it works.
                fcntl.lockf(part, fcntl.LOCK_EX)
                self.run_tool(verb, *arguments, "--force", code=5, says="another run is writing it")
                self.assertTrue(os.path.exists(self.path(output + ".part")))
                self.assertFalse(os.path.exists(self.path(output)))

    def test_many_runs_on_one_output(self):
        arguments, output = self.COMMANDS["decimate"]
        words = ["decimate", *arguments, "--force", "--quiet"]
        self.run_tool(*words)
        whole = self.bytes_of(output)
        for _ in range(5):
            runs = [start_tool(*words, folder=self.folder) for _ in range(8)]
            codes = [run.communicate() and run.returncode for run in runs]
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
                self.run_tool(verb, *arguments, "--force", code=5, says=output + ".part: is a")
                self.assertFalse(os.path.exists(self.path("out.elsewhere")))
                os.remove(part)

    def test_a_small_file_that_promises_much_costs_little(self):
        many = 4_000_000_000
        scene = json.dumps({
            "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}] * 9}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": many, "type": "VEC3"},
                          {"componentType": 5125, "count": many, "type": "SCALAR", "sparse": {"count": many}}],
            "bufferViews": [{"buffer": 0, "byteLength": many, "byteStride": 4}],
            "buffers": [{"byteLength": many}]}).encode()
        scene += b" " * (-len(scene) % 4)
        glb = (b"glTF" + struct.pack("<II", 2, 28 + len(scene) + 64) + struct.pack("<I", len(scene)) + b"JSON" + scene +
               struct.pack("<I", 64) + b"BIN\0" + bytes(64))
        ply = (f"ply\nformat {{}}\ncomment units mm\nelement vertex {many}\nproperty double x\nproperty double y\n"
               f"property double z\nelement face {many}\nproperty list uint int vertex_indices\nend_header\n")
        nifti = bytearray(352)
        struct.pack_into("<i", nifti, 0, 348)
        struct.pack_into("<8h", nifti, 40, 3, 30000, 30000, 30000, 1, 1, 1, 1)
        struct.pack_into("<hh", nifti, 70, 2, 8)
        struct.pack_into("<8f", nifti, 76, *[1] * 8)
        struct.pack_into("<f", nifti, 108, 352)
        nifti[344:348] = b"n+1\0"
        side = " ".join(["100000"] * 3)
        files = {
            "h.glb": glb, "h.ply": ply.format("binary_little_endian 1.0").encode() + bytes(60),
            "a.ply": ply.format("ascii 1.0").encode() + b"0 0 0\n",
            "h.stl": bytes(80) + struct.pack("<I", many) + bytes(50), "h.off": f"OFF\n{many} {many} 0\n0 0 0\n".encode(),
            "h.obj": f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 {many}\n".encode(), "h.nii": bytes(nifti) + bytes(99),
            "h.nrrd": f"NRRD0004\ntype: uchar\ndimension: 3\nsizes: {side}\nencoding: raw\n\n".encode() + bytes(99),
            "h.mha": (f"ObjectType = Image\nNDims = 3\nDimSize = {side}\nElementType = MET_UCHAR\n"
                      "ElementDataFile = LOCAL\n").encode() + bytes(99)}

        for name, data in files.items():
            with open(self.path(name), "wb") as file:
                file.write(data)
            words = (["extract", name, "out.ply", "--label", "1"] if name[2:] in ("nii", "nrrd", "mha") else
                     ["decimate", name, "out.ply", "--triangles", "4", "--mesh-unit", "mm"])
            self.run_tool(*words, "--threads", "1", code=3, says=name, limits={resource.RLIMIT_AS: 600 << 20, resource.RLIMIT_CPU: 5})

    def within(self, most, verb, *words):
        """Runs a tool, which may not even start, within so many bytes of addresses."""
        return subprocess.run(command(verb, *words), cwd=self.folder, capture_output=True, text=True, check=False,
                              preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (most, most)))

    def test_memory_that_ends_has_a_code_of_its_own(self):
        """Address space from what the program needs to start to what it needs: done or exit code 6, nothing else."""
        for verb, (arguments, output) in self.COMMANDS.items():
            ended = 0
            for mebibytes in range(60, 1500, 20):
                if self.within(mebibytes << 20, verb, "--version").returncode != 0:
                    continue  # the system could not load it
                done = self.within(mebibytes << 20, verb, *arguments, "--force", "--threads", "2", "--report", "report.json")
                if done.returncode == 0:
                    break
                ended += 1
                self.assertEqual(done.returncode, 6, (verb, mebibytes, done.stderr))
                error = [line for line in done.stderr.splitlines() if "memory" in line]
                if error == [f"tunica-{verb}: out of memory: give it more, or a smaller input"]:
                    continue  # it ended before the options were known, and with them the report
                self.assertRegex(error[-1] if error else "", rf"^tunica-{verb}: .*memory.*limit {mebibytes} MiB")
                self.assertFalse(self.report()["ok"])
                self.assertFalse(os.path.exists(self.path(output + ".part")), verb)
                self.assertIsNone(re.search("OpenCV|HDF5|terminate|BLAS", done.stderr), done.stderr)
            self.assertEqual(done.returncode, 0, verb)

    def test_memory_that_does_not_do_to_start_is_said_as_well(self):
        """The first mebibytes above what the system needs to load the program: done or exit code 6, nothing else."""
        for verb, (arguments, _) in self.COMMANDS.items():
            loaded = next(k for k in range(4 << 10, 1 << 20, 1 << 9) if self.within(k << 10, verb, "--version").returncode == 0)
            # A mebibyte more, for libraries make objects before main(), and not the same amount each time.
            for kibibytes in range(loaded + (1 << 10), loaded + (5 << 10), 1 << 8):
                done = self.within(kibibytes << 10, verb, *arguments, "--force")
                self.assertIn(done.returncode, (0, 6), (verb, kibibytes, done.stderr))
                self.assertNotIn("terminate", done.stderr)

    def every_command(self):
        """As COMMANDS, with the one tool that reads a folder."""
        os.makedirs(self.path("cases/ball/1"), exist_ok=True)
        for name in ("relax.json", "shell.ply"):
            shutil.copy(self.path(name), self.path("cases/ball/1"))
        return {**self.COMMANDS, "report": (["cases", "-o", "out.html"], "out.html")}

    def test_a_report_that_no_descriptor_is_left_for(self):
        """ulimit -n 4: told before the work."""
        for verb, (arguments, output) in self.every_command().items():
            done = self.run_tool(verb, *arguments, "--report", "report.json", code=5, limits={resource.RLIMIT_NOFILE: 4})
            self.assertEqual(done.stderr, f"tunica-{verb}: report.json: cannot be written: Too many open files: allow more "
                                          "(ulimit -n)\n")
            self.assertFalse([name for name in os.listdir(self.folder) if name.startswith(("report.json", output))])

    def test_a_limit_of_open_files_is_named(self):
        """ulimit -n 4: an input that cannot be opened for that is not called a bad one."""
        for verb in ("extract", "decimate"):
            arguments, output = self.COMMANDS[verb]
            self.run_tool(verb, *arguments, "--force", code=6, limits={resource.RLIMIT_NOFILE: 4},
                          says="cannot be read: Too many open files: allow more (ulimit -n)")

    def test_a_small_stack_does(self):
        for verb, (arguments, output) in self.every_command().items():
            small = {resource.RLIMIT_STACK: 64 << 10}
            self.run_tool(verb, *arguments, "--force", report=True, limits=small)
            self.assertTrue(os.path.getsize(self.path(output)))
            self.run_tool(verb, "--help", limits=small)
            self.run_tool(verb, "--nonsense", code=2, limits=small)

    def test_two_hyphens_end_the_options(self):
        files = {"phantom": 2, "extract": 2, "decimate": 2, "relax": 3, "compare": 2, "simulate": 2, "chart": 1, "report": 1}
        for verb, (arguments, output) in self.every_command().items():
            count = files[verb]
            self.run_tool(verb, *arguments[count:], "--force", "--", *arguments[:count], report=True)
            self.assertTrue(os.path.getsize(self.path(output)))
            done = self.run_tool(verb, "--", *arguments[:count], "--report", "r.json", code=range(7))
            if done.returncode == 2:  # else the words were taken as files
                self.assertRegex(done.stderr, "after (that|--) every word is a file|is required", verb)
            # What stands behind them is a name, also where it is that of an option.
            for name in ("--report", "--no-paths", "--help", "--version"):
                done = self.run_tool(verb, "--", name, "a", "b", "c", code=(2, 3))
                self.assertEqual((done.stdout, os.path.exists(self.path("a"))), ("", False), (verb, name))


if __name__ == "__main__":
    unittest.main()
