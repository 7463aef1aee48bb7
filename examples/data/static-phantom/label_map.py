#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Writes what a segmentation of a CT of the phantom would be: label_map.py OUT.nii.gz.

The vessels of tree.csv beside this file, as tubes with a radius of 1.5 mm, are label 1; the box around them, 6 mm wider
on all sides, is the body, label 2. Voxels of 0.6 mm, in or out. Python's standard library only.
"""
import csv
import gzip
import itertools
import math
import pathlib
import struct
import sys

VOXEL_MM, RADIUS_MM, MARGIN_MM = 0.6, 1.5, 6.0
VESSEL, BODY = 1, 2


def write_label_map(tree_path, path):
    """A NIfTI-1 file (.nii.gz) of bytes. Its RAS axes are the tree's L, P, S with the first two turned round."""
    with open(tree_path, encoding="utf-8", newline="") as file:
        rows = {row["id"]: row for row in csv.DictReader(file)}
    at = {key: [float(row[c]) for c in ("x_mm", "y_mm", "z_mm")] for key, row in rows.items()}
    low = [min(p[k] for p in at.values()) - MARGIN_MM for k in range(3)]
    high = [max(p[k] for p in at.values()) + MARGIN_MM for k in range(3)]
    size = [math.ceil((high[k] - low[k]) / VOXEL_MM) + 1 for k in range(3)]
    voxels = bytearray([BODY]) * (size[0] * size[1] * size[2])
    reach = math.ceil(RADIUS_MM / VOXEL_MM)
    steps = list(itertools.product(range(-reach, reach + 1), repeat=3))
    for key, row in rows.items():
        if row["parent"] == "-1":
            continue
        a, b = at[row["parent"]], at[key]
        parts = math.ceil(math.dist(a, b) / VOXEL_MM)
        for part in range(parts + 1):
            p = [(a[k] + (b[k] - a[k]) * part / max(parts, 1) - low[k]) / VOXEL_MM for k in range(3)]
            middle = [round(x) for x in p]
            for step in steps:
                v = [middle[k] + step[k] for k in range(3)]
                if math.dist(v, p) * VOXEL_MM <= RADIUS_MM:
                    voxels[v[0] + size[0] * (v[1] + size[1] * v[2])] = VESSEL
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, *size, 1, 1, 1, 1)
    struct.pack_into("<2h", header, 70, 2, 8)  # Bytes.
    struct.pack_into("<4f", header, 76, 1, VOXEL_MM, VOXEL_MM, VOXEL_MM)
    struct.pack_into("<3f", header, 108, 352, 1, 0)
    header[123] = 2  # Millimetres.
    struct.pack_into("<2h", header, 252, 0, 1)
    struct.pack_into("<12f", header, 280, -VOXEL_MM, 0, 0, -low[0], 0, -VOXEL_MM, 0, -low[1], 0, 0, VOXEL_MM, low[2])
    header[344:348] = b"n+1\0"
    path.write_bytes(gzip.compress(bytes(header) + bytes(voxels), 1))


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit("label_map.py OUT.nii.gz")
    write_label_map(pathlib.Path(__file__).resolve().parent / "tree.csv", pathlib.Path(sys.argv[1]))
