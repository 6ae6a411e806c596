"""Tools that are stopped end within seconds, whatever they are at, and leave no output that looks finished.

    TUNICA_BIN=build/release/bin PYTHONPATH=tests/support tests/system/cli/stopping_test.py [CLASS]
"""
import json
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

import meshes

BIN = pathlib.Path(os.environ["TUNICA_BIN"])
BOUND = 10  # s, on a machine that is busy with other things; two where it is not
LOAD = ["--young", "1MPa", "--poisson", "0.3", "--thickness", "1mm", "--pressure", "1kPa"]


class Stopping(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tunica-stopping-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        meshes.write_ply(self.folder / "fine.ply", *meshes.sphere(6, 40.0), comments=["units mm"])
        meshes.write_ply(self.folder / "coarse.ply", *meshes.sphere(3, 40.0), comments=["units mm"])

    def run_tool(self, verb, *words, limits=None):
        return subprocess.run([BIN / f"tunica-{verb}", *words], cwd=self.folder, capture_output=True, text=True, timeout=300,
                              preexec_fn=limits)

    def stop(self, number, after, verb, *words):
        """@return what was said; nothing when the run was done before"""
        running = subprocess.Popen([BIN / f"tunica-{verb}", *words, "--quiet", "--report", "report.json", "--force"],
                                   cwd=self.folder, stderr=subprocess.PIPE, text=True)
        time.sleep(after)
        running.send_signal(number)
        begin = time.monotonic()
        error = running.communicate(timeout=60)[1]
        late = time.monotonic() - begin
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

    def test_meshes(self):
        for verb, words in (("decimate", ["fine.ply", "out.ply", "--triangles", "500"]),
                            ("relax", ["coarse.ply", "fine.ply", "out.ply"]),
                            ("compare", ["fine.ply", "coarse.ply", "--map", "out.ply"])):
            for number, after in ((signal.SIGTERM, 0.3), (signal.SIGINT, 0.8), (signal.SIGTERM, 2)):
                with self.subTest(verb=verb, after=after):
                    if self.stop(number, after, verb, *words):
                        self.assertFalse((self.folder / "out.ply").exists())
                    (self.folder / "out.ply").unlink(missing_ok=True)

    def test_volumes(self):
        for number, after in ((signal.SIGTERM, 0.2), (signal.SIGINT, 0.7)):
            self.stop(number, after, "phantom", "aneurysm", "out.nii.gz", "--size", "400")
            self.assertEqual([path.name for path in self.folder.glob("out.nii.gz.part")], [])

    def test_interrupted_run_is_not_lost(self):
        """It names how to go on; another run to its name is refused; its own report does not keep it from going on."""
        words = ["coarse.ply", "out.hdf", *LOAD, "--fix", "below z=-30mm", "--density", "1g/cm3", "--duration", "10s",
                 "--step", "5ms", "--report", "run.json"]
        self.assertEqual(self.run_tool("relax", "coarse.ply", "coarse.ply", "shell.ply").returncode, 0)
        words[0] = "shell.ply"
        running = subprocess.Popen([BIN / "tunica-simulate", *words, "--quiet"], cwd=self.folder, stderr=subprocess.PIPE,
                                   text=True)
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
            again = self.run_tool("simulate", *same)
            self.assertEqual(again.returncode, 5, again.stderr)
            self.assertIn("--resume out.hdf.part", again.stderr)
            self.assertIn("--force", again.stderr)
            self.assertEqual(checkpoint.read_bytes(), kept)
        running = subprocess.Popen([BIN / "tunica-simulate", "--resume", "out.hdf.part", "--report", "run.json"],
                                   cwd=self.folder, stderr=subprocess.PIPE, text=True)
        time.sleep(1)
        running.send_signal(signal.SIGTERM)
        error = running.communicate(timeout=60)[1]
        self.assertIn(running.returncode, (0, 143), error)
        self.assertNotIn("exists already", error)

    def test_small_stack(self):
        """Elements keep more on the stack than 64 KiB."""
        self.assertEqual(self.run_tool("relax", "coarse.ply", "coarse.ply", "shell.ply").returncode, 0)
        done = self.run_tool("simulate", "shell.ply", "out.hdf", *LOAD, "--static", "--fix", "below z=-30mm",
                             limits=lambda: resource.setrlimit(resource.RLIMIT_STACK, (65536, 65536)))
        self.assertEqual(done.returncode, 0, done.stderr)


if __name__ == "__main__":
    unittest.main()
