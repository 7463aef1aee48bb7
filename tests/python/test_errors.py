# SPDX-License-Identifier: GPL-2.0-or-later
"""Wrong input is a ValueError of one line that names what is wrong: the line that the programs print."""
import subprocess

import numpy as np
import pytest

import angio


def line_of(call):
    with pytest.raises(angio.InputError) as error:
        call()
    line = str(error.value)
    assert line and "\n" not in line
    return line


def test_is_a_value_error():
    assert issubclass(angio.InputError, ValueError)


def test_the_same_line_as_the_program(programs, data, tmp_path):
    broken = tmp_path / "tree.csv"
    broken.write_text("id,x_mm,y_mm,z_mm,radius_mm,parent\n0,0,0,0,,-1\n1,0,0,nan,,0\n")
    folder = data / "static-phantom"
    done = subprocess.run([str(programs / "angio-register"), "--tree", str(broken), "--camera", str(folder / "im1_camera.yaml"),
                           "--centerline", str(folder / "frames/im1.csv"), "--initial-pose", str(folder / "im1_nominal.yaml")],
                          capture_output=True, text=True)
    assert done.returncode == 1
    line = line_of(lambda: angio.read_vessel_tree(str(broken)))
    assert done.stderr.strip().endswith(line) and "tree.csv:3" in line


@pytest.mark.parametrize("pose, says", [
    (np.eye(3), "start = 3 x 3: must be a pose, 4 x 4"),
    (np.diag([1, 1, -1, 1]), "start: must hold a rotation"),
    (np.diag([2, 2, 2, 1]), "start: must hold a rotation"),
    (np.full((4, 4), np.nan), "start[3]: must be 0, 0, 0, 1"),
    (np.array([[1, 0, 0, np.inf], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]), "start[0, 3] = inf: must be a finite number"),
])
def test_a_pose_that_is_none(data, pose, says):
    folder = data / "static-phantom"
    registration = angio.Registration(angio.read_vessel_tree(str(folder / "tree.csv")))
    view = angio.XrayView(angio.read_centerline(str(folder / "frames/im1.csv")), angio.read_camera(str(folder / "im1_camera.yaml")))
    assert line_of(lambda: registration.search(view, pose)).startswith(says)
    assert line_of(lambda: registration.search([], np.eye(4))) == "views: must be at least one"


def test_a_covariance_that_is_none(data):
    folder = data / "static-phantom"
    registration = angio.Registration(angio.read_vessel_tree(str(folder / "tree.csv")))
    view = angio.XrayView(angio.read_centerline(str(folder / "frames/im1.csv")), angio.read_camera(str(folder / "im1_camera.yaml")))
    search = lambda covariance: line_of(lambda: registration.search(view, np.eye(4), covariance=covariance))
    assert search(np.full((6, 6), np.nan)) == "covariance: must be finite"
    assert search(np.triu(np.ones((6, 6)))) == "covariance: must be symmetric"
    assert search(-np.eye(6)) == "covariance: must be positive semidefinite"


def test_images_of_another_order_of_bytes():
    image = np.random.default_rng(1).integers(0, 65535, (64, 48), dtype=np.uint16)
    camera = angio.XrayCamera.centered(48, 64, 1e-3, 1)
    for given in (image.astype(">u2"), np.asfortranarray(image), image[::-1][::-1]):
        assert np.array_equal(angio.XrayFrame(given, camera).image, image)


def test_settings(data):
    tree = angio.read_vessel_tree(str(data / "static-phantom/tree.csv"))
    register = lambda settings, method="oriented_kernel": line_of(lambda: angio.Registration(tree, method=method, settings=settings))
    assert register({"oriented_kernel": {"spacing_mm": -1}}) == "settings: spacing_mm = -1: must lie between 0 and 100"
    assert register({"oriented_kernel": {"spacing_mm": float("nan")}}).startswith("settings: spacing_mm = nan")
    assert register({"oriented_kernel": {"spacing_mm": "wide"}}) == 'settings: spacing_mm = "wide": must be a number'
    assert "unknown key; there are: " in register({"oriented_colonel": {}})
    assert "oriented_kernel" in register(None, method="orientedkernel")
    assert register("no/such.yaml").startswith("no/such.yaml")


def test_arrays(data):
    assert line_of(lambda: angio.VesselTree(np.zeros((3, 2)), [-1, 0, 1])) == "points = 3 x 2: must be N x 3"
    assert "parent" in line_of(lambda: angio.VesselTree(np.random.rand(3, 3), [-1, 0, 7]))
    assert line_of(lambda: angio.CenterlineExtractor().extract(np.zeros((8, 8)))) == "image = 8 x 8 of float64: must be height x width of uint8 or uint16"
    assert "fx_px" in line_of(lambda: angio.XrayCamera(64, 64, -1, 100, 32, 32))
    camera = angio.XrayCamera.centered(64, 64, 1e-3, 1)
    assert line_of(lambda: angio.XrayView.of_image(np.zeros((64, 32), np.uint8), camera)).startswith("image = 64 x 32: must be of the camera's 64 x 64")
    assert line_of(lambda: camera.project([[0, 0, 1], [0, 0, -1]])).startswith("points[1].z = -1")


def test_sizes_that_cannot_be(data):
    tree = angio.read_vessel_tree(str(data / "static-phantom/tree.csv"))
    assert "spacing_m = -1" in line_of(lambda: angio.resampled(tree, -1))
    assert "spacing_m = nan" in line_of(lambda: angio.resampled(tree, float("nan")))
    assert "max_points = 1" in line_of(lambda: angio.resampled(tree, 1e-3, 1))
    assert "index = -1" in line_of(lambda: angio.simulated_trial(tree, -1))
