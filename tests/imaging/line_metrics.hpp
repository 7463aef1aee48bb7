// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "angio/test/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"
#include "phantom.hpp"

namespace angio::test {

/// The middle value; fails the test and is large when there is none.
double median(std::vector<double> values);

/// Of the found points to the scene's centre lines [px].
double medianDistance(const Centerline2d& found, const Scene& scene);

/// From a position to the nearest found point [px].
double distanceTo(const Centerline2d& found, const Eigen::Vector2d& p);

/// Part of the scene's centre lines that has a found point within `reach_px`.
double coverage(const Scene& scene, const Centerline2d& found, double reach_px);

/// Part of the found points that lie within `reach_px` of the scene's centre lines.
double precision(const Scene& scene, const Centerline2d& found, double reach_px);

std::size_t branches(const Centerline2d& found);

/// A scene of 1024 x 1024 pixels at a clinical dose.
Scene clinicalScene(std::vector<Vessel> vessels);

}  // namespace angio::test
