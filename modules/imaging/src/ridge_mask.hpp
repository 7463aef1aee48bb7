// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "field_outline.hpp"
#include "plane.hpp"

namespace angio::imaging {

/// Hysteresis over ridge pixels: a connected region stays if enough of it stands out.
class RidgeMask {
 public:
  /// CV_8UC1, 255 where `strength` is above `weakest` in the `open` part of each row and in a region that has at least
  /// `seeds` pixels whose salience is above `strong`. Valid until the next call.
  cv::Mat& operator()(const std::vector<RowRange>& open, const Plane& strength, const Plane& salience, float weakest,
                      float strong, int seeds);

 private:
  cv::Mat framed_, mask_, classes_;
  std::vector<int> region_;
};

}  // namespace angio::imaging
