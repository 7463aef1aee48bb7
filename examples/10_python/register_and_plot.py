#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Registers a tree to one frame of a DICOM run and draws what came of it: register_and_plot.py DATA OUT

DATA is examples/data/static-phantom; OUT, a folder, gets registered.png and uncertainty.png."""
import pathlib
import sys

import angio
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

data, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
run_path, frame = str(data / "dicom/im5.dcm"), 2

tree = angio.read_vessel_tree(str(data / "tree.csv"))
geometry = angio.XaRun(run_path).geometry(frame)
image = angio.read_xray_image(run_path, frame)
# Where the angles and the calibration say that the tree is: T_camera_model = T_camera_patient T_patient_model.
start = geometry.T_camera_patient @ angio.read_pose(str(data / "dicom/t_dsa_cb.yaml"))

view = angio.XrayView.of_image(image, geometry.camera)
result = angio.Registration(tree).search(view, start)
print(f"{result.status.name}: {result.alignment.model_residual_px:.2f} px, usable for {', '.join(result.usable_for)}")


def draw_tree(axes, T_camera_model, color, label):
    camera_points = tree.points @ T_camera_model[:3, :3].T + T_camera_model[:3, 3]
    pixels = geometry.camera.project(camera_points)
    for i, branch in enumerate(tree.branches):
        axes.plot(*pixels[branch].T, color=color, linewidth=1.2, label=label if i == 0 else None)


figure, axes = plt.subplots(figsize=(8, 8), layout="constrained")
axes.imshow(image, cmap="gray")
axes.scatter(*view.centerline.points_px.T, s=2, color="violet", label="centreline in the image")
draw_tree(axes, start, "tab:blue", "tree by the angles")
draw_tree(axes, result.T_camera_model, "tab:green", f"tree as registered: {result.status.name}")
axes.set(xlim=(0, geometry.camera.width_px), ylim=(geometry.camera.height_px, 0), xlabel="x [px]", ylabel="y [px]")
axes.legend(loc="lower right")
figure.savefig(out / "registered.png", dpi=100)

# How unsure the place of each point is: along the beam, and across it.
std_mm = 1e3 * np.sqrt([np.diag(C) for C in result.point_covariances_m2])
figure, panels = plt.subplots(1, 2, figsize=(11, 5), layout="constrained")
for axes, values, title in zip(panels, (std_mm[:, :2].max(axis=1), std_mm[:, 2]), ("across the beam", "in depth")):
    shown = axes.scatter(1e3 * tree.points[:, 0], 1e3 * tree.points[:, 2], c=values, s=12)
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="z [mm]", title=f"standard deviation {title} [mm]")
    figure.colorbar(shown, ax=axes, shrink=0.8)
figure.savefig(out / "uncertainty.png", dpi=100)
