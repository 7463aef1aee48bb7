// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/distortion.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/simulation/fluoroscopy_settings.hpp"
#include "angio/simulation/namespace.hpp"

namespace angio::simulation {

/// Where an image intensifier shows what a flat detector would see elsewhere: what truth has to go through. A
/// pincushion has no fold, so that every pixel comes from one of the flat detector.
inline DetectorDistortion intensifierDistortion(const IntensifierSettings& settings, int width_px, int height_px) {
  return {DetectorDistortion::Model::kIntensifier,
          {0.5 * (width_px - 1), 0.5 * (height_px - 1)},
          Eigen::Vector2d::Constant(0.5 * width_px),
          {settings.pincushion, 0, degToRad(settings.s_distortion_deg), 0},
          0,
          {}};
}

}  // namespace angio::simulation
