"""Tools that are stopped end within seconds, whatever they are at, and leave no output that looks finished.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/system/cli/stopping_test.py [CLASS]
"""
import json
import os
import pathlib
import resource
import signal
import time
import unittest

import meshes
from running import ToolTest

BOUND = 10  # s of the processor: a busy machine does not matter; usual is less than one
LOAD = ["--young", "1MPa", "--poisson", "0.3", "--thickness", "1mm", "--pressure", "1kPa"]


def worked():
    """Seconds of the processor of all children that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


class Stopping(ToolTest):
    def setUp(self):
        super().setUp()
        meshes.write_ply(self.folder / "fine.ply", *meshes.sphere(6, 40.0), comments=["units mm"])
        meshes.write_ply(self.folder / "coarse.ply", *meshes.sphere(3, 40.0), comments=["units mm"])

    def stop(self, number, after, verb, *words):
        """@return what was said; nothing when the run was done before"""
        running = self.start_tool(verb, *words, "--quiet", "--report", "report.json", "--force")
        earlier = worked()
        time.sleep(after)
        fields = pathlib.Path(f"/proc/{running.pid}/stat").read_text().rsplit(")", 1)[1].split()
        before = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        running.send_signal(number)
        error = running.communicate(timeout=300)[1]
        late = worked() - earlier - before
        if running.returncode in (0, -number):  # done, or stopped before it could notice
            return None
        self.assertEqual(running.returncode, 128 + number, error)
        self.assertLess(late, BOUND, (verb, after))
        self.assertIn(f"stopped by signal {number}", error)
        with open(self.folder / "report.json") as file:
            report = json.load(file)
        self.assertIs(report["ok"], False)
        self.assertIn(f"stopped by signal {number}", report["error"])
        return error

    def test_tools_of_meshes_end_at_once_without_an_output(self):
        for verb, words in (("decimate", ["fine.ply", "out.ply", "--triangles", "500"]),
                            ("relax", ["coarse.ply", "fine.ply", "out.ply"]),
                            ("compare", ["fine.ply", "coarse.ply", "--map", "out.ply"])):
            for number, after in ((signal.SIGTERM, 0.3), (signal.SIGINT, 0.8), (signal.SIGTERM, 2)):
                with self.subTest(verb=verb, after=after):
                    if self.stop(number, after, verb, *words):
                        self.assertFalse((self.folder / "out.ply").exists())
                    (self.folder / "out.ply").unlink(missing_ok=True)

    def test_tools_of_volumes_end_at_once_without_an_output(self):
        for number, after in ((signal.SIGTERM, 0.2), (signal.SIGINT, 0.7)):
            self.stop(number, after, "phantom", "aneurysm", "out.nii.gz", "--size", "400")
            self.assertEqual([path.name for path in self.folder.glob("out.nii.gz.part")], [])

    def test_interrupted_run_is_not_lost(self):
        """It names how to go on; another run to its name is refused; its own report does not keep it from going on."""
        words = ["coarse.ply", "out.hdf", *LOAD, "--fix", "below z=-30mm", "--density", "1g/cm3", "--duration", "10s",
                 "--step", "5ms", "--report", "run.json"]
        self.run_tool("relax", "coarse.ply", "coarse.ply", "shell.ply")
        words[0] = "shell.ply"
        running = self.start_tool("simulate", *words, "--quiet")
        limit = time.monotonic() + 120
        checkpoint = self.folder / "out.hdf.part.checkpoint"
        while not checkpoint.exists() and running.poll() is None and time.monotonic() < limit:
            time.sleep(0.01)
        running.send_signal(signal.SIGINT)
        error = running.communicate(timeout=60)[1]
        self.assertEqual(running.returncode, 130, error)
        self.assertIn("tunica-simulate --resume out.hdf.part", error)
        kept = checkpoint.read_bytes()
        for same in words, words[:-2]:  # with its report and without
            self.run_tool("simulate", *same, code=5, report=False, says=["--resume out.hdf.part", "--force"])
            self.assertEqual(checkpoint.read_bytes(), kept)
        running = self.start_tool("simulate", "--resume", "out.hdf.part", "--report", "run.json")
        time.sleep(1)
        running.send_signal(signal.SIGTERM)
        error = running.communicate(timeout=60)[1]
        self.assertIn(running.returncode, (0, 143), error)
        self.assertNotIn("exists already", error)

    def test_a_small_stack_does(self):
        """Elements keep more on the stack than 64 KiB."""
        self.run_tool("relax", "coarse.ply", "coarse.ply", "shell.ply")
        self.run_tool("simulate", "shell.ply", "out.hdf", *LOAD, "--static", "--fix", "below z=-30mm",
                      limits={resource.RLIMIT_STACK: 65536})


if __name__ == "__main__":
    unittest.main()
