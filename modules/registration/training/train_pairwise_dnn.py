#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Trains the network of pairwise_dnn on simulated pairs, and writes it as ONNX.

    angio-training-pairs --out pairs.bin --trees 1200
    angio-training-pairs --out held_out.bin --trees 60 --seed 2
    train_pairwise_dnn.py pairs.bin held_out.bin pairwise_dnn.onnx

Debian: python3-torch, python3-numpy. Source of the method: Zheng, Miao, Wang, Liao, "Pairwise domain adaptation module
for CNN-based 2-D/3-D registration", Journal of Medical Imaging 5 (2018).
"""
import argparse
import time

import numpy as np
import torch
from torch import nn

SIDE = 96  # kPairSide_px of image_pair.hpp
PAIR = np.dtype([("motion", "<f4", 6), ("pictures", "u1", (4, SIDE, SIDE))])
CLINICAL, IDEAL, DRAWN, DEPTH = range(4)
# Depth and turns out of the plane move the picture least, and are learnt last.
COUNTS = torch.tensor([1.0, 1, 3, 2, 2, 1])


class PairNetwork(nn.Module):
    """From the seen and the drawn picture and the drawn depths (N x 3 x SIDE x SIDE) to the motion between them
    (N x 6, px).

    Convolutions say of each cell of 8 x 8 pixels what differs there. A motion is told from how that goes with a cell's
    place and depth: a turn about the beam moves cells by their place, one out of the plane by their depth. So the
    network goes on with the means of what cells say, times 1, x, y and z, and with the means of these themselves."""

    CELLS = SIDE // 8
    SAYS = 16

    def __init__(self):
        super().__init__()
        across = torch.linspace(-1, 1, SIDE).expand(1, 1, SIDE, SIDE)
        self.register_buffer("place", torch.cat([across, across.transpose(2, 3)], 1).clone())

        def layer(into, out, stride):
            return [nn.Conv2d(into, out, 3, stride, 1), nn.BatchNorm2d(out), nn.ReLU()]

        self.features = nn.Sequential(
            *layer(5, 16, 2), *layer(16, 24, 1), *layer(24, 32, 2), *layer(32, 40, 1), *layer(40, 56, 2),
            *layer(56, 56, 1))
        self.local = nn.Sequential(*layer(56, 56, 1), nn.Conv2d(56, self.SAYS, 1))
        self.trust = nn.Conv2d(56, 1, 1)
        self.motion = nn.Sequential(nn.Linear(4 * self.SAYS + 9, 128), nn.ReLU(), nn.Linear(128, 128), nn.ReLU(),
                                    nn.Linear(128, 6))

    def forward(self, pictures, whole=False):
        # One pair, as cv::dnn is given, needs no Expand, which cv::dnn does not know.
        place = self.place if len(pictures) == 1 else self.place.expand(len(pictures), -1, -1, -1)
        given = torch.cat([pictures, place], 1)
        features = self.features(given)
        cells = nn.functional.avg_pool2d(given, 8)
        depth, x, y = cells[:, 2:3], cells[:, 3:4], cells[:, 4:5]
        there = nn.functional.avg_pool2d(nn.functional.relu(pictures[:, 1:2]), 8)
        z = depth / (there + 0.05)
        says = self.local(features)
        weight = torch.sigmoid(self.trust(features)) * there

        def mean_of(maps):
            return nn.functional.avg_pool2d(maps, self.CELLS)

        means = [weight * x, weight * y, weight * z]
        means += [means[0] * x, means[1] * y, means[2] * z, means[0] * y, means[0] * z, means[1] * z]
        heavy = says * torch.cat([weight] * self.SAYS, 1)
        sums = mean_of(torch.cat([heavy] + [heavy * torch.cat([b] * self.SAYS, 1) for b in (x, y, z)] + means, 1))
        total = mean_of(weight) + 1e-3
        motion = self.motion((sums / torch.cat([total] * (4 * self.SAYS + 9), 1)).flatten(1))
        return (motion, features, says, weight, x, y, z) if whole else motion


def local_motion(motion, x, y, z):
    """How far a cell moves, N x 2 x CELLS x CELLS [px], about: a depth of one radius of gyration is counted as 0.42 of
    half a picture's side."""
    m = motion[:, :, None, None, None]
    u = m[:, 0] - m[:, 2] * x - m[:, 5] * y + 0.42 * m[:, 4] * z
    v = m[:, 1] - m[:, 2] * y + m[:, 5] * x - 0.42 * m[:, 3] * z
    return torch.cat([u, v], 1)


def pictures_of(records, seen):
    """What the network is given, N x 3 x SIDE x SIDE."""
    picked = records["pictures"][:, [seen, DRAWN, DEPTH]].astype(np.float32)
    return torch.from_numpy((picked - 128) / 32)


def turned(pictures, motion, generator):
    """One of the eight turns and mirrors of the picture, the same for a whole batch; a mirror turns axial vectors the
    other way."""
    motion = motion.clone()
    flip_x, flip_y, swap = (generator.random(3) < 0.5).tolist()
    if flip_x:
        pictures, motion = pictures.flip(3), motion * torch.tensor([-1.0, 1, 1, 1, -1, -1])
    if flip_y:
        pictures, motion = pictures.flip(2), motion * torch.tensor([1.0, -1, 1, -1, 1, -1])
    if swap:
        pictures = pictures.transpose(2, 3)
        motion = motion[:, [1, 0, 2, 4, 3, 5]] * torch.tensor([1.0, 1, 1, -1, -1, -1])
    return pictures, motion


def errors(network, records, seen):
    network.eval()
    with torch.no_grad():
        found = torch.cat([network(pictures_of(records[i:i + 256], seen)) for i in range(0, len(records), 256)])
    return found.numpy() - records["motion"]


def report(network, held_out):
    for name, seen in (("ideal", IDEAL), ("clinical", CLINICAL)):
        off = errors(network, held_out, seen)
        truth = held_out["motion"]
        near = np.abs(truth).max(1) < 1.5
        print(f"  {name}: rms before {np.round(np.sqrt((truth ** 2).mean(0)), 2)}, after "
              f"{np.round(np.sqrt((off ** 2).mean(0)), 2)}; near {np.round(np.sqrt((off[near] ** 2).mean(0)), 2)} px",
              flush=True)


def train(options):
    torch.manual_seed(options.seed)
    torch.set_num_threads(options.threads)
    generator = np.random.default_rng(options.seed)
    pairs, held_out = np.memmap(options.pairs, PAIR, "r"), np.fromfile(options.held_out, PAIR)
    network = PairNetwork()
    if options.start:
        network.load_state_dict(torch.load(options.start), strict=False)
    optimizer = torch.optim.AdamW(network.parameters(), lr=options.rate, weight_decay=1e-4)
    steps = int(options.epochs * len(pairs) / options.batch)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, options.rate, total_steps=steps)
    began, lost = time.time(), 0.0
    for step in range(steps):
        # Views of one tree lie side by side in the file: a batch takes from everywhere.
        records = pairs[np.sort(generator.integers(len(pairs), size=options.batch))]
        network.train()
        turn = int(generator.integers(1 << 30))
        truth = torch.from_numpy(records["motion"].copy())
        total = 0
        features = []
        # Domain adaptation by pairs: the ideal and the clinical picture of one pose are to give the same features.
        both = step % options.pair_every == 0
        for seen in ((CLINICAL, IDEAL) if both else (CLINICAL if generator.random() < 0.6 else IDEAL,)):
            given, motion = turned(pictures_of(records, seen), truth, np.random.default_rng(turn))
            found, feature, says, there, x, y, z = network(given, whole=True)
            features.append(feature)
            # Small motions are to be told apart from none, so that the loop comes to rest at the truth.
            weight = 1 / (0.3 + motion.abs().mean(1, keepdim=True))
            off = nn.functional.smooth_l1_loss(found, motion, reduction="none", beta=0.5)
            total = total + (weight * off * COUNTS).mean()
            # Two of what cells say are to be how far they move: without it turns out of the plane are not learnt.
            local = nn.functional.smooth_l1_loss(says[:, :2], local_motion(motion, x, y, z), reduction="none", beta=0.5)
            there = there / (there.mean((1, 2, 3), keepdim=True) + 1e-3)
            total = total + options.local * (weight[:, :, None, None] * local * there).mean()
        if both:
            total = 0.5 * total + options.adaptation * (features[0] - features[1]).square().mean()
        optimizer.zero_grad()
        total.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 5)
        optimizer.step()
        schedule.step()
        lost += total.item()
        if step % 250 == 249 or step == steps - 1:
            print(f"step {step + 1} of {steps}, {time.time() - began:.0f} s, loss {lost / (step % 250 + 1):.4f}", flush=True)
            lost = 0.0
        if step % 1500 == 1499 or step == steps - 1:
            report(network, held_out)
            torch.save(network.state_dict(), options.out + ".state")
    network.eval()
    torch.onnx.export(network, torch.zeros(1, 3, SIDE, SIDE), options.out, opset_version=11, input_names=["pictures"],
                      output_names=["motion"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pairs")
    parser.add_argument("held_out")
    parser.add_argument("out")
    parser.add_argument("--epochs", type=float, default=20)
    parser.add_argument("--batch", type=int, default=64)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--adaptation", type=float, default=0.1, help="weight of the difference of features")
    parser.add_argument("--local", type=float, default=0.5, help="weight of the cells' own motions")
    parser.add_argument("--pair-every", type=int, default=4, help="steps between those that adapt")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--start", help="state to go on from (.state)")
    train(parser.parse_args())


if __name__ == "__main__":
    main()
