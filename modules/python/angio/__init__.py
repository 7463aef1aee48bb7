# SPDX-License-Identifier: GPL-2.0-or-later
"""AngioServo: registration of vessel trees to X-ray images, and visual servoing of C-arms by them.

Lengths are in metres, angles in radians; names that end in _mm, _deg or _px say so. Poses are 4 x 4 arrays, points are rows."""
from ._angio import *  # noqa: F401,F403
from ._angio import __doc__  # noqa: F401
