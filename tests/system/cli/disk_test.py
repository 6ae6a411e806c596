"""What holds for every tool when a disk is full, a folder cannot be written to, or an input vanishes while it is read: one
line that names the file, exit code 5 or 3, and nothing under a final name that is not whole."""
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

from running import ToolTest, run_tool

LOAD = ["--young", "1MPa", "--poisson", "0.3", "--thickness", "1mm", "--pressure", "1kPa", "--fix", "rigid-motions",
        "--static", "--load-steps", "2"]

# In a mount namespace of its own: a disk of so many bytes in the folder, the command, and what is left on the disk for
# those outside. The report lies elsewhere.
ON_A_SMALL_DISK = """mount -t tmpfs -o size=$1 none disk && shift || exit 99
"$@"; code=$?
cp -a disk/. left/
exit $code"""
ON_A_READ_ONLY_DISK = 'mount -t tmpfs -o ro none disk || exit 99; "$@"'


def namespaces():
    """Whether a user may mount a disk that nobody else sees."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            done = subprocess.run(["unshare", "-rm", "mount", "-t", "tmpfs", "none", folder], capture_output=True, check=False)
        except FileNotFoundError:
            return False
        return done.returncode == 0


def make_inputs(folder):
    """One step of the chain each, and a run's folder for the report."""
    case = pathlib.Path(folder, "run", "ball", "1")
    case.mkdir(parents=True)
    chain = (["phantom", "sphere", "ball.nii.gz", "--size", "24"],
             ["extract", "ball.nii.gz", "surface.ply", "--label", "1", "--smooth", "staircase"],
             ["decimate", "surface.ply", "coarse.ply", "--triangles", "120"],
             ["relax", "coarse.ply", "surface.ply", "shell.ply", "--tolerance", "2%", "--refine"])
    for verb, *words in chain:
        run_tool(verb, *words, "--quiet", folder=folder, report=case / f"{verb}.json")
        if words[1].endswith(".ply"):
            shutil.copy(pathlib.Path(folder, words[1 if verb != "relax" else 2]), case)
    shutil.copy(case / "relax.json", folder)


# Per tool its command line, outputs in the folder of the disk, and the input that vanishes.
COMMANDS = {
    "phantom": (["sphere", "disk/out.nii", "--size", "32", "--truth", "disk/truth.ply"], None),
    "extract": (["ball.nii.gz", "disk/out.ply", "--label", "1"], "ball.nii.gz"),
    "decimate": (["surface.ply", "disk/out.ply", "--triangles", "1200"], "surface.ply"),
    "relax": (["coarse.ply", "surface.ply", "disk/out.ply", "--tolerance", "2%", "--refine", "--picture", "disk/map.png",
               "--map", "disk/map.ply"], "surface.ply"),
    "compare": (["coarse.ply", "surface.ply", "--map", "disk/out.ply", "--picture", "disk/out.png"], "surface.ply"),
    "simulate": (["shell.ply", "disk/out.hdf", *LOAD, "--picture", "disk/out.png", "--export", "pvd"], "shell.ply"),
    "chart": (["relax.json", "--x", "result.iterations.seconds", "--y", "result.iterations.hausdorff_percent.upper", "-o",
               "disk/out.svg", "--csv", "disk/out.csv"], "relax.json"),
    "report": (["run", "-o", "disk/out.html", "--summary", "disk/out.tsv"], None),
}


class Disk(ToolTest):
    @classmethod
    def setUpClass(cls):
        cls.made = tempfile.mkdtemp(prefix="tunica-disk-")
        cls.addClassCleanup(shutil.rmtree, cls.made, ignore_errors=True)
        make_inputs(cls.made)

    def setUp(self):
        super().setUp()
        shutil.copytree(self.made, self.folder, dirs_exist_ok=True)
        for name in ("disk", "left"):
            (self.folder / name).mkdir()

    WORDS = ["--quiet", "--threads", "1", "--force"]

    def run_command(self, verb, *more, disk=None, **options):
        """@param disk  a script that mounts one and runs what follows, and the script's own words"""
        self.run_tool(verb, *COMMANDS[verb][0], *self.WORDS, *more, **options,
                      within=["unshare", "-rm", "sh", "-c", disk[0], "sh", *disk[1:]] if disk else [])

    def whole(self, verb):
        """The outputs of an undisturbed run, which are then removed."""
        self.run_command(verb)
        outputs = {path.name: path.read_bytes() for path in (self.folder / "disk").iterdir()}
        self.assertGreater(len(outputs), 0, verb)
        self.empty("disk")
        return outputs

    def empty(self, name):
        shutil.rmtree(self.folder / name)
        (self.folder / name).mkdir()

    def check_left(self, verb, where, whole):
        """Nothing under a final name but what is whole."""
        for path in (self.folder / where).iterdir():
            if ".part" in path.name:
                continue
            self.assertEqual(path.read_bytes(), whole.get(path.name), f"{verb}: {path.name} is not whole")

    @unittest.skipUnless(namespaces(), "no disk can be mounted in a namespace of its own: see the limit on sizes below")
    def test_a_full_disk(self):
        for verb in COMMANDS:
            whole = self.whole(verb)
            needed = sum(map(len, whole.values()))
            for part in (0, 0.4, 0.9):
                pages = max(1, int(part * needed / 4096))
                with self.subTest(verb=verb, pages=pages):
                    self.run_command(verb, code=(0, 5), disk=[ON_A_SMALL_DISK, str(4096 * pages)])
                    if self.done.returncode == 0:  # a chart may fit in one
                        self.assertLess(needed, 3 * 4096)
                    else:
                        self.assertRegex(self.done.stderr, "disk/.*No space left on device")
                    self.check_left(verb, "left", whole)
                self.empty("left")

    def test_a_limit_on_the_size_of_files(self):
        """It stands for the disk where none can be mounted: writing past it fails in the same way."""
        for verb in COMMANDS:
            whole = self.whole(verb)
            largest = max(map(len, whole.values()))
            for part in (0.01, 0.9):
                limit = int(part * largest)
                with self.subTest(verb=verb, limit=limit):
                    self.run_command(verb, code=5, report=False, limits={resource.RLIMIT_FSIZE: limit})
                    self.assertRegex(self.done.stderr, rf"^tunica-{verb}: disk/.*File too large")
                    self.check_left(verb, "disk", whole)
                self.empty("disk")

    @unittest.skipUnless(namespaces(), "no disk can be mounted in a namespace of its own")
    def test_a_read_only_folder(self):
        for verb in COMMANDS:
            self.run_command(verb, code=5, disk=[ON_A_READ_ONLY_DISK])
            self.assertRegex(self.done.stderr, "disk/.*Read-only file system")

    @unittest.skipUnless(namespaces(), "no disk can be mounted in a namespace of its own")
    def test_a_report_that_cannot_be_written(self):
        """Said before any work."""
        for verb in COMMANDS:
            self.run_command(verb, "--report", "disk/report.json", code=5, report=False, disk=[ON_A_READ_ONLY_DISK])
            self.assertRegex(self.done.stderr, rf"^tunica-{verb}: disk/report.json.*Read-only file system")

    def open_files(self, process):
        try:
            return [os.readlink(f"/proc/{process.pid}/fd/{name}") for name in os.listdir(f"/proc/{process.pid}/fd")]
        except OSError:
            return []

    def stopped_while_reading(self, verb, path):
        """Starts the tool and stops it as soon as it has the file open. @return the process, and whether it had it open"""
        process = self.start_tool(verb, *COMMANDS[verb][0], *self.WORDS)
        limit = time.monotonic() + 20
        while process.poll() is None and time.monotonic() < limit:
            if str(path) in self.open_files(process):
                process.send_signal(signal.SIGSTOP)
                return process, str(path) in self.open_files(process)
        return process, False

    def test_an_input_that_is_cut_while_it_is_read(self):
        """It is refused, or was read whole before."""
        hits = 0
        for verb, (_, name) in COMMANDS.items():
            if name is None:
                continue
            whole = self.whole(verb)
            path = (self.folder / name).resolve()
            data = path.read_bytes()
            for _ in range(4):
                process, reading = self.stopped_while_reading(verb, path)
                hits += reading
                os.truncate(path, len(data) // 2)
                process.send_signal(signal.SIGCONT)
                stderr = process.communicate(timeout=100)[1]
                with self.subTest(verb=verb, reading=reading):
                    self.assertIn(process.returncode, (0, 3), stderr)
                    if process.returncode == 3:
                        self.assertRegex(stderr, rf"^tunica-{verb}: {name}[^\n]*\n$")
                        self.assertNotIn("Success", stderr)
                    self.check_left(verb, "disk", whole)
                path.write_bytes(data)
                self.empty("disk")
        if hits == 0:
            self.skipTest("every tool had read its input before it could be stopped")


if __name__ == "__main__":
    unittest.main()
