// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/intensifier.hpp"

#include "angio/geometry/se3.hpp"

namespace angio::simulation {

ImageIntensifier::ImageIntensifier(const IntensifierSettings& settings, int width_px, int height_px)
    : map_{DetectorDistortion::Model::kIntensifier,
           {0.5 * (width_px - 1), 0.5 * (height_px - 1)},
           Eigen::Vector2d::Constant(0.5 * width_px),
           {settings.pincushion, 0, degToRad(settings.s_distortion_deg), 0},
           0} {}

Eigen::Vector2d ImageIntensifier::distorted(const Eigen::Vector2d& ideal_px) const { return map_.distorted(ideal_px); }

Eigen::Vector2d ImageIntensifier::ideal(const Eigen::Vector2d& distorted_px) const {
  return *map_.undistorted(distorted_px);  // A pincushion has no fold.
}

}  // namespace angio::simulation
