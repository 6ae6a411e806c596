"""--memory-limit of every tool: what needs more ends with exit code 6 in one line, with a report and without outputs; what
needs less is as without a limit; what is no amount of memory is refused."""
import pathlib
import shutil
import tempfile
import unittest

import disk_test
from disk_test import COMMANDS
from running import run_tool


class MemoryLimit(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="tunica-memory-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        disk_test.make_inputs(cls.folder)

    def setUp(self):
        shutil.rmtree(self.folder / "disk", ignore_errors=True)
        (self.folder / "disk").mkdir()

    def run_command(self, verb, *more, **options):
        return run_tool(verb, *COMMANDS[verb][0], "--quiet", "--force", "--threads", 2, *more, folder=self.folder, **options)

    def outputs(self):
        return {path.name: path.read_bytes() for path in (self.folder / "disk").iterdir()}

    def test_too_little_ends_with_6_and_enough_changes_nothing(self):
        """Limits from nothing to what is needed: done or exit code 6, nothing else."""
        for verb in COMMANDS:
            self.run_command(verb)
            whole = self.outputs()
            self.setUp()
            ended = 0
            for mebibytes in (0.01, 1, 3, 6, *range(10, 600, 24)):
                with self.subTest(verb=verb, mebibytes=mebibytes):
                    done = self.run_command(verb, "--memory-limit", f"{mebibytes}MiB", code=(0, 6))
                    if done.returncode == 0:
                        break
                    ended += 1
                    self.assertRegex(done.stderr, rf"^tunica-{verb}: [^\n]*memory[^\n]*limit {mebibytes}MiB by "
                                                  rf"--memory-limit, at most \d+ MiB were in use, the program itself among "
                                                  r"them\)\n$")
                    for name, data in self.outputs().items():  # whole states, and what a run can go on with
                        self.assertTrue(".part" in name or data == whole.get(name), name)
            self.assertEqual(done.returncode, 0, verb)
            self.assertGreater(ended, 2, verb)
            found = self.outputs()
            self.assertEqual(set(found), set(whole))
            for name in whole:
                if not name.endswith((".html", ".csv")):  # which tell the whole command
                    self.assertEqual(found[name], whole[name], f"{verb}: {name}")
            self.setUp()

    def test_a_volume_too_large_for_the_limit(self):
        volume = self.folder / "large.nii"
        run_tool("phantom", "sphere", volume, "--size", 256, "--quiet", "--force")
        run_tool("extract", volume, "disk/out.ply", "--label", 1, "--memory-limit", "16MB", "--force", folder=self.folder, code=6,
                 says=[f"tunica-extract: {volume}: out of memory: give it more, or a smaller input (stage ",
                       "limit 16MB by --memory-limit"])
        self.assertEqual(self.outputs(), {})

    def test_what_is_no_amount_of_memory(self):
        for verb in COMMANDS:
            for text in ("4", "0GB", "-1GB", "4 gigabytes", "GB", "", "1e30GB", "nanMB", "4Gb", "0x4GB", "1GB2", "0.1B"):
                self.run_command(verb, f"--memory-limit={text}", code=2, says="--memory-limit")
            self.run_command(verb, "--memory-limit", code=2)
            self.run_command(verb, "--memory-limit", "1GB", "--memory-limit", "2GB", code=2)
            self.assertEqual(self.outputs(), {})

    def test_every_unit_of_memory_is_understood(self):
        for text in ("2GB", "2.5 GB", "1GiB", "900000kB", "900000KiB", "1TB", "1TiB", "1e3MB", "1500000000B", "99999TB"):
            self.run_command("decimate", "--memory-limit", text)

    def test_every_tool_tells_of_it(self):
        for verb in COMMANDS:
            self.assertIn("--memory-limit SIZE", run_tool(verb, "--help", report=False).stdout)
            for kind in ("man", "bash", "zsh", "fish"):
                text = run_tool(verb, "--documentation", kind, report=False).stdout
                self.assertIn("memory-limit", text.replace("\\", ""), (verb, kind))


if __name__ == "__main__":
    unittest.main()
