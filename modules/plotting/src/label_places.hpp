// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/types.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "angio/plotting/namespace.hpp"
#include "plot_canvas.hpp"

namespace angio::plotting {

/// Words that are to stand beside one of several places [px].
struct WantedLabel {
  std::vector<cv::Point2d> places;  ///< The best first; one at least.
  cv::Size2d size;                  ///< Of the words with what is to stay free around them.
};

/// Where words came to stand [px].
struct PlacedLabel {
  cv::Rect2d box;
  std::optional<std::pair<cv::Point2d, cv::Point2d>> leader;  ///< From the place to the box; absent where it is near.
};

/// Places labels one after another within a frame: beside one of their places, over no label that stands already and
/// over as little of the lines as can be, near rather than far. Where there is no room labels overlap.
std::vector<PlacedLabel> placeLabels(const std::vector<WantedLabel>& labels,
                                     const std::vector<PlotCanvas::Points>& lines, const cv::Rect2d& frame);

}  // namespace angio::plotting
