// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

namespace angio {

/// One line of a plot.
struct Series {
  std::string name;
  std::vector<double> x, y;  ///< As many; values that are not finite, or not positive on a log axis, leave a gap.
  cv::Scalar colour_bgr;
};

/// One pair of axes.
struct Panel {
  enum class Scale { kLinear, kLog };
  std::string title, x_label, y_label;
  Scale y_scale = Scale::kLinear;
  std::vector<Series> series;
};

/// Colours that stay apart, also for most colour-blind readers (Okabe and Ito), BGR; counts round.
cv::Scalar plotColour(int index);

/// Draws panels below each other, each `width_px` x `panel_height_px`, CV_8UC3 on white.
cv::Mat drawPlot(const std::vector<Panel>& panels, int width_px = 900, int panel_height_px = 260);

}  // namespace angio
