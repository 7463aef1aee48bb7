// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <numeric>
#include <opencv2/core.hpp>
#include <optional>

#include "angio/imaging/thinning.hpp"
#include "catheters.hpp"
#include "expected_lines.hpp"
#include "field_outline.hpp"
#include "flatten.hpp"
#include "hysteresis.hpp"
#include "line_flanks.hpp"
#include "line_kinds.hpp"
#include "make_extractors.hpp"
#include "quantile.hpp"
#include "ridge_lines.hpp"
#include "ridge_scales.hpp"
#include "skeleton_graph.hpp"
#include "unlikely_lines.hpp"
#include "xray_image.hpp"

namespace angio::imaging {
namespace {

// Added to every pixel, as a part of the mean: it keeps the logarithm of black pixels finite.
constexpr float kDarkLevel = 0.05f;

// Smaller images hold no line with a background on both sides.
constexpr int kMinSide = 24;

// Strength of a line at its own scale, in its contrast.
constexpr float kStrengthPerContrast = 0.4f;

// Part of salient ridge pixels that are weaker than what counts as the image's strong vessels.
constexpr float kStrongPart = 0.9f;

// Ridge pixels above `line_factor` that a region must have to be looked at.
constexpr int kSeeds = 6;

// The collimator is far from the detector: its edge is blurred over some pixels [working px].
constexpr float kBlurredEdge = 3;

// Pixels at the border of the open field whose mean goes on beyond it.
constexpr int kEdgeMean = 4;

// What has this part of the evidence that a clean image asks for is fitted: whether it is a vessel, the fit and the
// rest of the image say.
constexpr float kFitted = 0.4f;

// Length of a catheter that is told from a vessel, in the image's shorter side.
constexpr float kMinDevice = 0.12f;

// The image beside lines is compared under this filter [working px].
constexpr float kFlankBlur = 1;

class RidgeExtractor final : public CenterlineExtractor {
 public:
  RidgeExtractor(const RidgeSettings& settings, LineObserver observe)
      : settings_(settings), observe_(std::move(observe)) {}

  Centerline2d extract(const cv::Mat& image) override { return extract(image, nullptr); }
  Centerline2d extract(const cv::Mat& image, const Centerline2d& expected) override {
    return extract(image, expected.ordered() ? &expected : nullptr);
  }

 private:
  Centerline2d extract(const cv::Mat& image, const Centerline2d* expected) {
    requireXray(image);
    const WorkingGrid grid(image.size(), settings_.border_px, settings_.working_side_px);
    if (std::min(grid.size.width, grid.size.height) < kMinSide) return {};
    prepareFor(grid.scale);
    absorb(image, grid);
    coverShadow(image, grid);
    const float faintest = kStrengthPerContrast * static_cast<float>(settings_.faintest_absorption);
    scales_->analyse(absorption_, {static_cast<float>(settings_.noise_factor), faintest});
    const float weakest = std::max(static_cast<float>(settings_.relative_contrast) * strongVessels(), 1e-9f);
    const Plane &strength = scales_->strength(), &salience = scales_->salience();
    const auto classesOf = [&](int y) {
      return [=, value = strength.row(y), stands_out = salience.row(y)](int x) {
        const int weak = value[x] > weakest ? 1 : 0;
        return weak + (weak & (stands_out[x] > static_cast<float>(RidgeSettings::line_factor) ? 1 : 0));
      };
    };
    cv::Mat& mask = regions_({strength.width(), strength.height()}, open_, classesOf,
                             [](std::size_t, int strong) { return strong >= kSeeds; });
    thin(mask);
    SkeletonGraph graph = traceSkeleton(mask, scales_->radiusMat());
    clean(graph, grid.scale);
    std::optional<ExpectedLines> known;
    if (expected) known.emplace(*expected, grid).addTo(graph);
    std::vector<CentreLine> lines = (*fitting_)(graph, *scales_);
    dropAlongBorder(lines, open_);
    const float side = static_cast<float>(std::min(grid.size.width, grid.size.height));
    if (known) known->markIn(lines);
    tellWires(lines);
    compareFlanks(lines, scales_->imageUpTo(kFlankBlur));
    if (observe_) observe_(lines, grid);
    // Clutter is no catheter's branch, and no measure of what vessels absorb; nor is it part of a tree.
    const float least_density = static_cast<float>(settings_.relative_density);
    dropUnlikely(lines, side, least_density);
    tellCatheters(lines, open_, kMinDevice * side);
    dropUnlikely(lines, side, least_density);
    return sampled(lines, grid, settings_.spacing_px);
  }

  // Scales follow the size of the working pixel, which a stream of images rarely changes.
  void prepareFor(float scale) {
    if (scales_ && scale == scale_) return;
    const float largest = static_cast<float>(settings_.max_radius_px) / scale;
    scales_.emplace(largest);
    fitting_.emplace(largest, *scales_);
    scale_ = scale;
  }

  // Beer and Lambert: the logarithm is linear in what the beam has passed.
  void absorb(const cv::Mat& image, const WorkingGrid& grid) {
    absorption_.resize(grid.size.width, grid.size.height);
    cv::Mat working = absorption_.mat();
    const cv::Mat seen = image(grid.roi);
    if (grid.size == grid.roi.size()) {
      seen.convertTo(working, CV_32F);
    } else {
      shrink_(seen, grid.size, absorption_);
    }
    const bool negative = settings_.polarity == Polarity::kBright;
    // A bright vessel is a picture printed in the negative; undone, it obeys Beer and Lambert like any other.
    if (negative) cv::subtract(image.depth() == CV_8U ? 255 : 65535, working, working);
    const float mean = static_cast<float>(cv::mean(working)[0]);
    toAbsorption(absorption_, kDarkLevel * mean + 1e-3f, 0);
  }

  // Puts what is at the border of the open field in the place of the collimator's shadow: there is then no edge to
  // answer to, and no noise of the dark.
  void coverShadow(const cv::Mat& image, const WorkingGrid& grid) {
    const float scale = grid.scale, border = static_cast<float>(settings_.border_px) / scale;
    std::vector<cv::Point2f> outline = outlineOfField(image);
    for (cv::Point2f& p : outline) p = grid.toWorking(p);
    if (outline.empty()) {
      open_.assign(grid.size.height, {0, grid.size.width});
      return;
    }
    const std::vector<RowRange> seen = rowsInside(outline, grid.size, border + kBlurredEdge);
    const auto lit = [](const RowRange& row) { return row.end - row.begin > 2 * kEdgeMean; };
    const auto top = std::find_if(seen.begin(), seen.end(), lit);
    const auto bottom = std::find_if(seen.rbegin(), seen.rend(), lit);
    open_ = rowsInside(outline, grid.size, border + 2 * kBlurredEdge);
    if (top == seen.end()) return;
    const int first = static_cast<int>(top - seen.begin()), last = static_cast<int>(seen.rend() - bottom) - 1;
    for (int y = first; y <= last; ++y) {
      if (!lit(seen[y])) continue;
      float* row = absorption_.row(y);
      const int begin = seen[y].begin, end = seen[y].end;
      std::fill(row, row + begin, std::accumulate(row + begin, row + begin + kEdgeMean, 0.0f) / kEdgeMean);
      std::fill(row + end, row + grid.size.width, std::accumulate(row + end - kEdgeMean, row + end, 0.0f) / kEdgeMean);
    }
    for (int y = 0; y < first; ++y) std::copy_n(absorption_.row(first), grid.size.width, absorption_.row(y));
    for (int y = last + 1; y < grid.size.height; ++y) {
      std::copy_n(absorption_.row(last), grid.size.width, absorption_.row(y));
    }
  }

  // Ridge strength of the image's strong vessels, 0 where there is none.
  float strongVessels() {
    sample_.clear();
    const Plane &strength = scales_->strength(), &salience = scales_->salience();
    for (int y = 0; y < strength.height(); y += 4) {
      const float *value = strength.row(y), *stands_out = salience.row(y);
      for (int x = 0; x < strength.width(); ++x) {
        if (stands_out[x] > static_cast<float>(settings_.line_factor)) sample_.push_back(value[x]);
      }
    }
    return sample_.empty() ? 0 : quantileOf(sample_, kStrongPart);
  }

  void clean(SkeletonGraph& graph, float scale) {
    const cv::Mat radius = scales_->radiusMat();
    settleRadii(graph, radius);
    closeGaps(graph, radius, static_cast<float>(settings_.max_gap_px) / scale, owner_);
    prune(graph, radius, {static_cast<float>(settings_.min_branch_px) / scale});
    // Tips are clean only now: what forked off there pointed elsewhere.
    closeGaps(graph, radius, static_cast<float>(settings_.max_gap_px) / scale, owner_);
    dropWeak(graph, scales_->salienceMat(), radius,
             {kFitted * static_cast<float>(settings_.evidence), static_cast<float>(settings_.min_line_px) / scale});
    settleRadii(graph, radius);
    passJunctions(graph, radius);
  }

  RidgeSettings settings_;
  LineObserver observe_;
  float scale_ = 0;
  std::optional<RidgeScales> scales_;
  std::optional<RidgeFitting> fitting_;
  Hysteresis regions_;
  Plane absorption_;
  AreaResampler shrink_;
  cv::Mat owner_;
  std::vector<RowRange> open_;
  std::vector<float> sample_;
};

}  // namespace

std::unique_ptr<CenterlineExtractor> make(const RidgeSettings& settings, LineObserver observe) {
  return std::make_unique<RidgeExtractor>(settings, std::move(observe));
}

}  // namespace angio::imaging
