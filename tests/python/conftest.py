# SPDX-License-Identifier: GPL-2.0-or-later
"""What the tests of the Python module share: programs and data are named by the environment, which CTest sets."""
import os
import pathlib

import pytest

import angio

ROOT = pathlib.Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def programs():
    return pathlib.Path(os.environ["ANGIO_PROGRAMS"])


@pytest.fixture(scope="session")
def data():
    return ROOT / "examples/data"


@pytest.fixture(scope="session")
def root():
    return ROOT


@pytest.fixture
def small_lab(data):
    """A tree, and a C-arm as it truly is, 256 pixels a side, for speed."""
    folder = data / "hepatic-tace"
    truth = angio.read_carm_calibration(str(folder / "carm.yaml"))
    truth.carm.pixel_spacing_m *= truth.carm.image_width_px / 256
    truth.carm.image_width_px = truth.carm.image_height_px = 256
    return angio.read_vessel_tree(str(folder / "tree.csv")), truth
