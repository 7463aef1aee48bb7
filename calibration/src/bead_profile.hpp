// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/calibration/namespace.hpp"

namespace angio::calibration {

/// The shadow of one ball: how thick it is on the ray through a pixel, of 1 in its middle, is the root of 1 - (d/r)^2,
/// softened at its rim by the blur.
struct BallShadow {
  Eigen::Vector2d center_px{0, 0};
  double radius_px = 1;
  double depth = 1;  ///< Absorption in the middle, without scatter (natural logarithm).
};

/// Balls whose shadows overlap, over a ground that is a plane: I = ground (s + (1 - s) exp(-sum of depths * thickness))
/// with s the share of scattered radiation.
struct ShadowGroup {
  std::vector<BallShadow> balls;
  double scatter = 0.15;
  double blur_px = 0.8;
  Eigen::Vector2d stretch{0, 0};  ///< Of shadows by a detector's distortion: d^2 = (1 + a) x^2 + 2 b x y + (1 - a) y^2.
  double max_stretch = 0;         ///< Either way.
  Eigen::Vector3d ground{0, 0, 0};  ///< Middle, per px of x, per px of y; about its origin.
  Eigen::Vector2d ground_origin_px{0, 0};
  std::vector<double> stds_px;  ///< Of each ball's centre; what the fit gives.
  double noise = 0;             ///< Residual over the root of the grey value, rms.
  bool fitted = false;

  /// How thick a ball is on the ray through a pixel, of 1 in its middle.
  double thickness(std::size_t ball, const Eigen::Vector2d& at_px) const;
  /// Absorption at a ball's middle by itself, scatter included (natural logarithm).
  double contrast(std::size_t ball) const;
};

/// A group has no more balls than this.
constexpr std::size_t kMaxBalls = 6;

/// How much a pixel counts that is off the model: squared, or less beyond some standard deviations (Huber's weights).
enum class PixelLoss { kSquared, kHuber };

/// Fits a group of 1 to kMaxBalls balls to the grey values (CV_32FC1) around its balls, where `mask` (CV_8UC1) is not
/// zero, by Levenberg-Marquardt with the weights of counted quanta. `fitted` is false when it has too few pixels or
/// runs away.
ShadowGroup fittedGroup(const cv::Mat& image, const cv::Mat& mask, ShadowGroup start,
                        PixelLoss loss = PixelLoss::kSquared);

}  // namespace angio::calibration
