// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/imaging/thinning.hpp"
#include "centre_lines.hpp"
#include "flatten.hpp"
#include "make_extractors.hpp"
#include "segment.hpp"
#include "skeleton_graph.hpp"
#include "xray_image.hpp"

namespace angio::imaging {
namespace {

// Half of 1024: a vessel of 1 mm is then still three pixels wide, and its centre line is found from its grey values.
constexpr int kWorkingSide = 512;

class OtsuExtractor final : public CenterlineExtractor {
 public:
  explicit OtsuExtractor(const OtsuSettings& settings)
      : settings_(settings), flattening_(settings), segmentation_(settings) {}

  Centerline2d extract(const cv::Mat& image) override {
    requireXray(image);
    const WorkingGrid grid(image.size(), settings_.border_px, kWorkingSide);
    const Flattened flat = flattening_(image, grid);
    const float border = static_cast<float>(settings_.border_px) / grid.scale;
    const cv::Mat* mask = segmentation_(flat, grid.scale, openRows(image, grid, border));
    if (mask == nullptr) return {};

    // A vessel cut off by the image's edge goes on beyond it; its skeleton then reaches the edge, and has no fork
    // there.
    const float scale = grid.scale, widest = static_cast<float>(settings_.background_px) / 2;
    const int margin = static_cast<int>(std::ceil(widest / scale)) + 2;
    cv::copyMakeBorder(*mask, skeleton_, margin, margin, margin, margin, cv::BORDER_REPLICATE | cv::BORDER_ISOLATED);
    cv::distanceTransform(skeleton_, distance_, cv::DIST_L2, cv::DIST_MASK_3);
    thin(skeleton_);
    SkeletonGraph graph = traceSkeleton(skeleton_, distance_);
    prune(graph, distance_, {static_cast<float>(settings_.min_branch_px) / scale});
    const float blur = static_cast<float>(settings_.smoothing_px) / scale;
    return sampled(centreLines(graph, {flat.absorption, flat.background, distance_, margin}, blur), grid,
                   settings_.spacing_px);
  }

 private:
  OtsuSettings settings_;
  Flattening flattening_;
  Segmentation segmentation_;
  cv::Mat skeleton_, distance_;
};

}  // namespace

std::unique_ptr<CenterlineExtractor> make(const OtsuSettings& settings) {
  return std::make_unique<OtsuExtractor>(settings);
}

}  // namespace angio::imaging
