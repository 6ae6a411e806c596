"""Where the voxels of a NIfTI file lie: as nibabel has it, to the last bit."""
import unittest

import nibabel
import numpy as np
from meshes import Ply
from running import ToolTest
from volumes import LPS

UNITS = {"mm": 1.0, "meter": 1000.0, "micron": 0.001}


def nifti1_io(header):
    """nifti_quatern_to_mat44() of the reference library, which ITK uses."""
    b, c, d = (float(header[name]) for name in ("quatern_b", "quatern_c", "quatern_d"))
    a = 1 - (b * b + c * c + d * d)
    if a < 1e-7:
        a, norm = 0, 1 / np.sqrt(b * b + c * c + d * d)
        b, c, d = b * norm, c * norm, d * norm
    else:
        a = np.sqrt(a)
    x, y, z = (float(value) for value in header["pixdim"][1:4])
    z *= -1 if header["pixdim"][0] < 0 else 1
    return np.array([
        [(a * a + b * b - c * c - d * d) * x, 2 * (b * c - a * d) * y, 2 * (b * d + a * c) * z, header["qoffset_x"]],
        [2 * (b * c + a * d) * x, (a * a + c * c - b * b - d * d) * y, 2 * (c * d - a * b) * z, header["qoffset_y"]],
        [2 * (b * d - a * c) * x, 2 * (c * d + a * b) * y, (a * a + d * d - c * c - b * b) * z, header["qoffset_z"]]])


class Geometry(ToolTest):
    verb = "extract"

    def volume(self, kind, random, quaternion=None, both=False):
        """A volume with one voxel of label 1 and a header of random numbers."""
        values = np.zeros((5, 4, 3), np.uint8)
        values[2, 1, 1] = 1
        image = kind(values, np.eye(4))
        header = image.header
        header.set_xyzt_units(str(random.choice(list(UNITS))))
        header["pixdim"][:4] = [random.choice([-1, 1]), *random.uniform(0.1, 3, 3)]
        header["qoffset_x"], header["qoffset_y"], header["qoffset_z"] = random.uniform(-300, 300, 3)
        q = random.normal(size=4) if quaternion is None else np.array(quaternion, float)
        q /= np.linalg.norm(q) * (1 if q[0] >= 0 else -1)
        header["quatern_b"], header["quatern_c"], header["quatern_d"] = q[1:]
        header["sform_code"] = int(both)
        header["qform_code"] = int(random.integers(1, 5))
        if both:  # also sheared and mirrored
            for name in ("srow_x", "srow_y", "srow_z"):
                header[name] = [*random.uniform(-2, 2, 3), random.uniform(-300, 300)]
        # nibabel's own writing would make the codes and the affine anew.
        path = self.folder / "volume.nii"
        header["magic"] = header.single_magic
        header["vox_offset"] = 352 if kind is nibabel.Nifti1Image else 544
        with open(path, "wb") as file:
            file.write(header.binaryblock + bytes(4) + values.tobytes(order="F"))
        return path, nibabel.load(path).header

    def check(self, path, expected, *more):
        info = self.run_tool(path, "--info", *more)["result"]
        ours = np.array(info["voxel_to_world_mm"])
        np.testing.assert_array_equal(ours, expected[:3])
        return info

    def test_random_headers_of_both_versions(self):
        random = np.random.default_rng(7)
        for trial in range(40):
            kind = nibabel.Nifti1Image if trial % 2 == 0 else nibabel.Nifti2Image
            both = trial % 4 >= 2
            path, header = self.volume(kind, random, both=both)
            unit = UNITS[header.get_xyzt_units()[0]]
            scale = LPS @ np.diag([unit, unit, unit, 1])
            best = header.get_best_affine()
            np.testing.assert_array_equal(best, header.get_sform() if both else header.get_qform())
            best[:3] *= unit
            with self.subTest(trial=trial, version=kind.__name__, both=both):
                self.check(path, LPS @ best)
                quaternion = header.get_qform()
                quaternion[:3] *= unit
                self.check(path, LPS @ quaternion, "--prefer-qform")
                np.testing.assert_allclose(quaternion[:3], unit * nifti1_io(header), rtol=0, atol=1e-11 * unit)
                if abs(np.linalg.det(best)) < 1e-3 * unit**3:
                    continue
                # One voxel becomes six corners, half a voxel from its middle along each axis.
                self.run_tool(path, "one.ply", "--label", "1", "--force")
                corners = Ply(self.folder / "one.ply").vertices
                indices = np.array([2, 1, 1]) + 0.5 * np.vstack([np.eye(3), -np.eye(3)])
                there = indices @ (LPS @ best)[:3, :3].T + (LPS @ best)[:3, 3]
                order = [np.linalg.norm(corners - place, axis=1).argmin() for place in there]
                self.assertEqual(sorted(order), list(range(6)))
                largest = np.abs(scale @ best).max()
                np.testing.assert_allclose(corners[order], there, rtol=0, atol=1e-12 * largest + 1e-12)

    def test_half_turns_are_those_of_the_reference_library(self):
        """A float quaternion of a half turn is no unit one to the last bit: nibabel turns by the root of what is left
        (up to 0.04 degrees), nifti1_io.c and ITK by nothing; so do we."""
        random = np.random.default_rng(11)
        for axis in ((1, 1, 0), (1, 2, 3), (0.3, 0.1, 1)):
            for kind in (nibabel.Nifti1Image, nibabel.Nifti2Image):
                path, header = self.volume(kind, random, quaternion=(1e-4, *axis))
                unit = UNITS[header.get_xyzt_units()[0]]
                info = self.run_tool(path, "--info")["result"]
                ours = LPS[:3, :3] @ np.array(info["voxel_to_world_mm"])
                np.testing.assert_allclose(ours, unit * nifti1_io(header), rtol=0, atol=1e-12 * unit * 300)
                np.testing.assert_allclose(ours, unit * header.get_qform()[:3], rtol=0, atol=3e-3 * unit)


if __name__ == "__main__":
    unittest.main()
