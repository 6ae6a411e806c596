#!/usr/bin/python3
"""make -f Makefile.pipeline tarball: the sources and nothing else, the same bytes from the same commit."""

import os
import shutil
import subprocess
import tarfile
import tempfile
import time
import unittest
from pathlib import Path

SOURCE = Path(os.environ["TUNICA_SOURCE"])


class Tarball(unittest.TestCase):
    def test_twice_the_same(self):
        if not shutil.which("git") or not (SOURCE / ".git").exists():
            self.skipTest("needs git, and the sources as a repository")
        with tempfile.TemporaryDirectory(prefix="tunica-test-") as folder:
            made = []
            for name in ("one", "two"):
                copy = Path(folder) / name
                subprocess.run(["git", "-c", "safe.directory=*", "clone", "-q", "--depth", "1", f"file://{SOURCE}", copy],
                               check=True)
                (copy / "lib" / "uncommitted.cpp").write_text("\n")
                subprocess.run(["make", "-s", "-f", "Makefile.pipeline", "tarball"], cwd=copy, check=True, capture_output=True)
                made.append(next((copy / "build").glob("tunica-*.tar.gz")))
                self.assertEqual([path.name for path in (copy / "build").iterdir()], [made[-1].name])
                time.sleep(1.1)
            self.assertEqual(made[0].read_bytes(), made[1].read_bytes())
            with tarfile.open(made[0]) as archive:
                names = archive.getnames()
            root = made[0].name.removesuffix(".tar.gz")
            self.assertEqual({name.split("/")[0] for name in names}, {root})
            for name in ("CMakeLists.txt", "debian/rules", "lib/core/types.hpp", "data-samples/tube.nii.gz"):
                self.assertIn(f"{root}/{name}", names)
            self.assertNotIn(f"{root}/lib/uncommitted.cpp", names)


if __name__ == "__main__":
    unittest.main()
