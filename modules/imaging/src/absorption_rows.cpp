// SPDX-License-Identifier: GPL-2.0-or-later
#include "absorption_rows.hpp"

#include <algorithm>
#include <numeric>
#include <opencv2/core.hpp>

#include "ridge_filters.hpp"

namespace angio::imaging {
namespace {

// Added to every pixel, as a part of the mean: it keeps the logarithm of black pixels finite.
constexpr float kDarkLevel = 0.05f;

// The collimator is far from the detector: its edge is blurred over some pixels [working px].
constexpr float kBlurredEdge = 3;

// Pixels at the border of the open field whose mean goes on beyond it.
constexpr int kEdgeMean = 4;

bool isLit(const RowRange& row) { return row.end - row.begin > 2 * kEdgeMean; }

}  // namespace

void AbsorptionRows::begin(const cv::Mat& image, const WorkingGrid& grid, Polarity polarity, double border_px) {
  gather(image, grid, polarity);
  findShadow(image, grid, border_px);
  made_ = 0;
  if (lit_.empty() || first_lit_ == 0) return;
  make(first_lit_);
  for (int y = 0; y < first_lit_; ++y) copy(first_lit_, y);
  made_ = first_lit_ + 1;
}

void AbsorptionRows::gather(const cv::Mat& image, const WorkingGrid& grid, Polarity polarity) {
  absorption_.resize(grid.size.width, grid.size.height);
  cv::Mat working = absorption_.mat();
  const cv::Mat seen = image(grid.roi);
  if (grid.size == grid.roi.size()) {
    seen.convertTo(working, CV_32F);
  } else {
    shrink_(seen, grid.size, absorption_);
  }
  // A bright vessel is a picture printed in the negative; undone, it obeys Beer and Lambert like any other.
  if (polarity == Polarity::kBright) cv::subtract(image.depth() == CV_8U ? 255 : 65535, working, working);
  dark_ = kDarkLevel * static_cast<float>(cv::mean(working)[0]) + 1e-3f;
}

void AbsorptionRows::findShadow(const cv::Mat& image, const WorkingGrid& grid, double border_px) {
  lit_.clear();
  std::vector<cv::Point2f> outline = outlineOfField(image);
  for (cv::Point2f& p : outline) p = grid.toWorking(p);
  if (outline.empty()) {
    open_.assign(grid.size.height, {0, grid.size.width});
    return;
  }
  const float border = static_cast<float>(border_px) / grid.scale;
  open_ = rowsInside(outline, grid.size, border + 2 * kBlurredEdge);
  const std::vector<RowRange> lit = rowsInside(outline, grid.size, border + kBlurredEdge);
  const auto top = std::find_if(lit.begin(), lit.end(), isLit);
  const auto bottom = std::find_if(lit.rbegin(), lit.rend(), isLit);
  if (top == lit.end()) return;
  first_lit_ = static_cast<int>(top - lit.begin());
  last_lit_ = static_cast<int>(lit.rend() - bottom) - 1;
  lit_ = lit;
}

void AbsorptionRows::makeBefore(int end) {
  for (; made_ < end; ++made_) {
    if (!lit_.empty() && made_ > last_lit_) {
      copy(last_lit_, made_);
    } else {
      make(made_);
    }
  }
}

// Beer and Lambert: the logarithm is linear in what the beam has passed.
void AbsorptionRows::make(int y) {
  float* const row = absorption_.row(y);
  const int width = absorption_.width();
  toAbsorption(row, width, dark_, 0);
  if (lit_.empty() || !isLit(lit_[y])) return;
  const int begin = lit_[y].begin, end = lit_[y].end;
  std::fill(row, row + begin, std::accumulate(row + begin, row + begin + kEdgeMean, 0.0f) / kEdgeMean);
  std::fill(row + end, row + width, std::accumulate(row + end - kEdgeMean, row + end, 0.0f) / kEdgeMean);
}

void AbsorptionRows::copy(int from, int to) {
  std::copy_n(absorption_.row(from), absorption_.width(), absorption_.row(to));
}

}  // namespace angio::imaging
