#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""How well angio-extract-centerline sees real coronary angiograms whose vessels were marked by hand.

    examples/marked_angiograms.py build/bin/angio-extract-centerline arcade-sample/images

Prints, for the half that was tuned on / the others: main vessels covered within 5 px, thin ones within 4 px, what is
found farther than 10 px from anything marked, and the part of catheters' length that is kept as a vessel, or told as a
device. The images as they are, and harder ones made of them. Debian: python3-numpy, python3-pil.
"""
import argparse
import csv
import json
import pathlib
import subprocess
import tempfile

import numpy as np
import PIL.Image

MARKS = pathlib.Path(__file__).parent / "data/arcade-marks/marks.json"


def enlarged(image, random):
    """Twice the side by linear interpolation, with noise of 9 grey levels a pixel."""
    at = (np.arange(2 * len(image)) + 0.5) / 2 - 0.5
    low = np.clip(np.floor(at).astype(int), 0, len(image) - 2)
    part = np.clip(at - low, 0, 1)
    rows = image[low] * (1 - part)[:, None] + image[low + 1] * part[:, None]
    both = rows[:, low] * (1 - part) + rows[:, low + 1] * part
    return both + random.normal(0, 9, both.shape)


VARIANTS = {
    "as they are": (1, lambda image, random: image),
    "enlarged, noise": (2, enlarged),
    "noise": (1, lambda image, random: image + random.normal(0, 9, image.shape)),
    "low contrast": (1, lambda image, random: 128 + 0.4 * (image - image.mean())),
}


def points_of(lines):
    """A point a pixel along each line, N x 2."""
    parts = [np.zeros((0, 2))]
    for line in lines:
        line = np.asarray(line, float)
        for a, b in zip(line[:-1], line[1:]):
            steps = max(1, int(np.ceil(np.hypot(*(b - a)))))
            parts.append(a + (b - a) * np.arange(steps)[:, None] / steps)
    return np.vstack(parts)


def distances(points, others):
    """Of each point from the nearest of the others [px]."""
    if len(others) == 0:
        return np.full(len(points), np.inf)
    blocks = np.array_split(points, max(1, len(points) // 500))
    return np.concatenate([np.sqrt(((b[:, None] - others[None]) ** 2).sum(2).min(1)) for b in blocks if len(b)] or [[]])


def read_lines(path, scale):
    if not path.exists():
        return []
    branches = {}
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            at = ((float(row["x_px"]) + 0.5) / scale - 0.5, (float(row["y_px"]) + 0.5) / scale - 0.5)
            branches.setdefault(row["branch"], []).append(at)
    return list(branches.values())


def counted(program, image, marks, scale, folder):
    """What of what is as asked: pairs (so many, of so many)."""
    picture, line, devices = folder / "image.png", folder / "line.csv", folder / "devices.csv"
    for old in (line, devices):
        old.unlink(missing_ok=True)
    PIL.Image.fromarray(np.clip(np.rint(image), 0, 255).astype(np.uint8)).save(picture)
    subprocess.run([program, picture, "--out", line, "--devices", devices], stdout=subprocess.PIPE, check=True)
    found, device = points_of(read_lines(line, scale)), points_of(read_lines(devices, scale))
    marked = {kind: points_of(lines) for kind, lines in marks.items()}
    vessels = np.vstack([marked["main"], marked["thin"]])
    catheter = marked["device"][distances(marked["device"], vessels) > 8]
    far = distances(found, np.vstack([vessels, marked["maybe"], marked["device"]])) > 10
    near = {"main": (marked["main"], found, 5), "thin": (marked["thin"], found, 4),
            "catheter kept": (catheter, found, 4), "catheter told": (catheter, device, 4),
            "artery called a device": (marked["main"], device, 4), "lead kept": (marked["lead"], found, 4)}
    counts = {name: ((distances(p, q) <= px).sum(), len(p)) for name, (p, q, px) in near.items()}
    counts["far"] = (far.sum(), len(found))
    return counts


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("images", type=pathlib.Path)
    options = parser.parse_args()
    marks = json.loads(MARKS.read_text())
    names = sorted(marks)
    columns = ["main", "thin", "far", "catheter kept", "catheter told", "artery called a device", "lead kept"]
    print("| images | " + " | ".join(columns) + " |\n|" + " --- |" * (len(columns) + 1))
    with tempfile.TemporaryDirectory() as folder:
        for variant, (scale, made) in VARIANTS.items():
            random = np.random.default_rng(1)
            counts = []
            for name in names:
                with PIL.Image.open(options.images / f"{name}.png") as file:
                    image = np.asarray(file.convert("L"), float)
                counts.append(counted(options.program, made(image, random), marks[name], scale, pathlib.Path(folder)))
            cells = []
            for column in columns:
                shares = [100 * sum(c[column][0] for c in half) / max(1, sum(c[column][1] for c in half))
                          for half in (counts[0::2], counts[1::2])]
                cells.append(f"{shares[0]:.1f} / {shares[1]:.1f} %")
            print(f"| {variant} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
