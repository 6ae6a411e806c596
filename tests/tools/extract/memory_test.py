"""tunica-extract --info: the memory that a case takes, against what the tools then report."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

TOOLS = pathlib.Path(os.environ["TUNICA_BIN"])
LOAD = ["--young", "1MPa", "--poisson", "0.45", "--thickness", "1.5mm", "--pressure", "0.2kPa", "--fix", "rigid-motions",
        "--static"]
FACTOR = 1.5


class Memory(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="tunica-test-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def run_tool(self, verb, *words):
        subprocess.run([TOOLS / f"tunica-{verb}", *map(str, words), "--report", "report.json", "--force", "--quiet",
                        "--threads", "2"], cwd=self.folder, check=True, stdout=subprocess.DEVNULL)
        return json.loads((self.folder / "report.json").read_text())

    def test_estimates_hold_within_a_factor(self):
        for shape, size, shells in (("sphere", 24, 200), ("sphere", 160, 800), ("sphere", 48, 3200)):
            self.run_tool("phantom", shape, "v.nii.gz", "--size", size)
            label = self.run_tool("extract", "v.nii.gz", "--info", "--shells", shells)["result"]["labels"][0]
            peak = {}
            peak["extract"] = self.run_tool("extract", "v.nii.gz", "surface.ply", "--label", 1, "--largest",
                                            "--fill-cavities", "--smooth", "staircase")["peak_mib"]
            peak["decimate"] = self.run_tool("decimate", "surface.ply", "coarse.ply", "--triangles", shells)["peak_mib"]
            peak["relax"] = self.run_tool("relax", "coarse.ply", "surface.ply", "shell.ply", "--picture", "map.png",
                                          "--max-iterations", 1)["peak_mib"]
            peak["simulate"] = self.run_tool("simulate", "shell.ply", "result.hdf", *LOAD)["peak_mib"]
            peak["chain"] = max(peak.values())
            for name, measured in peak.items():
                ratio = label["memory_mib"][name] / measured
                self.assertTrue(1 / FACTOR <= ratio <= FACTOR, f"{shape} {size}, {shells} shells: {name}: estimated "
                                f"{label['memory_mib'][name]:.0f} MiB, took {measured:.0f}")

    def test_what_is_told(self):
        self.run_tool("phantom", "sphere", "v.nii.gz", "--size", 16)
        for flags, shells in (((), 800), (("--shells", "5000"), 5000)):
            done = subprocess.run([TOOLS / "tunica-extract", "v.nii.gz", "--info", *flags], cwd=self.folder, text=True,
                                  capture_output=True, check=True)
            self.assertIn(f"MiB of memory of extract and of the chain to {shells} shells", done.stdout)
            self.assertRegex(done.stdout, r"\n  1 +\d+ voxels +\d+\.\d mm3 +\d+ +\d+ MiB  \n")
        done = subprocess.run([TOOLS / "tunica-extract", "v.nii.gz", "o.ply", "--label", "1", "--shells", "9"],
                              cwd=self.folder, text=True, capture_output=True, check=False)
        self.assertEqual(done.returncode, 2)
        self.assertIn("--shells is of the estimate that --info prints", done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + ["-v"] + sys.argv[1:])
