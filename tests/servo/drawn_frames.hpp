// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <opencv2/imgproc.hpp>

#include "angio/geometry/xray_camera.hpp"
#include "angio/test/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::test {

inline constexpr int kSide_px = 512;           ///< Of a drawn image.
inline constexpr double kPeriod_s = 1.0 / 15;  ///< Of drawn frames.

/// Draws a tree as lines of one width on smooth noise: an image that shares nothing with the simulated X-ray, neither
/// radii nor attenuation, scatter or quanta. `points` are the tree's, in the camera frame [m], 3 x N.
inline cv::Mat drawnFrame(const VesselTree& tree, const Eigen::Matrix3Xd& points, const XrayCamera& camera,
                          std::uint64_t seed, int side_px) {
  cv::RNG random(seed + 1);
  cv::Mat noise(side_px, side_px, CV_32F), coarse(side_px / 16, side_px / 16, CV_32F), image;
  random.fill(noise, cv::RNG::NORMAL, 0, 12);
  cv::GaussianBlur(noise, noise, {}, 1.5);
  random.fill(coarse, cv::RNG::NORMAL, 0, 10);
  cv::resize(coarse, image, noise.size(), 0, 0, cv::INTER_CUBIC);
  image += noise + 170;
  constexpr int kBits = 4;  // Of a pixel's fraction.
  cv::Mat lines(side_px, side_px, CV_8U, cv::Scalar(0)), drawn;
  const auto at = [&](Eigen::Index i) {
    const auto px = camera.project(points.col(i));
    return cv::Point(cvRound((px->x()) * (1 << kBits)), cvRound((px->y()) * (1 << kBits)));
  };
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const int parent = tree.parents()[static_cast<std::size_t>(i)];
    if (parent >= 0) cv::line(lines, at(parent), at(i), cv::Scalar(255), 5, cv::LINE_AA, kBits);
  }
  cv::GaussianBlur(lines, lines, {}, 1);
  lines.convertTo(drawn, CV_32F, 70.0 / 255);
  image -= drawn;
  image.convertTo(image, CV_8U);
  return image;
}

}  // namespace angio::test
