// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "angio/localisation/seen_catheter.hpp"

namespace angio::localisation {

/// A seen curve as it is compared with paths: points in equal steps, from the tip back.
struct CurveSamples {
  std::vector<Eigen::Vector2d> points_px;  ///< The tip first.
  double step_px = 0;
  double length_px = 0;
  double std_px = 1;
};

constexpr int kMaxSamples = 120;  ///< Longer curves get wider steps.

/// What is wrong with a curve, or nothing: fewer than two points, a coordinate or sigma that is not finite, no length.
std::optional<std::string> defectOf(const SeenCatheter& seen);

/// The curve from its last point back, or from its first on. The curve must be without defect.
CurveSamples samplesOf(const SeenCatheter& seen, double step_px, bool tip_is_last);

}  // namespace angio::localisation
