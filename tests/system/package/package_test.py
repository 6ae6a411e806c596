#!/usr/bin/python3
"""The Debian packages of `make -f Makefile.pipeline package`: what is in them, and that they install and work on a system
with nothing else, on any amd64 processor."""

import json
import os
import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(os.environ["TUNICA_SOURCE"])
PACKAGES = sorted((SOURCE / "build" / "packages").glob("*.deb"))
LIBRARIES = "usr/lib/x86_64-linux-gnu"
BASELINE = f"{LIBRARIES}/libtunica.so.0"
V3 = f"{LIBRARIES}/glibc-hwcaps/x86-64-v3/libtunica.so.0"
MIRROR = os.environ.get("TUNICA_MIRROR", "http://deb.debian.org/debian")
SAMPLE = """set -e
rm -rf ~/sample && mkdir ~/sample && cd ~/sample
tunica-extract /usr/share/doc/tunica/examples/aneurysm.nii.gz surface.ply --label 1 --open-border
tunica-decimate surface.ply coarse.ply --triangles 200
tunica-relax coarse.ply surface.ply shell.ply --refine --tolerance 5% --picture map.png
tunica-simulate shell.ply result.hdf --static --pressure 1kPa --young 1MPa --poisson 0.45 --thickness 1.5mm \\
  --fix boundary --quiet --force --report -
"""


def output(*command, **options):
    run = subprocess.run([str(word) for word in command], capture_output=True, text=True, **options)
    if run.returncode != 0:
        raise AssertionError(f"{command}: {run.returncode}\n{run.stdout[-2000:]}\n{run.stderr[-2000:]}")
    return run.stdout


class Files(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        if len(PACKAGES) != 2:
            raise unittest.SkipTest("needs the packages: make -f Makefile.pipeline package")
        folder = tempfile.TemporaryDirectory(prefix="tunica-test-")
        cls.addClassCleanup(folder.cleanup)
        cls.root = Path(folder.name)
        for package in PACKAGES:
            output("dpkg-deb", "-x", package, cls.root)

    def programs(self):
        return [path for path in sorted((self.root / "usr/bin").iterdir()) if path.read_bytes()[:4] == b"\x7fELF"]

    def test_lintian_finds_no_error(self):
        if not shutil.which("lintian"):
            self.skipTest("needs lintian")
        run = subprocess.run(["lintian", "--allow-root", "--fail-on", "error", *PACKAGES], capture_output=True, text=True)
        self.assertEqual(run.returncode, 0, run.stdout + run.stderr)

    def test_dependencies_are_declared(self):
        fields = output("dpkg-deb", "-f", next(p for p in PACKAGES if p.name.startswith("tunica_")), "Depends")
        for name in ("libc6 ", "libhdf5", "libassimp5", "libcholmod3", "libopencv-core", "libtbb", "libfmt"):
            self.assertIn(name, fields)

    def test_the_baseline_holds_no_avx(self):
        for library, avx in ((BASELINE, False), (V3, True)):
            code = subprocess.run(f"objdump -d '{self.root / library}' | grep -m 1 -E '%[yz]mm|\\svfm' || true", shell=True,
                                  capture_output=True, text=True).stdout
            self.assertEqual(code != "", avx, code)
        for tool in self.programs():
            code = subprocess.run(f"objdump -d '{tool}' | grep -m 1 -E '%[yz]mm|\\svfm' || true", shell=True,
                                  capture_output=True, text=True).stdout
            self.assertEqual(code, "", tool.name)

    def test_both_libraries_have_what_the_tools_need(self):
        def symbols(file, kind):
            return set(re.findall(rf"(?m) {kind} (\S+)$", output("nm", "-D", self.root / file)))

        baseline, v3 = symbols(BASELINE, "[TWVBRDu]"), symbols(V3, "[TWVBRDu]")
        for tool in self.programs():
            needed = {name for name in symbols(tool.relative_to(self.root), "[Uw]") if "tunica" in name}
            self.assertGreater(len(needed), 5, tool.name)
            self.assertEqual((needed - baseline, needed - v3), (set(), set()), tool.name)

    def test_nothing_names_the_machine_that_built_it(self):
        for path in (self.root / LIBRARIES).rglob("*"):
            if path.suffix in (".cmake", ".pc"):
                self.assertNotIn(str(SOURCE), path.read_text(), path)
        for file in (BASELINE, V3, "usr/bin/tunica-relax"):
            self.assertNotIn("PATH", re.sub("BIND_NOW", "", output("readelf", "-d", self.root / file)), file)
            self.assertNotIn(os.fsencode(SOURCE), (self.root / file).read_bytes(), file)


class Chroot(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        if len(PACKAGES) != 2:
            raise unittest.SkipTest("needs the packages: make -f Makefile.pipeline package")
        if os.geteuid() != 0 or not shutil.which("debootstrap"):
            raise unittest.SkipTest("needs root and debootstrap")
        folder = tempfile.TemporaryDirectory(prefix="tunica-test-", ignore_cleanup_errors=True)
        cls.addClassCleanup(folder.cleanup)
        cls.root = Path(folder.name) / "root"
        output("debootstrap", "--variant=minbase", "bookworm", cls.root, MIRROR)
        shutil.copy("/etc/resolv.conf", cls.root / "etc")
        for package in PACKAGES:
            shutil.copy(package, cls.root / "srv")
        cls.inside("apt-get update -q && apt-get install -y -q --no-install-recommends /srv/*.deb")

    @classmethod
    def inside(cls, script):
        """@return standard output of a script of sh(1) in the new system"""
        environment = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/root", "DEBIAN_FRONTEND": "noninteractive",
                       "LC_ALL": "C.UTF-8"}
        return output("chroot", cls.root, "sh", "-c", script, env=environment)

    def check_sample(self, said, instructions):
        """@return the largest displacement"""
        result = json.loads(said)
        self.assertTrue(result["ok"])
        self.assertEqual(result["instruction_set"], instructions)
        self.assertGreater(result["result"]["max_displacement_mm"], 0.1)
        return result["result"]["max_displacement_mm"]

    def test_the_sample_runs_with_both_libraries(self):
        flags = Path("/proc/cpuinfo").read_text().split("\nflags", 1)[1].split("\n", 1)[0].split()
        if not {"avx2", "fma", "bmi2"} <= set(flags):
            self.skipTest("needs a processor with AVX2")
        fast = self.check_sample(self.inside(SAMPLE), "x86-64-v3")
        # The dynamic linker is told to leave v3 alone.
        linker = "/lib64/ld-linux-x86-64.so.2 --glibc-hwcaps-mask x86-64-v2 /usr/bin/tunica-"
        said = self.inside(SAMPLE.replace("\ntunica-", "\n" + linker).replace("~/sample", "~/plain"))
        plain = self.check_sample(said, "x86-64")
        for mesh in ("surface.ply", "coarse.ply", "shell.ply"):
            fast_bytes, plain_bytes = ((self.root / "root" / folder / mesh).read_bytes() for folder in ("sample", "plain"))
            self.assertTrue(fast_bytes == plain_bytes, f"{mesh} differs between the two libraries")
        self.assertLess(abs(fast - plain) / plain, 1e-9)

    def test_a_processor_without_avx(self):
        if not shutil.which("qemu-x86_64"):
            self.skipTest("needs qemu-user")
        volume = self.root / "usr/share/doc/tunica/examples/tube.nii.gz"
        out = self.root / "root" / "qemu.ply"
        said = output("qemu-x86_64", "-cpu", "qemu64", "-L", self.root, self.root / "usr/bin/tunica-extract", volume, out,
                      "--label", "1", "--open-border", "--threads", "1", "--report", "-")
        self.assertEqual(json.loads(said)["instruction_set"], "x86-64")
        self.assertGreater(out.stat().st_size, 10000)

    def test_the_whole_pipeline_without_the_repository(self):
        self.inside("cd ~ && tunica-batch VOLUMES=/usr/share/doc/tunica/examples/aneurysm.nii.gz LABELS=1 SHELLS=200 OPEN=1"
                    " IMAGED_AT=0kPa PRESSURE=1kPa YOUNG=1MPa POISSON=0.45 THICKNESS=1.5mm FIX=boundary OUT=batch")
        self.assertEqual(json.loads((self.root / "root/batch/aneurysm/1/simulate.json").read_text())["ok"], True)
        self.assertIn("</html>", (self.root / "root/batch/report.html").read_text()[-100:])

    def test_somebody_elses_program(self):
        shutil.copytree(SOURCE / "tests" / "system" / "install" / "consumer", self.root / "root" / "consumer")
        self.inside("apt-get install -y -q --no-install-recommends g++ cmake make pkg-config")
        by_cmake = "cd ~/consumer && cmake -B build . > /dev/null && cmake --build build > /dev/null && build/consumer"
        by_pkg_config = ("cd ~/consumer && c++ -std=c++20 consumer.cpp $(pkg-config --cflags --libs tunica) -o other"
                         " && ./other")
        for script in (by_cmake, by_pkg_config):
            self.assertRegex(self.inside(script), r"^x86-64(-v3)? 0.1 MPa 6 mm2\n$")

    def test_zz_nothing_is_left_behind(self):
        self.inside("apt-get purge -y -q tunica libtunica-dev")
        self.assertEqual([path for path in (self.root / "usr").rglob("*tunica*")], [])


if __name__ == "__main__":
    unittest.main()
