// SPDX-License-Identifier: GPL-2.0-or-later
#include "bead_blobs.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/imaging/collimator_opening.hpp"

namespace angio::calibration {
namespace {

constexpr double kBlobOfRadius = 0.58;  // Standard deviation of the blob that answers a ball's shadow best, in radii.
constexpr int kMargin_px = 2;           // Of the open field, where its edge is soft.

}  // namespace

cv::Mat openPixels(const cv::Mat& image) {
  const OpenField field = findOpenField(image);
  if (field.polygon_px.empty()) return cv::Mat(image.size(), CV_8UC1, cv::Scalar(255));
  cv::Mat inner;
  cv::erode(field.mask, inner, cv::Mat(), {-1, -1}, kMargin_px, cv::BORDER_CONSTANT, cv::Scalar(255));
  return inner;
}

cv::Mat withoutGround(const cv::Mat& values, double max_radius_px) {
  cv::Mat absorption;
  cv::log(cv::max(values, 1), absorption);
  absorption = -absorption;
  cv::Mat smooth, small, ground;
  cv::GaussianBlur(absorption, smooth, {0, 0}, 1.0);
  cv::resize(smooth, small, {}, 0.5, 0.5, cv::INTER_AREA);
  const int side = 2 * static_cast<int>(std::ceil(1.2 * max_radius_px)) + 1;  // At half the size: 2.4 radii each way.
  cv::morphologyEx(small, small, cv::MORPH_OPEN, cv::getStructuringElement(cv::MORPH_RECT, {side, side}));
  cv::GaussianBlur(small, small, {0, 0}, 0.25 * side);
  cv::resize(small, ground, absorption.size(), 0, 0, cv::INTER_LINEAR);
  return absorption - ground;
}

std::vector<BeadCandidate> blobs(const cv::Mat& above_ground, const cv::Mat& mask,
                                 const BeadDetectionSettings& settings, double min_response) {
  std::vector<double> radii;
  for (double r = settings.smallest_radius_px; r < settings.max_radius_px * kBlobScaleStep; r *= kBlobScaleStep) {
    radii.push_back(r);
  }
  std::vector<cv::Mat> responses;
  for (const double r : radii) {
    const double sigma = kBlobOfRadius * r;
    cv::Mat smooth, laplacian;
    // Ground goes on beyond the border: a mirror image there would draw the blob of a ball that is cut onto it.
    cv::GaussianBlur(above_ground, smooth, {0, 0}, sigma, 0, cv::BORDER_CONSTANT);
    cv::Laplacian(smooth, laplacian, CV_32F, 1, 1, 0, cv::BORDER_CONSTANT);
    responses.push_back(-sigma * sigma * laplacian);
  }
  std::vector<BeadCandidate> found;
  const int border = std::max(1, static_cast<int>(settings.border_px));
  for (std::size_t s = 0; s < responses.size(); ++s) {
    for (int y = border; y < above_ground.rows - border; ++y) {
      const float* const row = responses[s].ptr<float>(y);
      for (int x = border; x < above_ground.cols - border; ++x) {
        const float value = row[x];
        if (value < min_response || !mask.at<unsigned char>(y, x)) continue;
        bool largest = true;
        for (std::size_t other = s > 0 ? s - 1 : 0; other <= std::min(s + 1, responses.size() - 1) && largest;
             ++other) {
          for (int dy = -1; dy <= 1 && largest; ++dy) {
            const float* const near = responses[other].ptr<float>(y + dy);
            largest = near[x - 1] <= value && near[x] <= value && near[x + 1] <= value;
          }
        }
        if (largest) found.push_back({{Eigen::Vector2d(x, y), radii[s], 1}, value});
      }
    }
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const BeadCandidate& a, const BeadCandidate& b) { return a.response > b.response; });
  return found;
}

}  // namespace angio::calibration
