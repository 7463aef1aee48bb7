// SPDX-License-Identifier: GPL-2.0-or-later
#include "grid_photograph.hpp"

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "angio/base/errors.hpp"

namespace angio::calibration {
namespace {

constexpr int kCornerWindow_px = 5;  // Half of it: small enough for squares of 12 px.

cv::Mat inBytes(const cv::Mat& image) {
  if (image.depth() == CV_8U) return image;
  cv::Mat bytes;
  cv::normalize(image, bytes, 0, 255, cv::NORM_MINMAX, CV_8U);
  return bytes;
}

bool findMarks(const cv::Mat& image, const FlatPattern& pattern, std::vector<cv::Point2f>& marks) {
  const cv::Size size(pattern.columns, pattern.rows);
  if (pattern.kind != FlatPattern::Kind::kChessboard) {
    const bool shifted = pattern.kind == FlatPattern::Kind::kShiftedCircles;
    return cv::findCirclesGrid(image, size, marks,
                               shifted ? cv::CALIB_CB_ASYMMETRIC_GRID : cv::CALIB_CB_SYMMETRIC_GRID);
  }
  if (!cv::findChessboardCorners(image, size, marks, cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE)) {
    return false;
  }
  cv::cornerSubPix(image, marks, {kCornerWindow_px, kCornerWindow_px}, {-1, -1},
                   cv::TermCriteria(cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 100, 1e-4));
  return true;
}

}  // namespace

BeadPhantom phantomOf(const FlatPattern& pattern) {
  BeadPhantom phantom;
  phantom.name = pattern.kind == FlatPattern::Kind::kChessboard ? "chessboard" : "circle grid";
  const bool shifted = pattern.kind == FlatPattern::Kind::kShiftedCircles;
  for (int row = 0; row < pattern.rows; ++row) {
    for (int column = 0; column < pattern.columns; ++column) {
      // OpenCV's asymmetric grid: every other row is shifted by half of the distance in a row.
      const int x = shifted ? 2 * column + row % 2 : column;
      phantom.beads.push_back({pattern.spacing_m * Eigen::Vector3d(x, row, 0), 0});
    }
  }
  return phantom;
}

std::vector<BeadDetection> detectPattern(const std::string& path, const cv::Mat& image, const FlatPattern& pattern) {
  std::vector<cv::Point2f> marks;
  const BeadPhantom phantom = phantomOf(pattern);
  if (!findMarks(inBytes(image), pattern, marks) || marks.size() != phantom.beads.size()) {
    throw InputError(path, phantom.name, std::to_string(pattern.columns) + " x " + std::to_string(pattern.rows),
                     "was not found: all of it must be in the picture, dark on bright");
  }
  std::vector<BeadDetection> found;
  for (std::size_t i = 0; i < marks.size(); ++i) {
    BeadDetection mark;
    mark.center_px = {marks[i].x, marks[i].y};
    mark.bead = static_cast<int>(i);
    found.push_back(mark);
  }
  return found;
}

}  // namespace angio::calibration
