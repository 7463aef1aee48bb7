// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/imaging/extractor_settings.hpp"
#include "flatten.hpp"
#include "hysteresis.hpp"

namespace angio::imaging {

/// Vessel mask from flattened absorption: Otsu's threshold, hysteresis, small regions dropped, small holes closed.
class Segmentation {
 public:
  explicit Segmentation(const OtsuSettings& settings) : settings_(settings) {}

  /// CV_8UC1, 255 in vessels; nothing when no pixel stands out from the background. `scale` is image pixels per
  /// working pixel, and `open` what the collimator leaves of each row. Valid until the next call.
  const cv::Mat* operator()(const Flattened& image, float scale, const std::vector<RowRange>& open);

 private:
  bool count(const Flattened& image, const std::vector<RowRange>& open);
  void closeHoles(int max_area);

  OtsuSettings settings_;
  std::vector<int> histogram_;
  Hysteresis regions_;
  cv::Mat mask_, outside_, labels_, stats_, centroids_;
};

}  // namespace angio::imaging
