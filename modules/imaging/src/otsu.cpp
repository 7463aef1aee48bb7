// SPDX-License-Identifier: GPL-2.0-or-later
#include "otsu.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/base/errors.hpp"
#include "angio/imaging/thinning.hpp"
#include "centre_lines.hpp"
#include "flatten.hpp"
#include "segment.hpp"
#include "skeleton_graph.hpp"

namespace angio {
namespace {

void requireXray(const cv::Mat& image) {
  if (image.empty()) throw InputError("image", "size", "0 x 0", "must have pixels");
  if (image.type() == CV_8UC1 || image.type() == CV_16UC1) return;
  throw InputError("image", "type", cv::typeToString(image.type()), "must be CV_8UC1 or CV_16UC1");
}

// Lines in working pixels -> points of the image at equal distances, with the tangents of the lines.
Centerline2d sampled(const std::vector<CentreLine>& lines, const WorkingGrid& grid, double spacing_px) {
  const float scale = static_cast<float>(grid.scale);
  std::vector<std::vector<float>> places;
  Eigen::Index count = 0;
  for (const CentreLine& centre : lines) {
    places.push_back(equalSteps(centre.line, static_cast<float>(spacing_px) / scale));
    count += static_cast<Eigen::Index>(places.back().size());
  }
  Centerline2d result;
  result.points_px.resize(2, count);
  result.tangent_rad.resize(count);
  result.radius_px.resize(count);
  result.branch.reserve(static_cast<std::size_t>(count));
  Eigen::Index point = 0;
  for (std::size_t b = 0; b < lines.size(); ++b) {
    for (const float place : places[b]) {
      const CentreLine& centre = lines[b];
      const std::size_t i = std::min(static_cast<std::size_t>(place + 0.5f), centre.line.size() - 1);
      const cv::Point2f p = grid.toImage(at(centre.line, place)), along = directionAt(centre.line, i, 2);
      result.points_px.col(point) << p.x, p.y;
      result.tangent_rad[point] = undirected(std::atan2(along.y, along.x));
      result.radius_px[point] = scale * centre.radius[i];
      result.branch.push_back(static_cast<int>(b));
      ++point;
    }
  }
  return result;
}

class OtsuExtractor final : public CenterlineExtractor {
 public:
  explicit OtsuExtractor(const OtsuSettings& settings)
      : settings_(settings), flattening_(settings), segmentation_(settings) {}

  Centerline2d extract(const cv::Mat& image) override {
    requireXray(image);
    const WorkingGrid grid(image.size(), settings_.border_px);
    const Flattened flat = flattening_(image, grid);
    const cv::Mat* mask = segmentation_(flat, grid.scale);
    if (mask == nullptr) return {};

    // A vessel cut off by the image's edge goes on beyond it; its skeleton then reaches the edge, and has no fork
    // there.
    const float scale = static_cast<float>(grid.scale), widest = static_cast<float>(settings_.background_px) / 2;
    const int margin = static_cast<int>(std::ceil(widest / scale)) + 2;
    cv::copyMakeBorder(*mask, skeleton_, margin, margin, margin, margin, cv::BORDER_REPLICATE);
    cv::distanceTransform(skeleton_, distance_, cv::DIST_L2, cv::DIST_MASK_3);
    thin(skeleton_);
    SkeletonGraph graph = traceSkeleton(skeleton_, distance_);
    prune(graph, distance_, {static_cast<float>(settings_.shortest_branch_px) / scale});
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

}  // namespace angio
