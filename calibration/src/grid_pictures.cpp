// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/grid_pictures.hpp"

#include <opencv2/imgproc.hpp>
#include <set>

#include "angio/plotting/subpixel.hpp"

namespace angio::calibration {

cv::Mat gridOverlay(const HoleGrid& grid, const GridDistortion& fit, const cv::Mat& image) {
  constexpr int kScale = 2, kShift = kSubpixelBits;
  const cv::Scalar fitted(80, 220, 120), cut(60, 180, 255), outlier(60, 60, 240), way(255, 160, 60);
  cv::Mat grey, picture;
  double brightest = 1;
  cv::minMaxLoc(image, nullptr, &brightest);
  image.convertTo(grey, CV_8U, 160 / std::max(1.0, brightest));
  cv::resize(grey, grey, {}, kScale, kScale, cv::INTER_LINEAR);
  cv::cvtColor(grey, picture, cv::COLOR_GRAY2BGR);
  const auto at = [](const Eigen::Vector2d& px) {
    return subpixel({kScale * (px.x() + 0.5) - 0.5, kScale * (px.y() + 0.5) - 0.5});
  };
  const std::set<std::size_t> outliers(fit.outliers.begin(), fit.outliers.end());
  for (std::size_t i = 0; i < grid.holes.size(); ++i) {
    const GridHole& hole = grid.holes[i];
    if (const auto regular_px = fit.distortion.undistorted(hole.center_px)) {
      cv::line(picture, at(hole.center_px), at(*regular_px), way, 1, cv::LINE_AA, kShift);
    }
    const cv::Scalar& color = outliers.count(i) ? outlier : hole.whole ? fitted : cut;
    cv::circle(picture, at(hole.center_px), 3 << kShift, color, 1, cv::LINE_AA, kShift);
  }
  return picture;
}

}  // namespace angio::calibration
