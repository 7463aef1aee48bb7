// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/intensifier.hpp"

#include <Eigen/Geometry>
#include <cmath>

#include "angio/geometry/se3.hpp"

namespace angio {

ImageIntensifier::ImageIntensifier(const IntensifierSettings& settings, int width_px, int height_px)
    : centre_px_(0.5 * (width_px - 1), 0.5 * (height_px - 1)),
      unit_px_(0.5 * width_px),
      pincushion_(settings.pincushion),
      turn_rad_(degToRad(settings.s_distortion_deg)) {}

Eigen::Vector2d ImageIntensifier::distorted(const Eigen::Vector2d& ideal_px) const {
  const Eigen::Vector2d p = (ideal_px - centre_px_) / unit_px_;
  const double r2 = p.squaredNorm();
  return centre_px_ + unit_px_ * (1 + pincushion_ * r2) * (Eigen::Rotation2Dd(turn_rad_ * r2) * p);
}

Eigen::Vector2d ImageIntensifier::ideal(const Eigen::Vector2d& distorted_px) const {
  const Eigen::Vector2d q = (distorted_px - centre_px_) / unit_px_;
  const double wanted = q.norm();
  // The radius first: r (1 + k r^2) = wanted rises with r, and Newton's steps from above stay above.
  double r = wanted;
  for (int i = 0; i < 30; ++i) {
    const double step = (r * (1 + pincushion_ * r * r) - wanted) / (1 + 3 * pincushion_ * r * r);
    r -= step;
    if (std::abs(step) < 1e-12) break;
  }
  if (wanted == 0) return centre_px_;
  return centre_px_ + unit_px_ * r / wanted * (Eigen::Rotation2Dd(-turn_rad_ * r * r) * q);
}

}  // namespace angio
