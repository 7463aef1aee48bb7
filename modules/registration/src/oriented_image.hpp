// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/vessel/centerline2d.hpp"
#include "kernel_field.hpp"

namespace angio::registration {

/// Brings a centreline into oriented points, none further apart than `spacing_px` along a branch and at most about
/// `max_points`. The mass of points without order is found from how dense they are. The order in which branches, or
/// points without order, are given does not matter. `to` is overwritten, its memory kept.
void orientedPoints(const Centerline2d& centerline, double spacing_px, int max_points, OrientedPoints& to);

/// About every `stride`-th point of each branch, at least one, with the mass of those left out. `to` is overwritten,
/// its memory kept.
void thinned(const OrientedPoints& points, int stride, OrientedPoints& to);

}  // namespace angio::registration
