// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/tip_deflection.hpp"

#include <cmath>

namespace angio::navigation {
namespace {

constexpr double kMinForeshortening = 0.4;  // Of the vessel's image; below, its direction in the image is mostly noise.
constexpr double kMinLength_px = 8;
constexpr double kModel_m = 0.4e-3;  // Of the centreline against the catheter's line, besides the curve's own noise.

// The point `back_px` before a curve's last one, along it; nothing when it is shorter.
std::optional<Eigen::Vector2d> beforeEnd(const Eigen::Matrix2Xd& line, double back_px) {
  double left = back_px;
  for (Eigen::Index i = line.cols() - 1; i > 0; --i) {
    const Eigen::Vector2d step = line.col(i - 1) - line.col(i);
    const double length = step.norm();
    if (length >= left && length > 0) return Eigen::Vector2d(line.col(i) + left / length * step);
    left -= length;
  }
  return std::nullopt;
}

}  // namespace

std::optional<TipDeflection> seenDeflection(const SeenCatheter& seen, const XrayCamera& camera,
                                            const Pose& T_camera_model, const TreeTopology& map,
                                            const TreeLocation& tip, double tip_length_m) {
  if (seen.tip_end != TipEnd::kLast || seen.points_px.cols() < 2 || !seen.points_px.allFinite()) return std::nullopt;
  const Eigen::Vector3d p = map.point(tip), knuckle = map.point(map.before(tip, tip_length_m));
  const Eigen::Vector3d p_camera = T_camera_model * p;
  const auto end_px = camera.project(p_camera), start_px = camera.project(T_camera_model * knuckle);
  if (!end_px || !start_px) return std::nullopt;
  const Eigen::Vector2d path = *end_px - *start_px;
  const double length_px = path.norm(), px_per_m = camera.parameters().fx_px / p_camera.z();
  if (length_px < kMinLength_px || length_px < kMinForeshortening * px_per_m * (p - knuckle).norm()) {
    return std::nullopt;
  }
  const auto back = beforeEnd(seen.points_px, length_px);
  if (!back) return std::nullopt;
  const Eigen::Vector2d chord = seen.points_px.rightCols<1>() - *back;
  const Eigen::Vector2d normal(-path.y() / length_px, path.x() / length_px);
  const TreeFrame frame = map.frame(tip);
  const Eigen::Vector3d sideways = T_camera_model.linear().transpose() * Eigen::Vector3d(normal.x(), normal.y(), 0);
  TipDeflection result;
  result.slope = normal.dot(chord) / px_per_m / tip_length_m;
  result.sigma = std::hypot(std::sqrt(2.0) * seen.std_px / px_per_m, kModel_m) / tip_length_m;
  result.observable_axis = {sideways.dot(frame.normal), sideways.dot(frame.binormal)};
  return result;
}

}  // namespace angio::navigation
