"""Extraction against VTK's (discrete) flying edges, in turn in one run: ratios of medians.

    cmake --build --preset release --target bench_extract
    /usr/bin/python3 tests/bench/extract_bench.py build/release [ROUNDS]

On one thread the processor time is compared, which other programs on the machine disturb less than the wall time. The
gain by a second thread is given twice: by the wall, for a machine that is idle, and by the processor time of the calling
thread, which takes part in the work and waits for nothing but its end.

Both start with the voxels in memory and end with an indexed mesh in memory. VTK's time is that of Update() on a new
filter; its mesh has float coordinates and no closed ends, tunica's double ones. Debian's python3-vtk9 brings VTK."""
import os
import statistics
import subprocess
import sys
import tempfile
import time

import nibabel
import numpy
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonCore import vtkSMPTools
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D
from vtkmodules.vtkFiltersGeneral import vtkDiscreteFlyingEdges3D


def distance(n, kind):
    """Signed distance in voxels, positive inside; x runs fastest."""
    z, y, x = numpy.ogrid[0:n, 0:n, 0:n]
    c = (n - 1) / 2
    if kind == "sphere":
        return (0.4 * n - numpy.sqrt((x - c) ** 2 + (y - c) ** 2 + (z - c) ** 2)).astype(numpy.float32)
    # A bent vessel with a sac.
    u = (z - c) / n
    tube = 0.08 * n - numpy.sqrt((x - c - 0.2 * n * numpy.sin(4 * u)) ** 2 + (y - c) ** 2)
    sac = 0.16 * n - numpy.sqrt((x - c) ** 2 + (y - c - 0.12 * n) ** 2 + (z - c) ** 2)
    return numpy.maximum(tube, sac).astype(numpy.float32)


class Tunica:
    def __init__(self, build, path):
        self.child = subprocess.Popen([os.path.join(build, "tests/bench/bench_extract"), path], text=True,
                                      stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def run(self, rule, value, threads):
        self.child.stdin.write(f"{rule} {value} {threads}\n")
        self.child.stdin.flush()
        wall, cpu, calling, _, triangles = self.child.stdout.readline().split()
        return float(wall), float(cpu), int(triangles), float(calling)

    def close(self):
        self.child.stdin.close()
        self.child.wait()


def vtk_image(values):
    image = vtkImageData()
    image.SetDimensions(values.shape[2], values.shape[1], values.shape[0])
    image.GetPointData().SetScalars(numpy_to_vtk(values.ravel(), deep=True))
    return image


def run_vtk(image, rule, value, threads):
    vtkSMPTools.Initialize(threads)
    peer = vtkDiscreteFlyingEdges3D() if rule == "label" else vtkFlyingEdges3D()
    peer.SetInputData(image)
    peer.SetValue(0, value)
    peer.ComputeNormalsOff()
    peer.ComputeGradientsOff()
    peer.ComputeScalarsOff()
    wall, cpu = time.perf_counter(), time.process_time()
    peer.Update()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return 1e3 * wall, 1e3 * cpu, peer.GetOutput().GetNumberOfPolys()


def main():
    build = sys.argv[1]
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 7
    print(f"{'case':<20}{'triangles':>10}{'tunica ms':>11}{'VTK ms':>9}{'VTK / tunica':>14}"
          f"{'2 threads: VTK / tunica':>25}{'gain by wall':>14}{'by thread':>11}")
    for name, kind, n, rule, value in (("sphere 128 labels", "sphere", 128, "label", 1),
                                       ("sphere 256 labels", "sphere", 256, "label", 1),
                                       ("sphere 512 labels", "sphere", 512, "label", 1),
                                       ("vessel 256 labels", "vessel", 256, "label", 1),
                                       ("sphere 256 grey", "sphere", 256, "above", 1000.5),
                                       ("sphere 512 grey", "sphere", 512, "above", 1000.5),
                                       ("sphere 256 float", "sphere", 256, "above", 0.25),
                                       ("sphere 512 float", "sphere", 512, "above", 0.25)):
        values = distance(n, kind)
        if rule == "label":
            values = (values > 0).astype(numpy.uint8)
        elif value == 1000.5:
            values = (1000 + 20 * numpy.clip(values, -40, 40)).astype(numpy.int16)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "volume.nii")
            nibabel.save(nibabel.Nifti1Image(values.transpose(2, 1, 0), numpy.eye(4)), path)
            tunica = Tunica(build, path)
            tunica.run(rule, value, 1)  # reads the volume
        image = vtk_image(values)
        medians = {}
        for threads in (1, 2):
            ours, theirs = [], []
            for _ in range(rounds):
                ours.append(tunica.run(rule, value, threads))
                theirs.append(run_vtk(image, rule, value, threads))
            medians[threads] = [[statistics.median(run[column] for run in runs) for column in range(len(runs[0]))]
                                for runs in (ours, theirs)]
        (one, peer), (two, peer_two) = medians[1], medians[2]
        print(f"{name:<20}{one[2]:>10}{one[1]:>11.1f}{peer[1]:>9.1f}{peer[1] / one[1]:>14.1f}"
              f"{peer_two[0] / two[0]:>25.1f}{one[0] / two[0]:>14.2f}{one[1] / two[3]:>11.2f}", flush=True)
        tunica.close()


if __name__ == "__main__":
    main()
