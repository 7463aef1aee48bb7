#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Makes tree.csv of the published skeleton volume (Skeleton3D_P23.mat): make_tree.py SKELETON.mat > tree.csv

The volume is 512^3 of uint8, column-major, as MATLAB 5 writes it; voxels of 0.452607 mm. Neighbouring voxels (26) are
joined by a minimum spanning tree. y is mirrored, so that the published projection, which counts rows before columns, is
a pinhole camera without a mirror. The radius is not published: 3 mm stands for it.
"""
import heapq
import struct
import sys
import zlib

SIDE, VOXEL_MM, RADIUS_MM = 512, 0.452607, 3

data = open(sys.argv[1], "rb").read()
size = struct.unpack("<I", data[132:136])[0]
unpacked = zlib.decompress(data[136:136 + size])
volume = unpacked[len(unpacked) - SIDE**3:]

voxels, place = set(), volume.find(b"\x01")
while place >= 0:
    voxels.add((place % SIDE + 1, place // SIDE % SIDE + 1, place // SIDE**2 + 1))
    place = volume.find(b"\x01", place + 1)


def neighbours(v):
    steps = [(a, b, c) for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1) if a or b or c]
    return [w for w in ((v[0] + a, v[1] + b, v[2] + c) for a, b, c in steps) if w in voxels]


root = max((v for v in voxels if len(neighbours(v)) == 1), key=lambda v: v[2])
number, heap = {}, [(0, root, None)]
print("id,x_mm,y_mm,z_mm,radius_mm,parent")
while heap:
    _, v, parent = heapq.heappop(heap)
    if v in number:
        continue
    number[v] = len(number)
    x, y, z = ((c - SIDE / 2) * VOXEL_MM for c in v)
    print("%d,%.4f,%.4f,%.4f,%g,%d" % (number[v], x, -y, z, RADIUS_MM, -1 if parent is None else number[parent]))
    for w in neighbours(v):
        if w not in number:
            heapq.heappush(heap, (sum((a - b)**2 for a, b in zip(v, w)), w, v))
