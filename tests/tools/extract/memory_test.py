"""tunica-extract --info: the memory that a case takes, against what the tools then report."""
import unittest

from running import ToolTest

LOAD = ["--young", "1MPa", "--poisson", "0.45", "--thickness", "1.5mm", "--pressure", "0.2kPa", "--fix", "rigid-motions",
        "--static"]
FACTOR = 1.5


class Memory(ToolTest):
    def run_tool(self, *words, **options):
        return super().run_tool(*words, "--force", "--quiet", "--threads", 2, **options)

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
            self.run_tool("extract", "v.nii.gz", "--info", *flags)
            self.assertIn(f"MiB of memory of extract and of the chain to {shells} shells", self.done.stdout)
            self.assertRegex(self.done.stdout, r"\n  1 +\d+ voxels +\d+\.\d mm3 +\d+ +\d+ MiB  \n")
        self.run_tool("extract", "v.nii.gz", "o.ply", "--label", "1", "--shells", "9", code=2,
                      says="--shells is of the estimate that --info prints")


if __name__ == "__main__":
    unittest.main()
