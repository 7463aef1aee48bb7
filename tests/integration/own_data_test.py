#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Runs the guide of README.md, "Your own data", as it stands: own_data_test.py BIN_FOLDER [ROOT].

The guide is the first `bash` block of that section: at most six commands from a label map (ct-labels.nii.gz) and a
DICOM run (run.dcm) to an overlay and a simulated loop. They run one after the other in a temporary folder that holds
those two files and build/bin, and nothing else: a file that a person would have to write would be missing. The label
map is made here, of the coronary phantom's tree as tubes (label 1) in a body (label 2); the run is the phantom's.

Each command ends with exit code 0, the files that are named with --out, --overlay and the like exist afterwards, the
registration has converged, and the loop has come within 0.5 deg and 2 mm of its view. Python's standard library only.
"""
import csv
import gzip
import itertools
import json
import math
import pathlib
import re
import shlex
import struct
import subprocess
import sys
import tempfile

MAX_COMMANDS = 6
VOXEL_MM, RADIUS_MM, MARGIN_MM = 0.6, 1.5, 6.0
VESSEL, BODY = 1, 2
WRITES = {"--out", "--out-pose", "--overlay", "--picture", "--write-camera"}
PATIENCE_S = 600  # Of one command, on a busy host.


def guide(root):
    """The commands of the first bash block below the heading."""
    text = (root / "README.md").read_text(encoding="utf-8")
    section = text[text.index("\n## Your own data\n"):]
    block = re.search(r"```bash\n(.*?)```", section, re.S).group(1)
    return [line for line in block.splitlines() if line.strip() and not line.startswith("#")]


def write_label_map(tree_path, path):
    """A NIfTI-1 file of bytes. Its RAS axes are the tree's L, P, S with the first two turned round."""
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


def written(words):
    return [words[k + 1] for k, word in enumerate(words[:-1]) if word in WRITES]


def main():
    folder = pathlib.Path(sys.argv[1]).resolve()
    root = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else ".").resolve()
    phantom = root / "examples/data/static-phantom"
    lines = guide(root)
    assert 3 <= len(lines) <= MAX_COMMANDS, f"{len(lines)} commands, at most {MAX_COMMANDS}"
    with tempfile.TemporaryDirectory(prefix="angio-own-data-") as temporary:
        place = pathlib.Path(temporary)
        (place / "build").mkdir()
        (place / "build/bin").symlink_to(folder)
        (place / "run.dcm").symlink_to(phantom / "dicom/im5.dcm")
        write_label_map(phantom / "tree.csv", place / "ct-labels.nii.gz")

        # Without a label the map is no image: its labels are listed.
        asked = subprocess.run([folder / "angio-extract-tree", "ct-labels.nii.gz", "--out", "none.csv"], cwd=place,
                               capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        assert asked.returncode == 1 and re.search(r"label map.*1 \(.* ml\), 2 \(.* ml\)", asked.stderr), asked.stderr
        assert not (place / "none.csv").exists()

        used = set()
        for line in lines:
            words = shlex.split(line, comments=True)
            used.add(pathlib.Path(words[0]).name)
            done = subprocess.run(["bash", "-c", line], cwd=place, stdin=subprocess.DEVNULL, timeout=PATIENCE_S,
                                  capture_output=True, text=True, errors="replace", check=False)
            print(f"$ {line}\n{done.stdout}{done.stderr}", flush=True)
            assert done.returncode == 0, f"exit code {done.returncode}: {line}"
            for file in written(words):
                assert (place / file).exists(), f"{file} is named, and not written: {line}"
            if words[0].endswith("angio-register"):
                assert "converged" in done.stdout, done.stdout
            if words[0].endswith("angio-servo"):
                summary = json.loads((place / words[words.index("--out") + 1] / "summary.json").read_text())
                error = summary["final_error"]["closed_loop"]
                assert error["view_deg"] < 0.5 and error["target_mm"] < 2, summary
        for program in ("angio-extract-tree", "angio-register", "angio-servo"):
            assert program in used, f"{program} is not in the guide"
    return 0


if __name__ == "__main__":
    sys.exit(main())
