// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "angio/geometry/distortion.hpp"
#include "angio/simulation/fluoroscopy_settings.hpp"
#include "angio/simulation/namespace.hpp"

namespace angio::simulation {

/// Where an image intensifier shows what a flat detector would see elsewhere.
class ImageIntensifier {
 public:
  ImageIntensifier(const IntensifierSettings& settings, int width_px, int height_px);

  /// From the pixel of the pinhole camera to the one of the image: what truth has to go through.
  Eigen::Vector2d distorted(const Eigen::Vector2d& ideal_px) const;

  /// The inverse, to a millionth of a pixel within twice the detector.
  Eigen::Vector2d ideal(const Eigen::Vector2d& distorted_px) const;

 private:
  DetectorDistortion map_;
};

}  // namespace angio::simulation
