"""Extraction against VTK's (discrete) flying edges, in turn in one run: ratios of medians.

    cmake --build --preset release --target bench_extract
    /usr/bin/python3 tests/bench/extract_bench.py build/release [--rounds N] [--out docs/tables/extraction.md]

On one thread the processor time is compared, which other programs on the machine disturb less than the wall time.

Both start with the voxels in memory and end with an indexed mesh in memory. VTK's time is that of Update() on a new
filter; its mesh has float coordinates and no closed ends, tunica's double ones. Debian's python3-vtk9 brings VTK."""
import argparse
import os
import statistics
import subprocess
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
        wall, cpu, triangles = self.child.stdout.readline().split()
        return float(wall), float(cpu), int(triangles)

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


CASES = (("ball in 128³, label", "sphere", 128, "label", 1), ("ball in 256³, label", "sphere", 256, "label", 1),
         ("ball in 512³, label", "sphere", 512, "label", 1), ("vessel in 256³, label", "vessel", 256, "label", 1),
         ("ball in 256³, 16-bit values", "sphere", 256, "above", 1000.5),
         ("ball in 512³, 16-bit values", "sphere", 512, "above", 1000.5),
         ("ball in 256³, float", "sphere", 256, "above", 0.25), ("ball in 512³, float", "sphere", 512, "above", 0.25))
INTRODUCTION = """From voxels in memory to an indexed mesh in memory, in turn in one run, medians. VTK: flying edges for values,
discrete flying edges for labels. One thread: processor time. Two threads: ratio of wall times, and what the second one gains.

| volume | triangles | tunica, ms | VTK, ms | VTK / tunica | the same with two threads | gain by the second: tunica | VTK |
|---|---|---|---|---|---|---|---|"""


def voxels(kind, n, rule, value):
    values = distance(n, kind)
    if rule == "label":
        return (values > 0).astype(numpy.uint8)
    return (1000 + 20 * numpy.clip(values, -40, 40)).astype(numpy.int16) if value == 1000.5 else values


def row(build, name, kind, n, rule, value, rounds):
    values = voxels(kind, n, rule, value)
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
        medians[threads] = [[statistics.median(run[column] for run in runs) for column in range(3)]
                            for runs in (ours, theirs)]
    tunica.close()
    (one, peer), (two, peer_two) = medians[1], medians[2]
    return (f"| {name} | {one[2]:,} | {one[1]:.1f} | {peer[1]:.1f} | {peer[1] / one[1]:.1f} | {peer_two[0] / two[0]:.1f} "
            f"| {one[0] / two[0]:.2f} | {peer[0] / peer_two[0]:.2f} |")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("build")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--out")
    options = parser.parse_args()
    lines = [INTRODUCTION]
    for case in CASES:
        lines.append(row(options.build, *case, options.rounds))
        print(lines[-1], flush=True)
    if options.out:
        with open(options.out, "w", encoding="utf-8") as file:
            file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
