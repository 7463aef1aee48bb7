// SPDX-License-Identifier: GPL-2.0-or-later
#include "flatten.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "quantile.hpp"

namespace angio::imaging {
namespace {

// Working pixels per pixel of the background's image: the widest vessel is still several of them.
constexpr int kCoarseStep = 4;

// Added to every pixel, as a part of the mean: it keeps the logarithm of black pixels finite, and the noise of a
// collimator's shadow, or of an image stretched to full black, from being the strongest absorption there is. Vessels
// lose a little contrast by it where the body is thick, and noise as much.
constexpr double kFlatDarkLevel = 0.2;

// Noise is measured in blocks of this many working pixels, at every other one of them: in the logarithm it rises where
// the body is thick, so that one number for the image would find vessels in the noise of its darkest part.
constexpr int kNoiseBlock = 32;

// Quantiles of a block that vessels hardly reach, even where they cover half of it, and where a normal distribution has
// them in standard deviations.
constexpr float kLowPart = 0.10f, kHighPart = 0.35f, kLowPlace = -1.2816f, kHighPlace = -0.3853f;

// How much the background may bend, in absorption over half of `background_px`.
constexpr float kBend = 0.15f;

void raiseTo(float* to, const float* from, int count, float drop) {
  for (int i = 0; i < count; ++i) to[i] = std::max(to[i], from[i] - drop);
}

// Greatest value within `reach` pixels less a paraboloid's fall, which is kBend at `reach`: rows first, then columns.
void parabolicDilation(cv::Mat& image, cv::Mat& rows, int reach) {
  const auto drop = [reach](int k) { return kBend * static_cast<float>(k * k) / static_cast<float>(reach * reach); };
  image.copyTo(rows);
  for (int y = 0; y < image.rows; ++y) {
    for (int k = 1; k <= reach; ++k) {
      raiseTo(rows.ptr<float>(y), image.ptr<float>(y) + k, image.cols - k, drop(k));
      raiseTo(rows.ptr<float>(y) + k, image.ptr<float>(y), image.cols - k, drop(k));
    }
  }
  rows.copyTo(image);
  for (int y = 0; y < image.rows; ++y) {
    for (int k = 1; k <= reach; ++k) {
      if (y >= k) raiseTo(image.ptr<float>(y), rows.ptr<float>(y - k), image.cols, drop(k));
      if (y + k < image.rows) raiseTo(image.ptr<float>(y), rows.ptr<float>(y + k), image.cols, drop(k));
    }
  }
}

}  // namespace

WorkingGrid::WorkingGrid(const cv::Size& image, double border_px, int working_side) {
  const int shorter = std::min(image.width, image.height);
  const int margin = std::min(static_cast<int>(std::lround(border_px)), (shorter - 1) / 2);
  roi = cv::Rect(margin, margin, image.width - 2 * margin, image.height - 2 * margin);
  const double shrunken = std::max(1.0, static_cast<double>(shorter) / working_side);
  scale = static_cast<float>(shrunken);
  size = cv::Size(std::max(1, static_cast<int>(roi.width / shrunken)),
                  std::max(1, static_cast<int>(roi.height / shrunken)));
  // Whole pixels on both sides: the two axes' steps differ by less than a pixel over the image.
  step_ = {static_cast<float>(roi.width) / static_cast<float>(size.width),
           static_cast<float>(roi.height) / static_cast<float>(size.height)};
}

cv::Point2f WorkingGrid::toImage(const cv::Point2f& p) const {
  return {static_cast<float>(roi.x) + step_.x * (p.x + 0.5f) - 0.5f,
          static_cast<float>(roi.y) + step_.y * (p.y + 0.5f) - 0.5f};
}

cv::Point2f WorkingGrid::toWorking(const cv::Point2f& p) const {
  return {(p.x - static_cast<float>(roi.x) + 0.5f) / step_.x - 0.5f,
          (p.y - static_cast<float>(roi.y) + 0.5f) / step_.y - 0.5f};
}

std::vector<RowRange> openRows(const cv::Mat& image, const WorkingGrid& grid, float inset) {
  std::vector<cv::Point2f> outline = outlineOfField(image);
  for (cv::Point2f& p : outline) p = grid.toWorking(p);
  if (outline.empty()) return std::vector<RowRange>(static_cast<std::size_t>(grid.size.height), {0, grid.size.width});
  return rowsInside(outline, grid.size, inset);
}

Flattened Flattening::operator()(const cv::Mat& image, const WorkingGrid& grid) {
  cv::resize(image(grid.roi), shrunken_, grid.size, 0, 0, cv::INTER_AREA);
  // A bright vessel is a picture printed in the negative; undone, it obeys Beer and Lambert like any other.
  const double full = image.depth() == CV_8U ? 255 : 65535;
  const bool negative = settings_.polarity == Polarity::kBright;
  const double mean = cv::mean(shrunken_)[0];
  const double level = kFlatDarkLevel * (negative ? full - mean : mean) + 1e-3;
  shrunken_.convertTo(absorption_, CV_32F, negative ? -1 : 1, (negative ? full : 0) + level);
  cv::log(absorption_, absorption_);
  estimateBackground(grid);
  cv::subtract(background_, absorption_, absorption_);
  const double sigma = settings_.smoothing_px / grid.scale;
  if (sigma > 0.1) cv::GaussianBlur(absorption_, absorption_, cv::Size(), sigma, sigma, cv::BORDER_REFLECT_101);
  measureNoise();
  return {absorption_, noise_, background_};
}

// The logarithm of the image without vessels. A closing fills dark structures narrower than its element, however much
// they absorb, where a mean or a wide median would be pulled along by them. The element is a paraboloid: a flat one
// would cut the tops of the tissue's smooth hills off and leave them standing as vessels.
void Flattening::estimateBackground(const WorkingGrid& grid) {
  const cv::Size coarse_size(std::max(1, grid.size.width / kCoarseStep), std::max(1, grid.size.height / kCoarseStep));
  cv::resize(absorption_, coarse_, coarse_size, 0, 0, cv::INTER_AREA);
  const int reach =
      std::max(1, static_cast<int>(std::lround(0.5 * settings_.background_px / (grid.scale * kCoarseStep))));
  // The edge goes on outside, so that a dark rim of the detector counts as background however narrow it is.
  cv::copyMakeBorder(coarse_, closed_, 2 * reach, 2 * reach, 2 * reach, 2 * reach, cv::BORDER_REPLICATE);
  parabolicDilation(closed_, rows_, reach);
  cv::subtract(0, closed_, closed_);
  parabolicDilation(closed_, rows_, reach);
  cv::subtract(0, closed_(cv::Rect(cv::Point(2 * reach, 2 * reach), coarse_size)), coarse_);
  cv::resize(coarse_, background_, grid.size, 0, 0, cv::INTER_LINEAR);
}

void Flattening::measureNoise() {
  const int rows = std::max(1, absorption_.rows / kNoiseBlock), cols = std::max(1, absorption_.cols / kNoiseBlock);
  block_level_.create(rows, cols, CV_32F);
  block_noise_.create(rows, cols, CV_32F);
  for (int by = 0; by < rows; ++by) {
    for (int bx = 0; bx < cols; ++bx) {
      sample_.clear();
      for (int y = by * absorption_.rows / rows; y < (by + 1) * absorption_.rows / rows; y += 2) {
        const float* row = absorption_.ptr<float>(y);
        for (int x = bx * absorption_.cols / cols; x < (bx + 1) * absorption_.cols / cols; x += 2) {
          sample_.push_back(row[x]);
        }
      }
      const float low = quantileOf(sample_, kLowPart), high = quantileOf(sample_, kHighPart);
      const float sigma = (high - low) / (kHighPlace - kLowPlace);
      block_noise_.at<float>(by, bx) = sigma;
      block_level_.at<float>(by, bx) = high - kHighPlace * sigma;
    }
  }
  cv::medianBlur(block_noise_, block_noise_, 3);
  cv::medianBlur(block_level_, block_level_, 3);
  cv::resize(block_noise_, noise_, absorption_.size(), 0, 0, cv::INTER_LINEAR);
  cv::resize(block_level_, level_, absorption_.size(), 0, 0, cv::INTER_LINEAR);
  // The closing lies above the background by as much as noise does: what is left has its zero at the background again.
  cv::subtract(absorption_, level_, absorption_);
  cv::subtract(background_, level_, background_);
}

}  // namespace angio::imaging
