# SPDX-License-Identifier: GPL-2.0-or-later
"""What the tests of the Python module share: programs and data are named by the environment, which CTest sets."""
import os
import pathlib

import pytest

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
