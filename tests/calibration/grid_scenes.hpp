// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/geometry/distortion.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"

namespace angio::test {

/// A perforated plate on a detector: where its holes are in the pinhole image.
struct HolePlate {
  double pitch_px = 14.3, angle_rad = 0.31, columns_rad = kPi / 3;
  Eigen::Vector2d origin_px{254, 260};

  Eigen::Matrix2d steps() const {
    Eigen::Matrix2d steps;
    steps.col(0) = pitch_px * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad));
    steps.col(1) = pitch_px * Eigen::Vector2d(std::cos(angle_rad + columns_rad), std::sin(angle_rad + columns_rad));
    return steps;
  }
  Eigen::Vector2d hole(const Eigen::Vector2i& index) const { return origin_px + steps() * index.cast<double>(); }

  /// From a place to the middle of the hole nearest to it.
  double distance_px(const Eigen::Vector2d& pinhole_px) const {
    const Eigen::Vector2d at = steps().inverse() * (pinhole_px - origin_px);
    double nearest = 1e9;
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector2d corner(std::floor(at.x()) + (i & 1), std::floor(at.y()) + (i >> 1));
      nearest = std::min(nearest, (origin_px + steps() * corner - pinhole_px).norm());
    }
    return nearest;
  }
};

/// Its X-ray image through a distortion, round as an intensifier's, brighter in the middle, 8 bits with noise.
inline cv::Mat plateImage(const HolePlate& plate, const DetectorDistortion& distortion, int side_px, Random& random) {
  cv::Mat image(side_px, side_px, CV_32F);
  const double middle = 0.5 * (side_px - 1), rim_px = 0.56 * side_px;
  for (int y = 0; y < side_px; ++y) {
    for (int x = 0; x < side_px; ++x) {
      const double from_middle = std::hypot(x - middle, y - middle);
      const double open =
          1 / (1 + std::exp((plate.distance_px(*distortion.undistorted({1.0 * x, 1.0 * y})) - 0.31 * plate.pitch_px) /
                            0.6));
      const double light = (1 - 0.5 * std::pow(from_middle / rim_px, 2)) / (1 + std::exp((from_middle - rim_px) / 3));
      image.at<float>(y, x) = static_cast<float>(light * (50 + 140 * open) + 1.5 * random.normal());
    }
  }
  image.convertTo(image, CV_8U);
  return image;
}

}  // namespace angio::test
