// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/simulation/fluoroscopy_settings.hpp"
#include "angio/simulation/namespace.hpp"

namespace angio::simulation {

/// Corners of the open field [px], a convex polygon in order, clockwise in the image: where half of the beam passes.
///
/// All of the detector, pixel edges included, when it is open. A rectangle has 4 corners, an octagon 8, with the
/// corners of the rectangle cut at a quarter of its shorter side; a circle, `width` times the shorter side of the
/// detector wide, is a polygon of 128 corners. Parts beyond the detector are not cut off.
std::vector<Eigen::Vector2d> openField(const CollimatorSettings& settings, int width_px, int height_px);

/// Share of the beam that passes the shutters to each pixel, CV_32FC1.
cv::Mat shutterTransmission(const CollimatorSettings& settings, int width_px, int height_px);

}  // namespace angio::simulation
