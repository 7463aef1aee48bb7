// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <opencv2/core.hpp>
#include <optional>

#include "absorption_rows.hpp"
#include "catheters.hpp"
#include "expected_lines.hpp"
#include "flatten.hpp"
#include "framed_masks.hpp"
#include "hysteresis.hpp"
#include "line_flanks.hpp"
#include "line_kinds.hpp"
#include "make_extractors.hpp"
#include "quantile.hpp"
#include "ridge_classes.hpp"
#include "ridge_lines.hpp"
#include "ridge_scales.hpp"
#include "skeleton_graph.hpp"
#include "unlikely_lines.hpp"
#include "xray_image.hpp"

namespace angio::imaging {
namespace {

// Smaller images hold no line with a background on both sides.
constexpr int kMinSide = 24;

// Strength of a line at its own scale, in its contrast.
constexpr float kStrengthPerContrast = 0.4f;

// Part of salient ridge pixels that are weaker than what counts as the image's strong vessels.
constexpr float kStrongPart = 0.9f;

// Ridge pixels above `line_factor` that a region must have to be looked at.
constexpr int kSeeds = 6;

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
    absorption_.begin(image, grid, settings_.polarity, settings_.border_px);
    const float faintest = kStrengthPerContrast * static_cast<float>(settings_.faintest_absorption);
    scales_->analyse(absorption_.image(), [&](int end) { absorption_.makeBefore(end); },
                     {static_cast<float>(settings_.noise_factor), faintest});
    const float weakest = std::max(static_cast<float>(settings_.relative_contrast) * strongVessels(), 1e-9f);
    const LinePlane& strength = scales_->strength();
    const auto classify = [&](int y, const RowRange& part, std::uint8_t* to) {
      classifyRidge(scales_->pixelsOf(y), part, weakest, static_cast<float>(RidgeSettings::line_factor), to);
    };
    cv::Mat& framed = regions_({strength.width(), strength.height()}, absorption_.open(), classify,
                               [](std::size_t, int strong) { return strong >= kSeeds; });
    thinFramed(framed);
    SkeletonGraph graph = traceSkeleton(framed, scales_->radiusMat());
    clean(graph, grid.scale);
    std::optional<ExpectedLines> known;
    if (expected) known.emplace(*expected, grid).addTo(graph);
    std::vector<CentreLine> lines = (*fitting_)(graph, *scales_);
    dropAlongBorder(lines, absorption_.open());
    const float side = static_cast<float>(std::min(grid.size.width, grid.size.height));
    if (known) known->markIn(lines);
    tellWires(lines);
    compareFlanks(lines, scales_->imageUpTo(kFlankBlur));
    if (observe_) observe_(lines, grid);
    // Clutter is no catheter's branch, and no measure of what vessels absorb; nor is it part of a tree.
    const float least_density = static_cast<float>(settings_.relative_density);
    dropUnlikely(lines, side, least_density);
    tellCatheters(lines, absorption_.open(), kMinDevice * side);
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

  // Ridge strength of the image's strong vessels, 0 where there is none.
  float strongVessels() {
    sample_.clear();
    for (int y = 0; y < scales_->strength().height(); y += 4) {
      addSalient(scales_->pixelsOf(y), static_cast<float>(settings_.line_factor), sample_);
    }
    return sample_.empty() ? 0 : quantileOf(sample_, kStrongPart);
  }

  void clean(SkeletonGraph& graph, float scale) {
    const cv::Mat radius = scales_->radiusMat();
    settleRadii(graph, radius);
    closeGaps(graph, radius, static_cast<float>(settings_.max_gap_px) / scale, owners_);
    prune(graph, radius, {static_cast<float>(settings_.min_branch_px) / scale});
    // Tips are clean only now: what forked off there pointed elsewhere.
    closeGaps(graph, radius, static_cast<float>(settings_.max_gap_px) / scale, owners_);
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
  AbsorptionRows absorption_;
  LineOwners owners_;
  std::vector<float> sample_;
};

}  // namespace

std::unique_ptr<CenterlineExtractor> make(const RidgeSettings& settings, LineObserver observe) {
  return std::make_unique<RidgeExtractor>(settings, std::move(observe));
}

}  // namespace angio::imaging
