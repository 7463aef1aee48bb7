// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/camera_pictures.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/plotting/plot.hpp"
#include "angio/plotting/subpixel.hpp"

namespace angio::calibration {
namespace {

constexpr int kMinSide_px = 900;
constexpr int kCells = 16;  // Of the coverage map, along its longer side.
const cv::Scalar kSeen(80, 220, 120), kProjected(60, 160, 255), kLeftOut(60, 60, 240), kGround(28, 28, 28);

// From detector to picture: whole pixels, enlarged by a whole number where the detector is small.
struct Canvas {
  explicit Canvas(const XrayCamera& camera)
      : scale(std::max(1, static_cast<int>(std::ceil(static_cast<double>(kMinSide_px) / camera.width_px())))),
        size(scale * camera.width_px(), scale * camera.height_px()) {}

  cv::Point at(const Eigen::Vector2d& px) const {
    return subpixel({scale * (px.x() + 0.5) - 0.5, scale * (px.y() + 0.5) - 0.5});
  }

  int scale;
  cv::Size size;
};

cv::Mat inColors(const cv::Mat& image, const Canvas& canvas) {
  if (image.empty()) return cv::Mat(canvas.size, CV_8UC3, kGround);
  cv::Mat grey, picture;
  double low = 0, high = 0;
  cv::minMaxLoc(image, &low, &high);
  image.convertTo(grey, CV_8U, 255 / std::max(1.0, high - low), -255 * low / std::max(1.0, high - low));
  cv::resize(grey, grey, canvas.size, 0, 0, cv::INTER_CUBIC);
  cv::cvtColor(grey, picture, cv::COLOR_GRAY2BGR);
  return picture;
}

double medianResidual_px(const CameraCalibration& result) {
  std::vector<double> lengths;
  for (const CalibratedView& view : result.views) {
    for (Eigen::Index i = 0; i < view.residuals_px.cols(); ++i) {
      if (!view.is_outlier[i]) lengths.push_back(view.residuals_px.col(i).norm());
    }
  }
  if (lengths.empty()) return 1;
  std::nth_element(lengths.begin(), lengths.begin() + lengths.size() / 2, lengths.end());
  return std::max(1e-6, lengths[lengths.size() / 2]);
}

}  // namespace

cv::Mat viewOverlay(const CameraCalibration& result, std::size_t index, const cv::Mat& image) {
  const Canvas canvas(result.camera.camera);
  const CalibratedView& view = result.views[index];
  cv::Mat picture = inColors(image, canvas);
  constexpr int kShift = kSubpixelBits, kUnit = 1 << kShift;
  for (std::size_t i = 0; i < view.beads.size(); ++i) {
    const Eigen::Vector2d seen_px = view.beads[i].center_px;
    const cv::Scalar color = view.is_outlier[i] ? kLeftOut : kSeen;
    cv::circle(picture, canvas.at(seen_px), 7 * kUnit, color, 1, cv::LINE_AA, kShift);
    const cv::Point at = canvas.at(seen_px + view.residuals_px.col(i));
    const int arm = 4 * kUnit;
    cv::line(picture, at - cv::Point(arm, 0), at + cv::Point(arm, 0), kProjected, 1, cv::LINE_AA, kShift);
    cv::line(picture, at - cv::Point(0, arm), at + cv::Point(0, arm), kProjected, 1, cv::LINE_AA, kShift);
  }
  return picture;
}

ResidualField residualField(const CameraCalibration& result) {
  const Canvas canvas(result.camera.camera);
  // So that the usual arrow is a fortieth of the detector long.
  ResidualField field;
  field.enlargement = roundedDown(0.025 * result.camera.camera.width_px() / medianResidual_px(result));
  field.picture = cv::Mat(canvas.size, CV_8UC3, cv::Scalar::all(255));
  for (std::size_t v = 0; v < result.views.size(); ++v) {
    const CalibratedView& view = result.views[v];
    if (view.left_out) continue;
    const cv::Scalar color = plotColor(static_cast<int>(v));
    for (std::size_t i = 0; i < view.beads.size(); ++i) {
      if (view.is_outlier[i]) continue;
      const Eigen::Vector2d from = view.beads[i].center_px;
      const Eigen::Vector2d to = from + field.enlargement * view.residuals_px.col(i);
      cv::line(field.picture, canvas.at(from), canvas.at(to), color, 1, cv::LINE_AA, kSubpixelBits);
      cv::circle(field.picture, canvas.at(from), 2 << kSubpixelBits, color, cv::FILLED, cv::LINE_AA, kSubpixelBits);
    }
  }
  return field;
}

cv::Mat coverageMap(const CameraCalibration& result) {
  const XrayCamera& camera = result.camera.camera;
  const Canvas canvas(camera);
  const double cell_px = static_cast<double>(std::max(camera.width_px(), camera.height_px())) / kCells;
  const int columns = static_cast<int>(std::ceil(camera.width_px() / cell_px));
  const int rows = static_cast<int>(std::ceil(camera.height_px() / cell_px));
  cv::Mat counts(rows, columns, CV_32S, cv::Scalar(0));
  for (const CalibratedView& view : result.views) {
    for (const SeenBead& bead : view.beads) {
      const int x = static_cast<int>((bead.center_px.x() + 0.5) / cell_px);
      const int y = static_cast<int>((bead.center_px.y() + 0.5) / cell_px);
      ++counts.at<int>(std::clamp(y, 0, rows - 1), std::clamp(x, 0, columns - 1));
    }
  }
  double most = 1;
  cv::minMaxLoc(counts, nullptr, &most);
  cv::Mat grey, picture;
  counts.convertTo(grey, CV_8U, 255 / std::max(1.0, most));
  cv::applyColorMap(grey, picture, cv::COLORMAP_VIRIDIS);
  cv::resize(picture, picture, canvas.size, 0, 0, cv::INTER_NEAREST);
  const double side = canvas.scale * cell_px;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const int count = counts.at<int>(y, x);
      const cv::Scalar color = count > 0.6 * most ? cv::Scalar::all(0) : cv::Scalar::all(255);
      cv::putText(picture, std::to_string(count),
                  {static_cast<int>((x + 0.2) * side), static_cast<int>((y + 0.6) * side)}, cv::FONT_HERSHEY_SIMPLEX,
                  0.4, color, 1, cv::LINE_AA);
    }
  }
  return picture;
}

}  // namespace angio::calibration
