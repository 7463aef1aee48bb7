// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "centre_lines.hpp"
#include "flatten.hpp"
#include "framed_masks.hpp"
#include "hysteresis.hpp"
#include "make_extractors.hpp"
#include "skeleton_graph.hpp"
#include "xray_image.hpp"

namespace angio::imaging {
namespace {

// Half of 1024: a vessel of 1 mm is then still three pixels wide, and its centre line is found from its grey values.
constexpr int kWorkingSide = 512;

// The histogram of absorption: a bin is a tenth of the faintest vessel, the range covers centimetres of contrast agent.
constexpr float kBin = 0.002f;
constexpr int kBins = 2000;

// A pixel that hangs together with a vessel may be this much closer to the noise than the vessel's strongest.
constexpr float kWeakNoise = 0.7f;

float centerOf(int bin) { return kBin * (static_cast<float>(bin) + 0.5f); }

// Otsu's threshold: the split of the histogram with the largest variance between its two classes.
float otsuThreshold(const std::vector<int>& histogram) {
  double count = 0, sum = 0;
  for (int b = 0; b < kBins; ++b) {
    count += histogram[b];
    sum += static_cast<double>(histogram[b]) * centerOf(b);
  }
  double best = -1, low_count = 0, low_sum = 0;
  int split = 0;
  for (int b = 0; b + 1 < kBins; ++b) {
    low_count += histogram[b];
    low_sum += static_cast<double>(histogram[b]) * centerOf(b);
    const double high_count = count - low_count;
    if (low_count == 0) continue;
    if (high_count == 0) break;
    const double gap = low_sum / low_count - (sum - low_sum) / high_count;
    const double variance = low_count * high_count * gap * gap;
    if (variance > best) {
      best = variance;
      split = b;
    }
  }
  return kBin * static_cast<float>(split + 1);
}

// Vessel mask from flattened absorption: Otsu's threshold, hysteresis, small regions dropped, small holes closed.
class Segmentation {
 public:
  explicit Segmentation(const OtsuSettings& settings) : settings_(settings) {}

  // CV_8UC1, 255 in vessels; nothing when no pixel stands out from the background. `scale` is image pixels per
  // working pixel, and `open` what the collimator leaves of each row. Valid until the next call.
  const cv::Mat* operator()(const Flattened& image, float scale, const std::vector<RowRange>& open) {
    const bool plain = settings_.cut == OtsuCut::kPlain;
    if (!count(image, open)) return nullptr;
    const float otsu = otsuThreshold(histogram_);
    const auto weakest =
        plain ? otsu : static_cast<float>(std::max(settings_.branch_contrast * otsu, settings_.faintest_absorption));
    const float strong_factor = plain ? 0 : static_cast<float>(settings_.noise_factor),
                weak_factor = kWeakNoise * strong_factor;
    const auto classify = [&](int y, const RowRange& part, std::uint8_t* to) {
      const float *value = image.absorption.ptr<float>(y), *noise = image.noise.ptr<float>(y);
      for (int x = part.begin; x < part.end; ++x) {
        to[x] = (value[x] > std::max(weakest, weak_factor * noise[x]) ? 1 : 0) +
                (value[x] > std::max(weakest, strong_factor * noise[x]) ? 1 : 0);
      }
    };
    const double area = settings_.min_area_px / (scale * scale);
    const auto smallest = static_cast<std::size_t>(std::ceil(area));
    const cv::Size size = image.absorption.size();
    const cv::Mat& framed = regions_(size, open, classify, [&](std::size_t pixels, int) { return pixels >= smallest; });
    mask_ = framed(cv::Rect(1, 1, size.width, size.height));
    closeHoles(static_cast<int>(area));
    return &mask_;
  }

 private:
  // Vessels cover a few per cent of the image, and Otsu's threshold of all pixels then splits the background's noise.
  // So it is taken of the pixels that stand out from that noise; the plain cut is of all pixels that absorb. False when
  // there are none.
  bool count(const Flattened& image, const std::vector<RowRange>& open) {
    histogram_.assign(kBins, 0);
    const bool plain = settings_.cut == OtsuCut::kPlain;
    const float factor = plain ? 0 : static_cast<float>(settings_.noise_factor);
    const float faintest = plain ? 0 : static_cast<float>(settings_.faintest_absorption);
    int counted = 0;
    for (int y = 0; y < image.absorption.rows; ++y) {
      const float *value = image.absorption.ptr<float>(y), *noise = image.noise.ptr<float>(y);
      for (int x = open[y].begin; x < open[y].end; ++x) {
        if (value[x] <= faintest || value[x] <= factor * noise[x]) continue;
        ++histogram_[std::min(static_cast<int>(value[x] / kBin), kBins - 1)];
        ++counted;
      }
    }
    return counted > 0;
  }

  void closeHoles(int max_area) {
    cv::bitwise_not(mask_, outside_);
    const int count = cv::connectedComponentsWithStats(outside_, labels_, stats_, centroids_, 4, CV_32S);
    for (int label = 1; label < count; ++label) {
      if (stats_.at<int>(label, cv::CC_STAT_AREA) > max_area) continue;
      const cv::Rect box(stats_.at<int>(label, cv::CC_STAT_LEFT), stats_.at<int>(label, cv::CC_STAT_TOP),
                         stats_.at<int>(label, cv::CC_STAT_WIDTH), stats_.at<int>(label, cv::CC_STAT_HEIGHT));
      mask_(box).setTo(255, labels_(box) == label);
    }
  }

  OtsuSettings settings_;
  std::vector<int> histogram_;
  Hysteresis regions_;
  cv::Mat mask_, outside_, labels_, stats_, centroids_;
};

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
    cv::copyMakeBorder(skeleton_, framed_, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
    thinFramed(framed_);
    SkeletonGraph graph = traceSkeleton(framed_, distance_);
    prune(graph, distance_, {static_cast<float>(settings_.min_branch_px) / scale});
    const float blur = static_cast<float>(settings_.smoothing_px) / scale;
    return sampled(centreLines(graph, {flat.absorption, flat.background, distance_, margin}, blur), grid,
                   settings_.spacing_px);
  }

 private:
  OtsuSettings settings_;
  Flattening flattening_;
  Segmentation segmentation_;
  cv::Mat skeleton_, framed_, distance_;
};

}  // namespace

std::unique_ptr<CenterlineExtractor> make(const OtsuSettings& settings) {
  return std::make_unique<OtsuExtractor>(settings);
}

}  // namespace angio::imaging
