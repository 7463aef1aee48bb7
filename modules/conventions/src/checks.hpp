// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/errors.hpp"
#include "angio/conventions/xray_projection.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::conventions {

/// A rotation that is off by rounding, made exact. Throws InputError when it is none.
inline Eigen::Matrix3d requireRotation(const std::string& place, const std::string& field, const Eigen::Matrix3d& M) {
  const double defect = rotationDefect(M);
  if (defect < 1e-3) return nearestRotation(M);
  throw InputError(place, field, "R^T R - I up to " + formatValue(defect), "must be a rotation matrix");
}

/// What a convention that has lengths on the detector needs [mm]. Throws InputError when the camera does not say it.
inline double requireSourceDetector_mm(const XrayCamera& camera, const std::string& convention) {
  const auto& distance_m = camera.parameters().source_detector_distance_m;
  if (distance_m) return 1e3 * *distance_m;
  throw InputError("camera", "source_detector_distance_mm", "", "is missing, and " + convention + " needs it");
}

/// A camera whose detector has these pixels [mm], with the principal point [px]. Throws InputError by XrayCamera's
/// rules.
inline XrayCamera cameraOf(int width_px, int height_px, double source_detector_mm, const Eigen::Vector2d& pixel_mm,
                           const Eigen::Vector2d& principal_point_px) {
  XrayCamera::Parameters p;
  p.width_px = width_px;
  p.height_px = height_px;
  p.fx_px = source_detector_mm / pixel_mm.x();
  p.fy_px = source_detector_mm / pixel_mm.y();
  p.cx_px = principal_point_px.x();
  p.cy_px = principal_point_px.y();
  if (pixel_mm.x() == pixel_mm.y()) p.pixel_spacing_m = 1e-3 * pixel_mm.x();
  p.source_detector_distance_m = 1e-3 * source_detector_mm;
  return XrayCamera(p);
}

}  // namespace angio::conventions
