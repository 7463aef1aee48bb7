// SPDX-License-Identifier: GPL-2.0-or-later
#include "curve_samples.hpp"

#include <algorithm>
#include <cmath>

namespace angio::localisation {
namespace {

double lengthOf(const Eigen::Matrix2Xd& points) {
  double length = 0;
  for (int i = 1; i < points.cols(); ++i) length += (points.col(i) - points.col(i - 1)).norm();
  return length;
}

}  // namespace

std::optional<std::string> defectOf(const SeenCatheter& seen) {
  if (seen.points_px.cols() < 2) return "the curve has fewer than two points";
  if (!seen.points_px.allFinite() || seen.points_px.cwiseAbs().maxCoeff() > 1e6)
    return "a point of the curve is not finite or absurd";
  if (!(seen.std_px > 0) || !std::isfinite(seen.std_px)) return "the curve's sigma is not positive";
  if (!(lengthOf(seen.points_px) > 1)) return "the curve has no length";
  return std::nullopt;
}

CurveSamples samplesOf(const SeenCatheter& seen, double step_px, bool tip_is_last) {
  const Eigen::Matrix2Xd points = tip_is_last ? seen.points_px.rowwise().reverse().eval() : seen.points_px;
  CurveSamples samples;
  samples.std_px = seen.std_px;
  samples.length_px = lengthOf(points);
  samples.step_px = std::max(step_px, samples.length_px / kMaxSamples);
  double next = 0, walked = 0;
  for (int i = 1; i < points.cols(); ++i) {
    const Eigen::Vector2d from = points.col(i - 1), to = points.col(i);
    const double edge = (to - from).norm();
    for (; next <= walked + edge && edge > 0; next += samples.step_px) {
      samples.points_px.push_back(from + (to - from) * ((next - walked) / edge));
    }
    walked += edge;
  }
  return samples;
}

}  // namespace angio::localisation
