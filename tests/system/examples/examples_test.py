#!/usr/bin/python3
"""The worked examples of every tool's --help run as printed: one after the other, from phantom to chart, in one folder;
and so do the tutorial's commands."""

import json
import os
import re
import resource
import subprocess
import tempfile
import unittest
from pathlib import Path

TOOLS = Path(os.environ["TUNICA_BIN"])
CHAIN = ["phantom", "extract", "decimate", "relax", "compare", "simulate", "chart", "report"]
LONGEST_SECONDS = 20  # of one processor, whatever else the machine does


def examples_of(verb):
    """The command lines under "Example:"."""
    text = subprocess.run([TOOLS / f"tunica-{verb}", "--help"], capture_output=True, text=True, check=True).stdout
    lines = text.split("\nExample:\n")[1].splitlines()
    return [line.strip() for line in lines if line.strip()]


class Examples(unittest.TestCase):
    def make_case(self, folder, environment):
        """A case as the pipeline leaves it, for tunica-report."""
        case = folder / "out" / "sample" / "1"
        case.mkdir(parents=True)
        volume = sorted(folder.glob("*.nii.gz"))[0]
        subprocess.run(["tunica-extract", volume, case / "surface.ply", "--label", "1", "--report", case / "extract.json"], check=True,
                       env=environment, capture_output=True)

    def test_all_in_the_order_of_the_chain(self):
        self.assertEqual(sorted(path.name for path in TOOLS.glob("tunica-*")), sorted(f"tunica-{verb}" for verb in CHAIN))
        environment = {**os.environ, "PATH": f"{TOOLS}:{os.environ['PATH']}"}
        with tempfile.TemporaryDirectory(prefix="tunica-test-") as folder:
            for verb in CHAIN:
                if verb == "report":
                    self.make_case(Path(folder), environment)
                examples = examples_of(verb)
                self.assertGreater(len(examples), 0, verb)
                for example in examples:
                    with self.subTest(example=example):
                        self.assertTrue(example.startswith(f"tunica-{verb} "))
                        before = resource.getrusage(resource.RUSAGE_CHILDREN)
                        run = subprocess.run(["sh", "-c", example], cwd=folder, env=environment, capture_output=True,
                                             text=True)
                        after = resource.getrusage(resource.RUSAGE_CHILDREN)
                        self.assertEqual(run.returncode, 0, run.stderr)
                        self.assertLess(after.ru_utime - before.ru_utime, LONGEST_SECONDS)

    def test_tutorial(self):
        source = Path(os.environ["TUNICA_SOURCE"])
        text = (source / "docs" / "tutorial.md").read_text(encoding="utf-8")
        commands = re.findall(r"^```sh\n(.*?)^```", text, flags=re.M | re.S)
        self.assertGreater(len(commands), 6)
        with tempfile.TemporaryDirectory(prefix="tunica-test-") as folder:
            os.symlink(source / "data-samples", os.path.join(folder, "data-samples"))
            os.makedirs(os.path.join(folder, "build", "release"))
            os.symlink(TOOLS, os.path.join(folder, "build", "release", "bin"))
            run = subprocess.run(["sh", "-ec", "".join(commands)], cwd=folder, capture_output=True, text=True)
            self.assertEqual(run.returncode, 0, run.stderr)
            # The numbers it names.
            named = re.findall(r"`result\.([a-z0-9_.]+)`, ([\d.]+) M?[mP]", text)
            self.assertEqual(len(named), 2)
            for name, value in named:
                with open(os.path.join(folder, "out", "tutorial", "simulate.json"), encoding="utf-8") as file:
                    result = json.load(file)["result"]
                for part in name.split("."):
                    result = result[part]
                self.assertAlmostEqual(result, float(value), delta=0.05 * float(value), msg=name)


if __name__ == "__main__":
    unittest.main()
