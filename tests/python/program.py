# SPDX-License-Identifier: GPL-2.0-or-later
"""Registers the same case by angio-register and by the module."""
import json
import subprocess

import angio


def without_times(result):
    return {key: value for key, value in result.items() if key in KEYS}


# All that a result says but for the times, which differ from run to run.
KEYS = {
    "status", "reason", "rotation", "translation_mm", "covariance", "ambiguity", "deformation_std_mm", "spread_mm",
    "spread_across_mm", "interval_90_mm", "usable_for", "point_covariance_mm2", "point_central_covariance_mm2",
    "prior", "mean_projection_residual_px", "rms_projection_residual_px", "mean_image_residual_px",
    "model_explained", "image_explained", "displacements_mm", "points_3d", "points_2d", "iterations",
}


def by_program(programs, tmp_path, *options):
    out = tmp_path / "result.json"
    command = [str(programs / "angio-register"), *map(str, options), "--point-covariance", "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode in (0, 3), done.stderr
    return json.loads(out.read_text())


class Case:
    """A case on files, as both read it."""

    def __init__(self, tree, camera, start, centerline=None, image=None, method="oriented_kernel", nonrigid=False):
        self.tree, self.camera, self.start = tree, camera, start
        self.centerline, self.image, self.method, self.nonrigid = centerline, image, method, nonrigid

    def options(self):
        options = ["--tree", self.tree, "--camera", self.camera, "--initial-pose", self.start, "--method", self.method]
        options += ["--centerline", self.centerline] if self.centerline else ["--image", self.image]
        return options + (["--nonrigid"] if self.nonrigid else [])

    def by_module(self):
        camera = angio.read_camera(str(self.camera))
        if self.centerline:
            view = angio.XrayView(angio.read_centerline(str(self.centerline)), camera)
        else:
            view = angio.XrayView.of_image(angio.read_xray_image(str(self.image)), camera)
        tree = angio.read_vessel_tree(str(self.tree))
        registration = angio.Registration(tree, method=self.method, nonrigid=self.nonrigid)
        return registration.search(view, angio.read_pose(str(self.start)))
