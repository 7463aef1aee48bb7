// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/geometry/xray_camera.hpp"
#include "angio/registration/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::registration {

/// A centreline drawn on the detector and blurred by a Gaussian: the image that NICP reads at the projected model.
///
/// Its value is 1 on a straight line that is alone, 0 far from all lines, and more than 1 where lines are dense. It is
/// a uniform cubic B-spline over samples some pixels apart, so that it has two continuous derivatives, and those given
/// are exactly its own.
class RidgeImage {
 public:
  using Samples = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  /// @param samples  The spline's coefficients: rows go down, columns to the right, the first one is at pixel (0, 0).
  /// Beyond the last ones there are zeros. @param stride_px between samples. @param scale_px standard deviation of the
  /// blur, the spline's own included.
  RidgeImage(Samples samples, double stride_px, double scale_px)
      : samples_(std::move(samples)), per_px_(1 / stride_px), scale_px_(scale_px) {}

  struct Reading {
    double value = 0;
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();  ///< Per pixel.
    Eigen::Matrix2d hessian = Eigen::Matrix2d::Zero();   ///< Per square pixel.
  };
  /// Reads the image at a finite pixel position that lies on the detector, within two strides.
  Reading read(const Eigen::Vector2d& pixel) const;
  /// The value alone.
  double valueAt(const Eigen::Vector2d& pixel) const;

  double scale_px() const { return scale_px_; }

 private:
  Samples samples_;
  double per_px_, scale_px_;
};

/// Draws a centreline once and blurs it to each of the scales [px], the largest first and none less than 1; returns the
/// images in the same order. Points of one branch that follow each other within `max_step_px` are joined, others are
/// drawn as points. What lies off the detector is not drawn.
std::vector<RidgeImage> ridgeImages(const Centerline2d& centerline, double max_step_px, const XrayCamera& camera,
                                    const std::vector<double>& scales_px);

}  // namespace angio::registration
