"""What the whole-tool tests of one executable share: a folder of their own, runs, reports."""
import json
import os
import shutil
import subprocess
import tempfile
import unittest


class WholeTool(unittest.TestCase):
    tool = None  # the verb

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)

    def path(self, name):
        return os.path.join(self.folder, name)

    def exists(self, name):
        return os.path.exists(self.path(name))

    def run_tool(self, *arguments, code=0, says=None):
        """Runs the tool with --report; checks the exit code, the one line on stderr and the report."""
        report = self.path("report.json")
        if os.path.exists(report):
            os.remove(report)
        command = [os.path.join(os.environ["TUNICA_BIN"], "tunica-" + self.tool), *map(str, arguments)]
        run = subprocess.run([*command, "--report", report, "--quiet"], cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(run.returncode, code, run.stderr)
        with open(report) as file:
            content = json.load(file)
        self.assertEqual(content["ok"], code == 0)
        if code == 0:
            self.assertEqual(run.stderr, "")
            self.assertIsNone(content["error"])
        else:
            self.assertTrue(run.stderr.startswith("tunica-%s: " % self.tool), run.stderr)
            self.assertEqual(run.stderr.count("\n"), 1, run.stderr)
        if says:
            self.assertIn(says, run.stderr)
        return content
