"""What outputs say of what made them: the same bytes whatever the threads and the output's name; no names of patients
with --no-paths."""
import io
import json
import struct
import unittest
import zipfile
import zlib

import h5py
import nibabel
from running import ToolTest

PATIENT = "Miller"


def png_comment(data):
    """The chunks of a PNG, their checksums checked; @return the text of its iTXt"""
    at, text = 8, None
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        assert struct.unpack(">I", data[at + 8 + length:at + 12 + length])[0] == zlib.crc32(kind + body)
        if kind == b"iTXt":
            keyword, rest = body.split(b"\0", 1)
            assert keyword == b"Comment" and rest[:4] == b"\0\0\0\0"
            text = rest[4:].decode()
        at += 12 + length
    return text


def model_of_3mf(data):
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return archive.read("3D/3DModel.model")


class Provenance(ToolTest):
    def pipeline(self, folder, case, *common):
        """Every tool once, in `folder`; files are called by `case`."""
        def run(verb, *words):
            self.run_tool(verb, *words, *common, "--quiet", "--force", folder=folder, report=f"{case}-{verb}.json")

        exports = [word for name in ("pvd", "xmf", "inp", "feb", "glb", "obj", "stl", "3mf")
                   for word in ("--export", name)]
        run("phantom", "bladder", f"{case}.nii.gz", "--size", "24", "--spacing", "2", "--truth", f"{case}-truth.ply")
        run("extract", f"{case}.nii.gz", f"{case}-surface.ply", "--label", "1", "--smooth", "staircase")
        for ending in ("glb", "obj", "stl", "3mf"):
            run("extract", f"{case}.nii.gz", f"{case}-surface.{ending}", "--label", "1")
        run("decimate", f"{case}-surface.ply", f"{case}-coarse.ply", "--triangles", "120")
        run("relax", f"{case}-coarse.ply", f"{case}-surface.ply", f"{case}-shell.ply", "--map", f"{case}-map.ply",
            "--picture", f"{case}-map.png", "--curved", f"{case}-curved.ply")
        run("compare", f"{case}-shell.ply", f"{case}-surface.ply", "--shell", "--picture", f"{case}-compare.png",
            "--map", f"{case}-compare.ply")
        run("simulate", f"{case}-shell.ply", f"{case}-result.hdf", "--young", "1MPa", "--poisson", "0.45",
            "--thickness", "2mm", "--pressure", "1kPa", "--fix", "rigid-motions", "--static", *exports)
        run("chart", f"{case}-relax.json", "-o", f"{case}-chart.svg", "--csv", f"{case}-chart.csv", "--x",
            "result.shells", "--y", "result.hausdorff_percent.upper", "--label", "file")

    def made_in(self, name):
        folder = self.folder / name
        folder.mkdir()
        return folder

    def test_same_bytes_with_one_and_two_threads_in_another_folder_and_every_output_says_what_made_it(self):
        made = []
        for threads in ("1", "2"):
            folder = self.made_in(threads)
            self.pipeline(folder, "case", "--threads", threads)
            made.append({path.name: path.read_bytes() for path in folder.iterdir() if path.suffix != ".json"})
        self.assertEqual(set(made[0]), set(made[1]))
        self.assertGreater(len(made[0]), 18)
        self.run_tool("extract", "--version", report=False)
        version = self.done.stdout.split()[1]
        for name, data in made[0].items():
            with self.subTest(name=name):
                if not name.endswith(".csv"):  # which tells the whole command of every run
                    self.assertEqual(data, made[1][name])
                if name.endswith(".png"):
                    data = png_comment(data).encode()
                elif name.endswith(".nii.gz"):
                    data = nibabel.load(folder / name).header.extensions[0].get_content()
                elif name.endswith(".3mf"):
                    data = model_of_3mf(data)
                tool = (name.split(".")[0].split("-") + ["phantom"])[1]
                verb = {"surface": "extract", "coarse": "decimate", "compare": "compare", "result": "simulate",
                        "result_0000": "simulate", "result_0001": "simulate", "chart": "chart", "phantom": "phantom",
                        "truth": "phantom"}.get(tool, "relax")
                said = data if isinstance(data, bytes) else data.encode()
                if not name.endswith(".stl"):  # which has 80 bytes
                    self.assertIn(f"tunica-{verb} ".encode(), said)
                self.assertIn(f"tunica {version}".encode(), said)
                for word in (b"--threads", b"--report", b"--force") if not name.endswith(".csv") else ():
                    self.assertNotIn(word, said)

    def test_the_output_may_have_any_name(self):
        folder = self.made_in("names")
        self.pipeline(folder, "case")
        for out in ("case-coarse.ply", "other.ply"):
            self.run_tool("decimate", "case-surface.ply", out, "--triangles", "120", "--force", folder=folder)
        self.assertEqual((folder / "other.ply").read_bytes(), (folder / "case-coarse.ply").read_bytes())

    def test_no_paths(self):
        folder = self.made_in(PATIENT)
        self.pipeline(folder, PATIENT, "--no-paths")
        paths = sorted(folder.iterdir())
        self.assertGreater(len(paths), 25)
        for path in paths:
            data = path.read_bytes()
            if path.name.endswith(".nii.gz"):
                data = nibabel.load(path).header.extensions[0].get_content()
                data = data.encode() if isinstance(data, str) else data
            elif path.suffix == ".3mf":
                data = model_of_3mf(data)
            elif path.suffix in (".pvd", ".xmf"):
                continue  # they refer to the files beside them
            self.assertNotIn(PATIENT.encode(), data, path.name)
            self.assertNotIn(str(self.folder).encode(), data, path.name)
        report = json.loads((folder / f"{PATIENT}-relax.json").read_text(encoding="utf-8"))
        self.assertEqual([item["path"] for item in report["inputs"]], ["input1.ply", "input2.ply"])
        self.assertTrue(all(item["sha256"] for item in report["inputs"]))
        self.assertIn("tunica-relax", report["command"])
        with h5py.File(folder / f"{PATIENT}-result.hdf") as file:
            self.assertIn(b"input1.ply", file["tunica/scene"][()])
            self.assertEqual(file["tunica/inputs/path"][0], b"input1.ply")

    def test_no_paths_when_a_run_fails(self):
        folder = self.made_in(PATIENT)
        for words in (["missing.nii.gz", f"{PATIENT}.ply", "--label", "1"], [f"{folder}/{PATIENT}.nii.gz", "--info"],
                      [f"{PATIENT}.nii.gz", f"{PATIENT}.ply", "--label", "one"],
                      [f"{PATIENT}.nii.gz", f"{PATIENT}.ply", "--labell=1"]):
            report = self.run_tool("extract", *words, "--no-paths", folder=folder, code=(2, 3))
            self.assertNotIn(PATIENT, json.dumps(report))

    def test_no_paths_of_what_files_and_folders_name(self):
        """A folder that is missing, a table beside the volume, the data of a header."""
        folder = self.made_in(PATIENT)
        self.run_tool("phantom", "sphere", folder / f"{PATIENT}.nii.gz", "--size", "20")
        volume = f"{PATIENT}.nii.gz"
        report = self.run_tool("extract", volume, f"{PATIENT}-folder/s.ply", "--label", "1", "--no-paths", folder=folder, code=5,
                               says="does not exist")
        self.assertNotIn(PATIENT, json.dumps(report))
        (folder / f"{PATIENT}.csv").write_text("no table\n", encoding="utf-8")
        report = self.run_tool("extract", volume, "s.ply", "--label", "1", "--no-paths", folder=folder)
        self.assertIn("no line of a table of labels", " ".join(report["warnings"]))
        self.assertNotIn(PATIENT, json.dumps(report))
        (folder / "v.nhdr").write_text("NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n"
                                       f"data file: {PATIENT}.raw\n", encoding="utf-8")
        report = self.run_tool("extract", "v.nhdr", "t.ply", "--label", "1", "--no-paths", folder=folder, code=3, says="is missing")
        self.assertNotIn(PATIENT, json.dumps(report))


if __name__ == "__main__":
    unittest.main()
