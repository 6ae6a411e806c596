#!/usr/bin/python3
"""The worked examples of every tool's --help run as printed: one after the other, from phantom to chart, in one folder;
and so do the tutorial's commands."""

import json
import os
import re
import subprocess
import tempfile
import unittest
from pathlib import Path

from running import BIN, run_tool

CHAIN = ["phantom", "extract", "decimate", "relax", "compare", "simulate", "chart", "report"]


def examples_of(verb):
    """The command lines under "Example:"."""
    text = run_tool(verb, "--help", report=False).stdout
    lines = text.split("\nExample:\n")[1].splitlines()
    return [line.strip() for line in lines if line.strip()]


class Examples(unittest.TestCase):
    def make_case(self, folder):
        """A case as the pipeline leaves it, for tunica-report."""
        case = folder / "out" / "sample" / "1"
        case.mkdir(parents=True)
        volume = sorted(folder.glob("*.nii.gz"))[0]
        run_tool("extract", volume, case / "surface.ply", "--label", 1, report=case / "extract.json")

    def test_all_in_the_order_of_the_chain(self):
        self.assertEqual(sorted(path.name for path in BIN.glob("tunica-*")), sorted(f"tunica-{verb}" for verb in CHAIN))
        environment = {**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}"}
        with tempfile.TemporaryDirectory(prefix="tunica-test-") as folder:
            for verb in CHAIN:
                if verb == "report":
                    self.make_case(Path(folder))
                examples = examples_of(verb)
                self.assertGreater(len(examples), 0, verb)
                for example in examples:
                    with self.subTest(example=example):
                        self.assertTrue(example.startswith(f"tunica-{verb} "))
                        run = subprocess.run(["sh", "-c", example], cwd=folder, env=environment, capture_output=True,
                                             text=True)
                        self.assertEqual(run.returncode, 0, run.stderr)

    def test_the_tutorials_commands_run_as_printed(self):
        source = Path(os.environ["TUNICA_SOURCE"])
        text = (source / "docs" / "tutorial.md").read_text(encoding="utf-8")
        commands = re.findall(r"^```sh\n(.*?)^```", text, flags=re.M | re.S)
        self.assertGreater(len(commands), 6)
        with tempfile.TemporaryDirectory(prefix="tunica-test-") as folder:
            os.symlink(source / "data-samples", os.path.join(folder, "data-samples"))
            os.makedirs(os.path.join(folder, "build", "release"))
            os.symlink(BIN, os.path.join(folder, "build", "release", "bin"))
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
