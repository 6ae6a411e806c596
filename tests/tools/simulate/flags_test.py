"""The command line of tunica-simulate: every flag, every exit code, signals, --check."""
import hashlib
import os
import pathlib
import resource
import signal
import time
import unittest

import h5py
import numpy as np

from meshes import tube
from support import SimulateTest, grid, sphere, write_ply

MATERIAL = ["--young", "1MPa", "--poisson", "0.3", "--thickness", "0.5mm"]
PRESSED = MATERIAL + ["--pressure", "100Pa"]
HELD = PRESSED + ["--fix", "rigid-motions", "--static"]
DYNAMIC = PRESSED + ["--density", "1100kg/m3", "--duration", "0.1s", "--step", "10ms"]

RESULT_KEYS = ["shells", "tetrahedra", "nodes", "dof", "steps", "step_parts", "converged", "max_displacement_mm",
               "peak", "displacement_p99_mm", "max_node_displacement_mm", "wall", "volume_before_mm3",
               "volume_after_mm3", "strain_energy_mj", "residual", "algebraic_error_percent",
               "algebraic_error_is_lower_bound", "newton_iterations",
               "cg_iterations", "ms_per_step", "real_time_factor", "probes", "frequencies_hz", "buckling_factors",
               "limit_load_factors", "branch_load_factors", "snaps", "energy", "estimates",
               "short_waves_stiffened_from"]


class Flags(SimulateTest):
    def setUp(self):
        super().setUp()
        write_ply(self.path("ball.ply"), *sphere(1, 10))
        write_ply(self.path("plate.ply"), *grid(4, 4, 10, 10))

    def test_report_holds_the_keys_of_the_contract(self):
        report = self.run_tool("ball.ply", "out.hdf", *HELD)
        self.assertIn("is uncertain by about 5 % here", self.done.stderr)  # thickness over radius
        self.assertEqual(list(report["result"]), RESULT_KEYS)
        result = report["result"]
        self.assertEqual((result["shells"], result["tetrahedra"], result["nodes"]), (80, 0, 42))
        self.assertTrue(result["converged"])
        self.assertEqual(result["steps"], 1)
        self.assertLess(result["residual"], 1e-8)
        self.assertIsNone(result["real_time_factor"])
        self.assertGreater(result["volume_after_mm3"], result["volume_before_mm3"])
        self.assertEqual(set(result["ms_per_step"]), {"median", "max"})
        self.assertEqual(list(report["seconds"]), ["total", "read", "setup", "solve", "write"])
        self.assertTrue(all(report["seconds"][stage] > 0 for stage in report["seconds"]))
        self.assertEqual([i["path"] for i in report["inputs"]], ["ball.ply"])
        self.assertEqual(report["outputs"], [{"path": name, "sha256": hashlib.sha256(pathlib.Path(self.path(name)).read_bytes()).hexdigest()}
                                             for name in ("out.hdf", "out.page")])
        self.assertEqual(os.listdir(self.folder).count("out.hdf.part"), 0)

    def test_a_note_says_where_little_of_the_wall_is_counted(self):
        write_ply(self.path("tube.ply"), *tube(24, 8, radius=10, length=12))  # 2 sqrt(R t) = 4.5 mm at either end
        report = self.run_tool("tube.ply", "out.hdf", *PRESSED, "--fix", "boundary", "--static")
        share = report["result"]["wall"]["left_out_percent"]
        self.assertGreater(share, 50)
        self.assertLess(share, 90)
        self.assertIn(f"{share:.0f} % of the wall lies within two bending lengths", self.done.stderr)

    def test_open_body_has_no_volume(self):
        result = self.run_tool("plate.ply", "out.hdf", *PRESSED, "--fix", "boundary", "--static")["result"]
        self.assertIsNone(result["volume_before_mm3"])
        self.assertIsNone(result["volume_after_mm3"])

    def test_a_dynamic_run_writes_every_so_many_states(self):
        report = self.run_tool("ball.ply", "out.hdf", *DYNAMIC, "--ramp", "50ms", "--every", "4")
        result = report["result"]
        self.assertEqual(result["steps"], 10)
        self.assertGreater(result["real_time_factor"], 0)
        with h5py.File(self.path("out.hdf")) as file:
            np.testing.assert_allclose(file["tunica/history/time"], [0, 0.04, 0.08, 0.1], atol=1e-12)
            np.testing.assert_allclose(file["tunica/history/load_factor"], [0, 0.8, 1, 1], atol=1e-12)

    def test_order_of_words_does_not_matter(self):
        for words in (["--static", "--fix", "rigid-motions", "ball.ply", "out.hdf", *MATERIAL],
                      ["ball.ply", *MATERIAL, "--fix", "rigid-motions", "out.hdf", "--static"]):
            result = self.run_tool(*words, "--pressure", "-0.5kPa", "--force")["result"]
            self.assertLess(result["volume_after_mm3"], result["volume_before_mm3"])

    def test_load_steps_do_not_change_the_answer(self):
        whole = self.run_tool("ball.ply", "whole.hdf", *HELD)["result"]
        self.assertEqual(whole["steps"], 1)
        ten = self.run_tool("ball.ply", "ten.hdf", *HELD, "--load-steps", "10")["result"]
        self.assertEqual(ten["steps"], 10)
        self.assertAlmostEqual(ten["max_displacement_mm"] / whole["max_displacement_mm"], 1, places=5)
        self.assertGreater(ten["newton_iterations"], 2 * whole["newton_iterations"])
        self.assertEqual(self.run_tool("ball.ply", "out.hdf", *HELD, "--load-steps", "3")["result"]["steps"], 3)

    def test_several_fixes_all_hold(self):
        self.run_tool("plate.ply", "out.hdf", *PRESSED, "--static", "--fix", "below x=0mm", "--fix", "above x = 1cm")
        with h5py.File(self.path("out.hdf")) as file:
            u = file["tunica/nodes/displacement"][-1].reshape(5, 5, 3)
            self.assertTrue((u[:, [0, 4]] == 0).all())
            self.assertTrue((u[:, 1:4, 2] > 0).all())

    def test_solvers_and_elements_are_chosen(self):
        reference = self.run_tool("ball.ply", "a.hdf", *HELD, "--solver", "direct")["result"]
        self.assertEqual(reference["cg_iterations"], 0)
        self.assertLess(reference["algebraic_error_percent"], 1e-4)
        by_cg = self.run_tool("ball.ply", "b.hdf", *HELD, "--solver", "cg")["result"]
        self.assertGreater(by_cg["cg_iterations"], 0)
        self.assertFalse(by_cg["algebraic_error_is_lower_bound"])
        self.assertAlmostEqual(by_cg["max_displacement_mm"] / reference["max_displacement_mm"], 1, places=6)
        for flag, names in (("--membrane", ["cst", "opt", "adapt"]), ("--bending", ["comas", "comas-consistent", "dkt", "dkt-comas"])):
            values = set()
            for name in names:
                result = self.run_tool("plate.ply", "c.hdf", "--force", *PRESSED, "--static", "--fix",
                                       "below x=0mm", "--load-steps", "2", flag, name)["result"]
                values.add(result["max_displacement_mm"])
            self.assertGreater(len(values), 1, f"{flag} changes nothing")

    def test_fixed_count_of_iterations_is_no_failure_and_not_converged(self):
        result = self.run_tool("ball.ply", "out.hdf", *DYNAMIC, "--cg-iterations", "3")["result"]
        self.assertFalse(result["converged"])
        self.assertGreater(result["cg_iterations"], 0)
        self.assertGreater(result["algebraic_error_percent"], 0)
        self.assertTrue(result["algebraic_error_is_lower_bound"])
        with h5py.File(self.path("out.hdf")) as file:
            self.assertEqual(file["tunica/converged"][()], 0)

    def test_tolerance_of_cg(self):
        result = self.run_tool("ball.ply", "out.hdf", *HELD, "--cg-tolerance", "5%", "--converge", "1e-6")["result"]
        self.assertTrue(result["converged"])
        self.assertLess(result["residual"], 1e-6)

    def test_wrong_usage_is_2(self):
        def refused(*arguments, says):
            self.run_tool(*arguments, code=2, says=says)
            self.assertFalse(self.exists("out.hdf"))

        io = ["ball.ply", "out.hdf"]
        for i in range(0, len(PRESSED), 2):
            rest = PRESSED[:i] + PRESSED[i + 2:]
            refused(*io, *rest, "--fix", "rigid-motions", "--static", says=f"{PRESSED[i]} is missing")
        refused(*io, *PRESSED, "--duration", "1s", "--step", "1ms", says="--density is missing")
        refused(*io, *PRESSED, "--duration", "1s", says="--step is missing")
        refused(*io, *PRESSED, "--step", "1s", says="--duration is missing")
        refused(*io, *PRESSED, says="--static is missing")
        refused(*io, *HELD, "--duration", "1s", says="contradict")
        refused(*io, *HELD, "--ramp", "1s", says="contradict")
        refused(*io, *DYNAMIC, "--load-steps", "3", says="--load-steps")
        refused(*io, *HELD, "--young", "1MPa", says="--young")
        refused(*io, *HELD, "--load-steps", "0", says="--load-steps")
        refused(*io, *HELD, "--every", "1.5", says="--every")
        refused(*io, *HELD, "--solver", "lu", says="--solver")
        refused(*io, *HELD, "--membrane", "dkt", says="--membrane")
        refused(*io, *HELD, "--bending", "cst", says="--bending")
        refused(*io, *HELD, "--cg-tolerance", "0.05", says="5%")
        refused(*io, *HELD, "--cg-tolerance", "200%", says="--cg-tolerance")
        refused(*io, *HELD, "--converge", "nan", says="--converge")
        refused(*io, *HELD, "--converge", "0", says="--converge")
        refused(*io, *HELD, "--solver", "direct", "--cg-iterations", "3", says="direct")
        refused(*io, *HELD, "--fix", "below z=3", says="no unit")
        refused(*io, *HELD, "--fix", "under z=3mm", says="--fix")
        refused(*io, *HELD, "--mesh-unit", "inch", says="unit of length")
        refused(*io, *HELD, "--resume", "out.hdf.part", "--check", says="contradict")
        refused(*io, *HELD, "--frobnicate", says="--frobnicate")
        refused("ball.ply", *HELD, says="OUT.hdf is missing")
        refused("ball.ply", "ball.ply", *HELD, "--force", says="written is .hdf or .vtkhdf")
        refused("--scene", "a.toml", says="OUT.hdf is missing")
        refused("--scene", "a.toml", "out.hdf", "--young", "1MPa", says="contradict")
        refused("--scene", "a.toml", "out.hdf", "--static", says="contradict")
        refused("--scene", "a.toml", "ball.ply", "out.hdf", says="too many")
        for flag, bare in (("--young", "1"), ("--thickness", "1"), ("--pressure", "1"), ("--density", "1"),
                           ("--young", "1mm"), ("--poisson", "0.3mm"), ("--poisson", "0.5"), ("--thickness", "-1mm"),
                           ("--thickness", "0mm"), ("--young", "-1MPa")):
            arguments = [word for pair in zip(PRESSED[::2], PRESSED[1::2]) if pair[0] != flag for word in pair]
            refused(*io, *arguments, "--static", "--fix", "rigid-motions", flag, bare, says=flag)

    def test_unfit_inputs_are_3(self):
        def refused(*arguments, says):
            report = self.run_tool(*arguments, code=3, says=says)
            self.assertFalse(report["ok"])
            self.assertIn(says, report["error"])
            self.assertFalse(self.exists("out.hdf.part"))

        refused("nosuch.ply", "out.hdf", *HELD, says="nosuch.ply: no such file")
        refused("ball.ply", "out.hdf", *PRESSED, "--static", says="ball.ply: ")  # free to move
        refused("ball.ply", "out.hdf", *PRESSED, "--static", "--fix", "boundary", says="closed")
        refused("ball.ply", "out.hdf", *PRESSED, "--static", "--fix", "below z=-1m", says="selects no node")
        refused("--scene", "nosuch.toml", "out.hdf", says="nosuch.toml: no such file")
        self.write("bad.toml", "[run]\nkind = \"static\"\n[[shell]]\nname = 3\n")
        refused("--scene", "bad.toml", "out.hdf", says="bad.toml:4:8: ")

    def test_mesh_without_a_unit_needs_one(self):
        vertices, triangles, _ = sphere(1, 0.01)
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
        lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
        self.write("ball.obj", "\n".join(lines) + "\n")
        self.run_tool("ball.obj", "out.hdf", *HELD, code=2, says="--mesh-unit")
        metres = self.run_tool("ball.obj", "out.hdf", *HELD, "--mesh-unit", "m")["result"]
        self.assertAlmostEqual(metres["volume_before_mm3"] / 4188.79, 1, delta=0.15)
        self.assertIn("no normals", self.done.stderr)

    def test_no_equilibrium_is_a_requirement_not_met(self):
        pressed = [word if word != "100Pa" else "10MPa" for word in HELD]
        report = self.run_tool("ball.ply", "out.hdf", *pressed, code=4)
        self.assertIn("ball.ply: ", report["error"])
        self.assertFalse(report["result"]["converged"])
        self.assertFalse(self.exists("out.hdf"))
        with h5py.File(self.path("out.hdf.part")) as file:  # the last good state
            self.assertEqual(file["tunica/converged"][()], 0)
            last = file["tunica/nodes/displacement"][-1]
            self.assertGreater(file["tunica/history/load_factor"][-1], 0)  # also when no whole load step was reached
            self.assertTrue(np.isfinite(last).all())
            self.assertAlmostEqual(np.linalg.norm(last, axis=1).max(), report["result"]["max_node_displacement_mm"])

    def test_outputs_that_cannot_be_written(self):
        self.run_tool("ball.ply", "out.hdf", *HELD)
        self.run_tool("ball.ply", "out.hdf", *HELD, code=5, says="--force")
        self.run_tool("ball.ply", "out.hdf", *HELD, "--force")
        self.run_tool("ball.ply", "nosuch/out.hdf", *HELD, code=5)

    def test_a_full_disk_is_5_and_leaves_no_result(self):
        for size in (2000, 60_000, 200_000):
            self.run_tool("ball.ply", "full.hdf", *DYNAMIC, "--quiet", code=5, says="full.hdf", report=False,
                          limits={resource.RLIMIT_FSIZE: size}, restore_signals=False)  # SIGXFSZ stays ignored
            self.assertFalse(self.exists("full.hdf"))

    def test_what_can_hardly_be_meant_is_told_on_stderr_and_in_the_report(self):
        def told(says, *arguments, many=1):
            report = self.run_tool(*arguments, "out.hdf", "--force")
            self.assertEqual(len(report["warnings"]), many, report["warnings"])
            self.assertIn(says, report["warnings"][0])
            self.assertIn("warning: " + report["warnings"][0], self.done.stderr)
            quiet = self.run_tool(*arguments, "out.hdf", "--force", "--quiet")
            self.assertEqual((quiet["warnings"], self.done.stderr), (report["warnings"], ""))

        def thick(words, thickness):
            return [thickness if word == "0.5mm" else word for word in words]

        write_ply(self.path("ball.ply"), *sphere(2, 10))
        self.assertEqual(self.run_tool("ball.ply", "out.hdf", *HELD)["warnings"], [])
        told("ball.ply: shell: its thickness, 5 mm, is more than a twentieth", "ball.ply", *thick(HELD, "5mm"))
        told("all its nodes are held", "ball.ply", *PRESSED, "--static", "--fix", "below x=1m")
        nothing = [word if word != "100Pa" else "0Pa" for word in HELD]
        told("this load is zero", "ball.ply", *nothing, many=2)
        self.run_tool("ball.ply", "out.hdf", *thick(HELD, "1m"), "--force", code=3,
                      says="ball.ply: shell: the thickness at node 0 is 1000 mm, more than")

    def test_check_prints_a_scene_that_gives_the_same_run(self):
        self.run_tool("ball.ply", *HELD, "--check")
        text = self.done.stdout
        self.assertIn("young = \"1e+06Pa\"", text)
        self.assertEqual(os.listdir(self.folder).count("out.hdf"), 0)
        self.write("scene.toml", text)
        self.run_tool("--scene", "scene.toml", "--check")
        self.assertEqual(self.done.stdout, text)
        by_flags = self.run_tool("ball.ply", "a.hdf", *HELD, "--threads", "1")["result"]
        by_scene = self.run_tool("--scene", "scene.toml", "b.hdf", "--threads", "1")["result"]
        self.assertEqual(by_flags["max_displacement_mm"], by_scene["max_displacement_mm"])
        with h5py.File(self.path("a.hdf")) as a:
            beside = a["tunica/scene"][()].decode()
        self.assertIn('mesh = "ball.ply"', beside)
        self.write("beside.toml", beside)
        self.run_tool("--scene", "beside.toml", "--check")
        self.assertEqual(self.done.stdout, text)
        self.run_tool("ball.ply", *PRESSED, "--static", "--check", code=3)  # free to move: check finds it

    def test_quiet_says_nothing_and_help_says_much(self):
        self.run_tool("ball.ply", "out.hdf", *HELD, "--quiet")
        self.assertEqual(self.done.stderr + self.done.stdout, "")
        self.run_tool("--help", report=False)
        for flag in ("--young", "--fix", "--scene", "--cg-iterations", "--check", "--mesh-unit", "Example"):
            self.assertIn(flag, self.done.stdout)


class Stopped(SimulateTest):
    LONG = PRESSED + ["--density", "1100kg/m3", "--duration", "1000s", "--step", "5ms", "--quiet"]

    def start(self):
        write_ply(self.path("ball.ply"), *sphere(1, 10))
        running = self.start_tool("ball.ply", "out.hdf", *self.LONG, "--report", "r.json", "--force")
        for _ in range(2400):  # until a few states are there: the file can be read while it grows
            time.sleep(0.05)
            try:
                with h5py.File(self.path("out.hdf.part"), "r") as file:
                    if file["VTKHDF/Steps"].attrs["NSteps"] >= 3:
                        return running
            except (OSError, KeyError):
                pass
        self.fail("no state was written within 120 s")

    def check_part(self):
        with h5py.File(self.path("out.hdf.part"), "r") as file:
            steps = file["VTKHDF/Steps"].attrs["NSteps"]
            self.assertGreaterEqual(steps, 3)
            points = file["VTKHDF/NumberOfPoints"][0]
            self.assertGreaterEqual(file["VTKHDF/PointData/displacement"].shape[0], steps * points)
            self.assertTrue(np.isfinite(file["VTKHDF/PointData/displacement"][:steps * points]).all())
            u = file["tunica/nodes/displacement"][:steps]
            self.assertTrue(np.isfinite(u).all())
            self.assertTrue((np.abs(u[1:]).max(axis=(1, 2)) > 0).all())
            np.testing.assert_allclose(file["VTKHDF/Steps/Values"][:steps], 0.005 * np.arange(steps), atol=1e-9)
            self.assertEqual(file["tunica/converged"][()], 0)
        self.assertFalse(self.exists("out.hdf"))

    def test_kill_leaves_a_readable_part(self):
        for delay in (0, 0.037, 0.113):
            running = self.start()
            time.sleep(delay)
            running.kill()
            running.wait()
            self.check_part()
            os.remove(self.path("out.hdf.part"))

    def test_interrupt_and_terminate(self):
        for number, code in ((signal.SIGHUP, 129), (signal.SIGINT, 130), (signal.SIGTERM, 143)):
            running = self.start()
            running.send_signal(number)
            self.assertEqual(running.wait(timeout=60), code)
            self.check_part()
            self.assertTrue(self.exists("r.json"))
            os.remove(self.path("out.hdf.part"))


if __name__ == "__main__":
    unittest.main()
