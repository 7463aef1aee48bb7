// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>

#include "angio/geometry/namespace.hpp"

namespace angio::geometry {

/// Pinhole camera of an X-ray system: the source is the centre of projection, the detector the image plane.
///
/// Frame `camera`: origin at the X-ray source, +z from the source to the detector, x right and y down in the image.
/// Pixel (0, 0) is the centre of the top left pixel.
class XrayCamera {
 public:
  /// Plain numbers as they stand in a camera file.
  struct Parameters {
    int width_px = 0;
    int height_px = 0;
    double fx_px = 0;  ///< Source-detector distance over pixel spacing [px].
    double fy_px = 0;
    double cx_px = 0;  ///< Principal point [px].
    double cy_px = 0;
    std::optional<double> pixel_spacing_m;             ///< At the detector, when known.
    std::optional<double> source_detector_distance_m;  ///< When known.
  };

  /// Throws InputError that names the field when a size or focal length is not positive or a number not finite.
  explicit XrayCamera(const Parameters& parameters);

  /// Camera of a detector with square pixels whose centre is the principal point.
  static XrayCamera centered(int width_px, int height_px, double pixel_spacing_m, double source_detector_distance_m);

  const Parameters& parameters() const { return p_; }
  int width_px() const { return p_.width_px; }
  int height_px() const { return p_.height_px; }

  /// Projects a point in the camera frame [m] onto the detector [px].
  ///
  /// Returns nothing if the point is not in front of the source (z <= 0): such a point has no image, and a caller that
  /// invents one pulls the registration through the X-ray tube. `J` is d(px)/d(point) [px/m].
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_camera,
                                         Eigen::Matrix<double, 2, 3>* J = nullptr) const {
    if (!(p_camera.z() > 0)) return std::nullopt;
    const double inv_z = 1 / p_camera.z();
    const double x = p_camera.x() * inv_z, y = p_camera.y() * inv_z;
    if (J) *J << p_.fx_px * inv_z, 0, -p_.fx_px * x * inv_z, 0, p_.fy_px * inv_z, -p_.fy_px * y * inv_z;
    return Eigen::Vector2d(p_.fx_px * x + p_.cx_px, p_.fy_px * y + p_.cy_px);
  }

  /// Direction of the ray through a pixel, camera frame, with z = 1.
  Eigen::Vector3d ray(const Eigen::Vector2d& pixel) const;

  /// Whether a pixel position lies on the detector, pixel edges included.
  bool sees(const Eigen::Vector2d& pixel) const {
    return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() <= p_.width_px - 0.5 && pixel.y() <= p_.height_px - 0.5;
  }

 private:
  Parameters p_;
};

}  // namespace angio::geometry
