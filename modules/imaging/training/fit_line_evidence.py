#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Learns the weights of unlikely_lines.cpp from angiograms whose vessels were marked by hand, and prints them.

    modules/imaging/training/fit_line_evidence.py build/bin/angio-line-evidence arcade-sample/images

Of the marked images the half that marked_angiograms.py names first is used, in all its variants. A line is a vessel by
the part of its points that lie within 5 px of one, and clutter by what lies more than 10 px from anything marked; the
rest is left out. Every picture counts as much as its variant's weight, however many lines it has. Minimises the mean
logistic loss and a penalty on the weights of standardised terms.

Prints too, for each image, the loss under weights that were learnt without it. Debian: python3-numpy, python3-pil.
"""
import argparse
import csv
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import PIL.Image

sys.path.insert(0, str(pathlib.Path(__file__).parents[3] / "examples"))
import marked_angiograms as marked  # noqa: E402

PENALTY = 0.023
PICTURE = {"as they are": 1.0}  # Others count half.
FIRST_TERM = 3  # Behind line, x_px and y_px.


def evidence_of(program, image, scale, marks, folder):
    """Terms (lines x terms), and how much of each line is a vessel or clutter [points]."""
    picture, table = folder / "image.png", folder / "evidence.csv"
    PIL.Image.fromarray(np.clip(np.rint(image), 0, 255).astype(np.uint8)).save(picture)
    subprocess.run([program, picture, "--out", table], check=True)
    with open(table, newline="") as file:
        rows = list(csv.reader(file))
    values = np.array(rows[1:], float)
    at = (values[:, 1:3] + 0.5) / scale - 0.5
    vessels = np.vstack([marked.points_of(marks[kind]) for kind in ("main", "thin")])
    unsure = np.vstack([marked.points_of(marks[kind]) for kind in ("maybe", "device")])
    to_vessel = marked.distances(at, vessels)
    is_clutter = (to_vessel > 10) & (marked.distances(at, unsure) > 10)
    _, first, line = np.unique(values[:, 0], return_index=True, return_inverse=True)
    return (values[first, FIRST_TERM:], np.bincount(line, to_vessel <= 5), np.bincount(line, is_clutter),
            rows[0][FIRST_TERM:])


def fitted(pictures):
    """The constant and the weights."""
    terms = np.vstack([p[0] for p in pictures])
    shares = [weight * np.array([vessel, clutter]) / (vessel + clutter).sum() for _, vessel, clutter, weight in pictures]
    vessel, clutter = np.hstack(shares) / sum(p[3] for p in pictures)
    middle, spread = terms.mean(0), terms.std(0)
    known = np.column_stack([np.ones(len(terms)), (terms - middle) / spread])
    penalty = np.full(known.shape[1], PENALTY)
    penalty[0] = 1e-6
    weights = np.zeros(known.shape[1])
    for _ in range(100):  # Newton's; steps are cut where the loss is far from a parabola.
        odds = 1 / (1 + np.exp(-known @ weights))
        slope = known.T @ (vessel * (1 - odds) - clutter * odds) - penalty * weights
        bend = (known * ((vessel + clutter) * odds * (1 - odds))[:, None]).T @ known + np.diag(penalty)
        weights += np.clip(np.linalg.solve(bend, slope), -1, 1)
    slopes = weights[1:] / spread
    return weights[0] - slopes @ middle, slopes


def loss(picture, constant, weights):
    terms, vessel, clutter, _ = picture
    log_odds = constant + terms @ weights
    return (np.logaddexp(0, -log_odds) @ vessel + np.logaddexp(0, log_odds) @ clutter) / (vessel + clutter).sum()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("images", type=pathlib.Path)
    options = parser.parse_args()
    marks = json.loads(marked.MARKS.read_text())
    pictures, random, columns = {}, np.random.default_rng(1), []
    with tempfile.TemporaryDirectory() as folder:
        for name in sorted(marks)[0::2]:
            with PIL.Image.open(options.images / f"{name}.png") as file:
                image = np.asarray(file.convert("L"), float)
            pictures[name] = []
            for variant, (scale, made) in marked.VARIANTS.items():
                *known, columns = evidence_of(options.program, made(image, random), scale, marks[name],
                                              pathlib.Path(folder))
                pictures[name].append((*known, PICTURE.get(variant, 0.5)))
    for name in pictures:
        constant, weights = fitted([p for other in pictures if other != name for p in pictures[other]])
        print(f"{name}: loss {np.mean([loss(p, constant, weights) for p in pictures[name]]):.3f} when left out")
    constant, weights = fitted([p for name in pictures for p in pictures[name]])
    print(f"constant {constant:.2f}")
    for column, weight in zip(columns, weights):
        print(f"{column} {weight:.2f}")


if __name__ == "__main__":
    main()
