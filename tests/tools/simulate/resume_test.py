"""Runs that are killed at any moment and go on: the same end as without, or a clear refusal."""
import os
import pathlib
import random
import re
import resource
import shutil
import signal
import struct
import time
import unittest
import zlib

import h5py
import numpy as np

from support import SimulateTest, grid, sphere, write_ply

MATERIAL = ["--young", "1MPa", "--poisson", "0.3", "--thickness", "0.5mm", "--solver", "direct"]
STATIC = MATERIAL + ["--pressure", "1.5kPa", "--fix", "boundary", "--static", "--load-steps", "40", "--every", "2"]
DYNAMIC = MATERIAL + ["--pressure", "1kPa", "--density", "1100kg/m3", "--duration", "0.3s", "--step", "2ms", "--every",
                      "3"]
LEFT = ("out.hdf.part", "out.hdf.part.states", "out.hdf.part.checkpoint")


def everything(path):
    """All numbers of a result file by name."""
    found = {}
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found


class Resume(SimulateTest):
    def setUp(self):
        super().setUp()
        write_ply(self.path("plate.ply"), *grid(8, 8, 20, 20))
        write_ply(self.path("ball.ply"), *sphere(1, 10))

    def stop(self, number, *arguments, after=0.0, states=0):
        """Runs and stops with a signal; returns whether the run was stopped before it was done."""
        running = self.start_tool(*arguments, "--quiet")
        limit = time.monotonic() + 60
        while states and running.poll() is None and time.monotonic() < limit:
            if self.exists(LEFT[2]) and os.path.getsize(self.path(LEFT[1])) > states:
                break
            time.sleep(0.002)
        time.sleep(after)
        running.send_signal(number)
        self.said = error = running.communicate()[1]
        if running.returncode == 0:
            return False
        self.assertEqual(running.returncode, -9 if number == signal.SIGKILL else 128 + number, error)
        return True

    def assert_same(self, a, b):
        a, b = everything(self.path(a)), everything(self.path(b))
        self.assertEqual(set(a), set(b))
        for name in a:
            if a[name].dtype.kind == "f":
                scale = np.nanmax(np.abs(a[name]), initial=0)
                digits = 2e-7 if a[name].dtype == np.float32 else 1e-9
                if "residual" not in name:
                    np.testing.assert_allclose(a[name], b[name], rtol=0, atol=digits * scale + 1e-12, err_msg=name)
            else:
                np.testing.assert_array_equal(a[name], b[name], err_msg=name)

    def killed_many_times(self, mesh, words, kills, seed):
        whole = self.run_tool(mesh, "whole.hdf", *words)
        begin = time.monotonic()
        self.run_tool(mesh, "whole.hdf", *words, "--force")
        usual = time.monotonic() - begin
        moments = random.Random(seed)
        command = [mesh, "out.hdf", *words]
        while kills > 0:
            kills -= self.stop(signal.SIGKILL, *command, after=moments.uniform(0, usual))
            command = [mesh, "out.hdf", *words]
            if self.exists("out.hdf"):  # done, or killed when it was
                self.assert_same("whole.hdf", "out.hdf")
                os.remove(self.path("out.hdf"))
                os.remove(self.path("out.page"))
            elif self.exists(LEFT[1]) and os.path.getsize(self.path(LEFT[1])) > 0:
                # else it was killed before it had begun to write
                command = ["--resume", "out.hdf.part"]
        result = self.run_tool(*command)["result"]
        for key in ("steps", "dof", "newton_iterations", "converged", "nodes"):
            self.assertEqual(result[key], whole["result"][key], key)
        self.assertAlmostEqual(result["max_displacement_mm"], whole["result"]["max_displacement_mm"], delta=1e-10)
        self.assert_same("whole.hdf", "out.hdf")
        self.assertEqual([name for name in os.listdir(self.folder) if name.startswith("out.") and name.count(".") > 1], [])
        pages = [pathlib.Path(self.path(name)).read_bytes() for name in ("whole.page", "out.page")]
        self.assertEqual(*(page.partition(b"\n")[0] for page in pages))
        self.assertEqual(*map(len, pages))

    def test_static_run_killed_many_times(self):
        self.killed_many_times("plate.ply", STATIC, 6, 1)

    def test_dynamic_run_killed_many_times(self):
        self.killed_many_times("ball.ply", DYNAMIC, 6, 2)

    def test_linear_run_killed(self):
        self.write("scene.toml", """
[run]
kind = "static"
geometry = "linear"
load_steps = 300
solver = "direct"
[[shell]]
name = "plate"
mesh = "plate.ply"
thickness = "0.5mm"
young = "1MPa"
poisson = 0.3
[[fix]]
body = "plate"
where = {boundary = true}
translation = "xyz"
rotation = "xyz"
[[load]]
body = "plate"
kind = "pressure"
value = "1Pa"
""")
        self.run_tool("--scene", "scene.toml", "whole.hdf")
        self.assertTrue(self.stop(signal.SIGKILL, "--scene", "scene.toml", "out.hdf", states=20_000))
        self.run_tool("--scene", "scene.toml", "out.hdf", "--resume", "out.hdf.part")
        self.assert_same("whole.hdf", "out.hdf")

    def test_second_order_run_with_adaptive_steps_killed(self):
        """What these remember from step to step (accelerations, the length of the last part) is in the checkpoint."""
        for more in ("integrator = \"generalised-alpha\"\n", "adaptive = \"0.02%\"\n",
                     "integrator = \"generalised-alpha\"\nadaptive = \"0.02%\"\n"):
            self.write("scene.toml", f"""
[run]
kind = "dynamic"
duration = "0.1s"
step = "2ms"
solver = "direct"
{more}
[[shell]]
name = "plate"
mesh = "plate.ply"
thickness = "0.5mm"
young = "1MPa"
poisson = 0.3
density = "1100kg/m3"
[[fix]]
body = "plate"
where = {{boundary = true}}
translation = "xyz"
rotation = "xyz"
[[load]]
body = "plate"
kind = "pressure"
value = "200Pa"
ramp = [["0s", 0.0], ["20ms", 1.0]]
""")
            self.run_tool("--scene", "scene.toml", "whole.hdf", "--force")
            self.assertTrue(self.stop(signal.SIGKILL, "--scene", "scene.toml", "out.hdf", states=60_000))
            self.run_tool("--resume", "out.hdf.part", says="goes on after step")
            self.assert_same("whole.hdf", "out.hdf")
            os.remove(self.path("out.hdf"))
            os.remove(self.path("out.page"))

    def test_damped_run_terminated_and_continued_beside_its_command(self):
        words = ["--scene", "scene.toml", "out.hdf"]
        self.write("scene.toml", """
[run]
kind = "dynamic"
duration = "0.2s"
step = "1ms"
damping = {mass = "3/s", stiffness = "2ms"}
solver = "direct"
[[shell]]
name = "ball"
mesh = "ball.ply"
thickness = "0.5mm"
young = "1MPa"
poisson = 0.3
density = "1100kg/m3"
[[fix]]
body = "ball"
where = {rigid_motions = true}
[[load]]
body = "ball"
kind = "pressure"
value = "1kPa"
ramp = [["0s", 0.0], ["50ms", 1.0]]
[[probe]]
name = "top"
body = "ball"
nearest = ["0mm", "0mm", "10mm"]
""")
        whole = self.run_tool("--scene", "scene.toml", "whole.hdf")["result"]["probes"]["top"]
        self.assertTrue(self.stop(signal.SIGTERM, *words, states=20_000))
        with h5py.File(self.path(LEFT[0])) as file:
            before = len(file["tunica/history/time"])
        result = self.run_tool(*words, "--resume", "out.hdf.part")["result"]
        self.assertIn("goes on after step", self.done.stderr)
        self.assertLess(before, 201)
        probe = result["probes"]["top"]  # whole, not only what came after
        np.testing.assert_allclose(probe["displacement_mm"], whole["displacement_mm"], atol=1e-10)
        np.testing.assert_allclose(probe["time_s"], whole["time_s"])
        self.assert_same("whole.hdf", "out.hdf")

    def test_what_an_interrupt_advises_works(self):
        """Also where an older result has the name of the one that was being written."""
        for there in (False, True):
            if there:
                shutil.copy(self.path("ball.ply"), self.path("out.hdf"))
            self.assertTrue(self.stop(signal.SIGINT, "ball.ply", "out.hdf", *DYNAMIC, "--force",
                                      "--report", "stop.json", states=50_000))
            advised = re.search(r"stopped by signal 2: go on by tunica-simulate (.*)\n", self.said).group(1).split()
            self.assertEqual(advised, ["--resume", "out.hdf.part", *["--force"] * there, "--report", "stop.json"])
            self.run_tool(*advised, says="goes on after step", report=False)
            self.assertGreater(os.path.getsize(self.path("out.hdf")), 50_000)
            os.remove(self.path("out.hdf"))

    def interrupted(self):
        self.assertTrue(self.stop(signal.SIGKILL, "ball.ply", "out.hdf", *DYNAMIC, states=100_000))
        for name in LEFT:
            shutil.copy(self.path(name), self.path("kept." + name))

    def restore(self):
        for name in LEFT:
            shutil.copy(self.path("kept." + name), self.path(name))

    def refused(self, *words, says, code=3):
        report = self.run_tool(*words, code=code)
        self.assertIn(says, report["error"])
        self.assertFalse(self.exists("out.hdf"))

    def test_another_run_is_refused_and_said_why(self):
        self.interrupted()
        part = ["--resume", "out.hdf.part"]

        def changed(old, new):
            return [new if word == old else word for word in DYNAMIC]

        for old, new, says in (("0.5mm", "0.6mm", "thickness = \"0.0006m\""), ("2ms", "1ms", "step = "),
                               ("3", "4", "every = 4"), ("direct", "auto", "solver = ")):
            self.refused("ball.ply", "out.hdf", *changed(old, new), *part, says=says)
        shutil.copy(self.path("ball.ply"), self.path("same.ply"))
        write_ply(self.path("ball.ply"), *sphere(1, 10.5))
        self.refused(*part, says="ball.ply is not the one")
        self.refused("ball.ply", "out.hdf", *DYNAMIC, *part, says="ball.ply is not the one")
        os.remove(self.path("ball.ply"))
        self.refused(*part, says="ball.ply: no such file")
        # The same bytes under another name are the same mesh; the part is still what it was.
        self.run_tool("same.ply", "out.hdf", *DYNAMIC, *part)

    def test_a_run_goes_on_where_its_folder_moved(self):
        self.interrupted()
        before, self.folder = self.folder, self.folder / "moved"
        os.mkdir(self.folder)
        for name in (*LEFT, "ball.ply"):
            os.rename(os.path.join(before, name), self.path(name))
        self.run_tool("--resume", "out.hdf.part")
        with h5py.File(self.path("out.hdf")) as file:
            self.assertIn(b'mesh = "ball.ply"', file["tunica/scene"][()])

    def test_what_cannot_be_resumed(self):
        self.refused("--resume", "out.hdf.part", says="out.hdf.part: no such file")
        self.refused("--resume", "out.hdf", says="ends with .part", code=2)
        self.refused("--resume", "out.hdf.part", "--young", "2MPa", says="--young", code=2)
        self.refused("ball.ply", "other.hdf", *DYNAMIC, "--resume", "out.hdf.part", says="other.hdf", code=2)
        self.write("out.hdf.part", "something else")
        self.refused("--resume", "out.hdf.part", says="out.hdf.part.states")
        os.remove(self.path("out.hdf.part"))
        self.interrupted()
        for name in LEFT:
            os.rename(self.path(name), self.path("away." + name))
        self.refused("--resume", "out.hdf.part", says="no such file")
        self.write("out.hdf", "a result")
        self.run_tool("--resume", "out.hdf.part", code=3, says="is complete, there is nothing to resume")
        for name in LEFT:
            os.rename(self.path("away." + name), self.path(name))
        self.run_tool("--resume", "out.hdf.part", code=5)  # never replaced unasked
        os.remove(self.path("out.hdf"))
        self.run_tool("--resume", "out.hdf.part")

    def test_damaged_files_are_named(self):
        self.interrupted()
        for name in LEFT[1:]:
            for place in (3, 40, 1500, 3500):
                with open(self.path(name), "r+b") as file:
                    file.seek(place)
                    byte = file.read(1)
                    file.seek(place)
                    file.write(bytes([byte[0] ^ 0x55]))
                self.run_tool("--resume", "out.hdf.part", code=3, says=f"{name}: is damaged")
                self.assertTrue(self.exists("out.hdf.part"))
                self.restore()
            for keep in (0, 10, 1500):
                os.truncate(self.path(name), keep)
                self.run_tool("--resume", "out.hdf.part", code=3, says=f"{name}: is damaged")
                self.restore()
        # A record that the kill cut short comes after the checkpoint, and is no damage. Neither is a spoilt result: it
        # is written anew.
        with open(self.path(LEFT[1]), "ab") as file:
            file.write(b"\xff" * 1000)
        os.truncate(self.path(LEFT[0]), 100)
        self.run_tool("--resume", "out.hdf.part")
        self.run_tool("ball.ply", "whole.hdf", *DYNAMIC)
        self.assert_same("whole.hdf", "out.hdf")

    def test_a_forged_count_of_steps_is_no_run(self):
        """Its checksum holds, yet no file of this size can have seen so many steps."""
        self.interrupted()
        with open(self.path(LEFT[2]), "r+b") as file:
            checkpoint = file.read()
            head = checkpoint.index(b"\n") + 1  # then the checksum, of all that follows
            steps = head + 4 + 4 + 8 + 8 + 8  # identity, states, their bytes, degrees of freedom
            count = struct.unpack_from("<Q", checkpoint, steps)[0]
            self.assertTrue(0 < count < 150, count)
            content = checkpoint[head + 4:steps] + struct.pack("<Q", 3 * 10**16) + checkpoint[steps + 8:]
            file.seek(head)
            file.write(struct.pack("<I", zlib.crc32(content)) + content)
        self.run_tool("--resume", "out.hdf.part", code=3, says=f"{LEFT[2]}: is damaged")

    def test_before_the_first_checkpoint_it_begins_again(self):
        self.interrupted()
        os.remove(self.path(LEFT[2]))
        self.run_tool("--resume", "out.hdf.part", says="begins again")
        self.run_tool("ball.ply", "whole.hdf", *DYNAMIC)
        self.assert_same("whole.hdf", "out.hdf")

    def test_two_at_once_are_refused(self):
        long = [word if word != "0.3s" else "300s" for word in DYNAMIC]
        running = self.start_tool("ball.ply", "out.hdf", *long, "--quiet")
        limit = time.monotonic() + 60
        while not self.exists(LEFT[2]) and time.monotonic() < limit:
            time.sleep(0.01)
        self.run_tool("--resume", "out.hdf.part", code=5, says="another run is writing it")
        self.run_tool("ball.ply", "out.hdf", *long, code=5, report=False)
        self.assertIsNone(running.poll())

    def test_a_full_disk_leaves_what_can_be_resumed_or_nothing(self):
        """A limit on the size of files stands for the disk: writing past it fails in the same way."""
        self.run_tool("ball.ply", "whole.hdf", *DYNAMIC)
        seen = set()
        for kibibytes in (8, 64, 128, 192, 256, 512):
            self.run_tool("ball.ply", "out.hdf", *DYNAMIC, "--quiet", code=5, report=False,
                          limits={resource.RLIMIT_FSIZE: kibibytes << 10})
            kept = self.exists(LEFT[0])
            seen.add(kept)
            self.assertEqual(self.exists(LEFT[1]), kept, kibibytes)
            if kept:
                self.run_tool("--resume", "out.hdf.part")
                self.assert_same("whole.hdf", "out.hdf")
                os.remove(self.path("out.hdf"))
        self.assertEqual(seen, {False, True})

    def test_a_failed_run_leaves_nothing_to_go_on_with(self):
        self.run_tool("ball.ply", "out.hdf", *MATERIAL, "--pressure", "10MPa", "--fix", "rigid-motions", "--static",
                      code=4)
        self.assertTrue(self.exists(LEFT[0]))
        self.assertFalse(self.exists(LEFT[1]))
        self.refused("--resume", "out.hdf.part", says="cannot be resumed")


if __name__ == "__main__":
    unittest.main()
