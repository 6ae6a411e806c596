#!/usr/bin/python3
"""combine.py OUT.seg.nrrd NAME=VOLUME.nii.gz ...: segmentations side by side, as the named segments of one image."""

import gzip
import sys

import nibabel
import numpy

GAP = 2  # voxels between the boxes of two organs

out, organs = sys.argv[1], [argument.split("=", 1) for argument in sys.argv[2:]]
masks = [numpy.asarray(nibabel.load(path).dataobj) > 0 for _, path in organs]
size = [sum(mask.shape[0] + GAP for mask in masks) - GAP, *(max(mask.shape[axis] for mask in masks) for axis in (1, 2))]
labels = numpy.zeros(size, numpy.uint8, order="F")
start = 0
for number, mask in enumerate(masks, 1):
    labels[start:start + mask.shape[0], :mask.shape[1], :mask.shape[2]][mask] = number
    start += mask.shape[0] + GAP
mm = abs(nibabel.load(organs[0][1]).affine.diagonal()[:3])
header = ["NRRD0004", "type: uint8", "dimension: 3", "space: left-posterior-superior", "sizes: " + " ".join(map(str, size)),
          f"space directions: ({mm[0]:g},0,0) (0,{mm[1]:g},0) (0,0,{mm[2]:g})", "kinds: domain domain domain",
          "encoding: gzip", "space origin: (0,0,0)"]
for number, (name, _) in enumerate(organs):
    header += [f"Segment{number}_ID:=Segment_{number + 1}", f"Segment{number}_Name:={name}",
               f"Segment{number}_LabelValue:={number + 1}", f"Segment{number}_Layer:=0"]
with open(out, "wb") as file:
    file.write("\n".join(header).encode() + b"\n\n" + gzip.compress(labels.tobytes(order="F"), 9, mtime=0))
