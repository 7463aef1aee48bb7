// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/xray_camera.hpp"

#include "angio/base/errors.hpp"

namespace angio::geometry {

XrayCamera::XrayCamera(const Parameters& parameters) : p_(parameters) {
  const std::string place = "camera";
  // 32,768 px is twice the widest detector there is; beyond it a number is a mistake, not a camera.
  requireBetween(place, "image_size_px[0]", p_.width_px, 1, 32768);
  requireBetween(place, "image_size_px[1]", p_.height_px, 1, 32768);
  requirePositive(place, "fx_px", p_.fx_px);
  requirePositive(place, "fy_px", p_.fy_px);
  requireFinite(place, "cx_px", p_.cx_px);
  requireFinite(place, "cy_px", p_.cy_px);
  if (p_.pixel_spacing_m) requirePositive(place, "pixel_spacing_mm", *p_.pixel_spacing_m * 1e3);
  if (p_.source_detector_distance_m) {
    requirePositive(place, "source_detector_distance_mm", *p_.source_detector_distance_m * 1e3);
  }
}

XrayCamera XrayCamera::centered(int width_px, int height_px, double pixel_spacing_m,
                                double source_detector_distance_m) {
  requirePositive("camera", "pixel_spacing_mm", pixel_spacing_m * 1e3);
  Parameters p;
  p.width_px = width_px;
  p.height_px = height_px;
  p.fx_px = p.fy_px = source_detector_distance_m / pixel_spacing_m;
  p.cx_px = 0.5 * (width_px - 1);
  p.cy_px = 0.5 * (height_px - 1);
  p.pixel_spacing_m = pixel_spacing_m;
  p.source_detector_distance_m = source_detector_distance_m;
  return XrayCamera(p);
}

Eigen::Vector3d XrayCamera::ray(const Eigen::Vector2d& pixel) const {
  return {(pixel.x() - p_.cx_px) / p_.fx_px, (pixel.y() - p_.cy_px) / p_.fy_px, 1.0};
}

}  // namespace angio::geometry
