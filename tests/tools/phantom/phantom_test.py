"""tunica-phantom as its users run it: files read by other programs, samples made again, errors with their codes."""
import gzip
import os
import unittest

import nibabel
import numpy
import vtk
from running import SOURCE, ToolTest
from vtk.util.numpy_support import vtk_to_numpy

SAMPLES = SOURCE / "data-samples"


class Phantom(ToolTest):
    verb = "phantom"

    def test_samples_are_what_their_readme_says(self):
        with open(os.path.join(SAMPLES, "README.md")) as file:
            commands = [line.split() for line in file if line.startswith("tunica-phantom ")]
        made = set()
        for command in commands:
            self.run_tool(*command[1:], "--quiet")
            shipped = os.path.join(SAMPLES, command[2])
            if not os.path.exists(shipped):
                continue  # a part of one that is
            made.add(command[2])
            self.assertLess(os.path.getsize(shipped), 100000)
            with open(shipped, "rb") as file:
                self.assertEqual(file.read(10)[4:8], b"\0\0\0\0", "no time stamp")
            with gzip.open(shipped) as a, gzip.open(self.path(command[2])) as b:
                self.assertEqual(a.read(), b.read(), command)
        self.assertEqual(made, {name for name in os.listdir(SAMPLES) if name.endswith(".gz")})

    def test_truth_encloses_the_voxels_that_other_programs_read(self):
        for shape, spacing in [("sphere", (1, 1, 1)), ("bladder", (0.8, 0.8, 2.5)), ("aneurysm", (0.5, 0.5, 0.5))]:
            text = ",".join(map(str, spacing))
            result = self.run_tool(shape, "v.nii.gz", "--size", 56, "--spacing", text, "--truth", "t.ply", "--force",
                                   "--quiet")["result"]
            image = nibabel.load(self.path("v.nii.gz"))
            voxels = numpy.asarray(image.dataobj)
            self.assertEqual(max(voxels.shape), 56)
            self.assertEqual(list(voxels.shape), result["dims"])
            self.assertEqual(set(numpy.unique(voxels)), {0, 1})
            self.assertEqual(int(voxels.sum()), result["voxels"])
            numpy.testing.assert_allclose(image.header.get_zooms(), spacing, rtol=1e-6)

            reader = vtk.vtkPLYReader()
            reader.SetFileName(self.path("t.ply"))
            reader.Update()
            truth = reader.GetOutput()
            self.assertEqual(truth.GetNumberOfCells(), result["truth_triangles"])
            # The file is LPS, nibabel's affine RAS.
            points = vtk_to_numpy(truth.GetPoints().GetData()) * [-1, -1, 1]
            inside = numpy.argwhere(voxels) @ image.affine[:3, :3].T + image.affine[:3, 3]
            reach = 0.51 * numpy.array(spacing)
            self.assertTrue((inside.min(0) >= points.min(0) - 1e-3).all())
            self.assertTrue((inside.max(0) <= points.max(0) + 1e-3).all())
            self.assertTrue((inside.min(0) - points.min(0) <= 2 * reach).all())
            self.assertAlmostEqual(result["voxel_volume_mm3"] / result["truth_volume_mm3"], 1, delta=0.02)
            if shape != "aneurysm":
                inside_test = vtk.vtkSelectEnclosedPoints()
                cloud = vtk.vtkPolyData()
                sample = vtk.vtkPoints()
                every = [(i, j, k) for k in range(0, voxels.shape[2], 5) for j in range(0, voxels.shape[1], 5)
                         for i in range(0, voxels.shape[0], 5)]
                for index in every:
                    world = image.affine[:3, :3] @ index + image.affine[:3, 3]
                    sample.InsertNextPoint(world * [-1, -1, 1])
                cloud.SetPoints(sample)
                inside_test.SetInputData(cloud)
                inside_test.SetSurfaceData(truth)
                inside_test.SetTolerance(1e-9)
                inside_test.Update()
                wrong = sum(inside_test.IsInside(n) != voxels[index] for n, index in enumerate(every))
                self.assertLessEqual(wrong, 1)

    def test_noise_is_the_seed_s_and_the_truth_does_not_see_it(self):
        def run(seed, noise):
            self.run_tool("capsule", "v.nii", "--size", 40, "--noise", noise, "--seed", seed, "--truth", "t.ply",
                          "--force", "--quiet")
            with open(self.path("v.nii"), "rb") as volume, open(self.path("t.ply"), "rb") as truth:
                return volume.read(), truth.read().split(b"end_header", 1)[1]

        first, truth = run(1, 0.3)
        self.assertEqual(run(1, 0.3), (first, truth))
        second, same_truth = run(2, 0.3)
        self.assertNotEqual(first, second)
        self.assertEqual(truth, same_truth)
        self.assertNotEqual(run(1, 0)[0], first)

    def test_errors_have_their_codes_and_say_what_to_do(self):
        for arguments, word in [(["spleen", "a.nii.gz"], "choose sphere"),
                                (["sphere", "a.nii.gz", "--size", "3"], "16 to 4096"),
                                (["sphere", "a.nii.gz", "--spacing", "1,2"], "--spacing"),
                                (["sphere", "a.nii.gz", "--spacing", "1mm"], "--spacing"),
                                (["sphere", "a.nii.gz", "--spacing", "1,0,1"], "spacing"),
                                (["sphere", "a.nii.gz", "--noise", "2"], "0 to 1"),
                                (["sphere", "a.nii.gz", "--sise", "20"], "sise"),
                                (["sphere"], "OUT")]:
            self.run_tool(*arguments, code=2, says=word)
            self.assertEqual(os.listdir(self.folder), [])
        self.run_tool("sphere", "a.nii.gz", "--size", 16, "--quiet")
        self.run_tool("sphere", "a.nii.gz", "--size", 16, code=5, says="--force")
        self.run_tool("sphere", "no/such/folder/a.nii.gz", code=5)


if __name__ == "__main__":
    unittest.main()
