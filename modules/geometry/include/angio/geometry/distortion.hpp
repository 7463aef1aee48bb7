// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "angio/geometry/displacement_polynomial.hpp"
#include "angio/geometry/xray_camera.hpp"

namespace angio::geometry {

/// Coefficients of a bend of the plane about its origin: out by 1 + k1 r^2 + k2 r^4, turned by s1 r^2 + s2 r^4.
struct RadialBend {
  double k1 = 0, k2 = 0;
  double s1_rad = 0, s2_rad = 0;  ///< From x to y: clockwise in an image.

  /// Where a point without unit goes. `J_point` is its derivative by the point, `J_bend` by k1, k2, s1, s2.
  Eigen::Vector2d bent(const Eigen::Vector2d& point, Eigen::Matrix2d* J_point = nullptr,
                       Eigen::Matrix<double, 2, 4>* J_bend = nullptr) const;

  /// Where a bent point came from, nearest to the origin; nothing beyond the radius at which the bend folds over.
  std::optional<Eigen::Vector2d> unbent(const Eigen::Vector2d& bent_point) const;
};

/// Where a detector shows what a pinhole camera would see elsewhere.
///
/// The first two models have one form: image = centre + [unit_x, skew; 0, unit_y] bend((pinhole - centre) / unit).
/// - Radial, of lenses and flat panels: the centre is the principal point and the units are the focal lengths, so that
///   r is the tangent of the angle from the principal ray. Source: Zhang, A flexible new technique for camera
///   calibration, PAMI 22 (2000), eq. 11, 12.
/// - Intensifier: r counts half widths of the detector from its middle; k1 is pincushion, s1 the S-shaped turn in the
///   earth's field.
/// - Polynomial, of an intensifier whose grid was seen: image = pinhole + shift((pinhole - centre) / unit).
struct DetectorDistortion {
  enum class Model { kRadial, kIntensifier, kPolynomial };

  Model model = Model::kRadial;
  Eigen::Vector2d center_px{0, 0};
  Eigen::Vector2d unit_px{1, 1};
  RadialBend bend;
  double skew_px = 0;            ///< How far columns lean: u moves by skew_px for each unit of y.
  DisplacementPolynomial shift;  ///< Of the polynomial model alone.

  static DetectorDistortion radial(const XrayCamera& camera, double k1, double k2, double skew_px = 0);
  static DetectorDistortion intensifier(const XrayCamera& camera, const RadialBend& bend);
  static DetectorDistortion polynomial(const Eigen::Vector2d& center_px, double unit_px,
                                       const DisplacementPolynomial& shift);

  /// Throws InputError that names the field when a number is not finite, a unit not positive, or the detector is not
  /// one-to-one out to its corners.
  void check(const std::string& place, int width_px, int height_px) const;

  /// From the pixel of the pinhole camera to that of the image; `J` is the derivative.
  Eigen::Vector2d distorted(const Eigen::Vector2d& pinhole_px, Eigen::Matrix2d* J = nullptr) const;

  /// The inverse, to a millionth of a pixel; nothing for a pixel where no pinhole pixel goes: never on the detector
  /// when check() has passed.
  std::optional<Eigen::Vector2d> undistorted(const Eigen::Vector2d& image_px, Eigen::Matrix2d* J = nullptr) const;
};

}  // namespace angio::geometry
