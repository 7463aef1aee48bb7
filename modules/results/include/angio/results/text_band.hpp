// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/results/namespace.hpp"

namespace angio::results {

/// Size of the letters in a band: what OpenCV's drawing functions take.
struct TextStyle {
  double size = 0.45;  ///< Scale of FONT_HERSHEY_SIMPLEX.
  int stroke_px = 1;

  int lineHeight_px() const;
  int margin_px() const;  ///< Between the band's edges and its text.
};

/// Letters for a picture of a width. They grow with the picture and stay readable in a small one.
TextStyle textStyle(int picture_width_px);

/// Width of a line of text, its rim included [px].
int textWidth_px(const std::string& text, const TextStyle& style);

/// Words of a text in lines of at most `width_px`. A word that is wider goes on in the next line. Runs of blanks count
/// as one. No lines for a text without words.
std::vector<std::string> wrapped(const std::string& text, int width_px, const TextStyle& style);

/// One entry of a band.
struct BandEntry {
  enum class Mark { kNone, kStroke };  ///< kStroke: a stroke of the colour before the text, as in a legend.

  std::string text;
  cv::Scalar color_bgr;
  Mark mark = Mark::kNone;
};

/// Height of a band of a width in which all lines of the entries stand below each other [px]; 0 without any.
int bandHeight_px(const std::vector<BandEntry>& entries, int width_px, const TextStyle& style);

/// Writes entries into a band (CV_8UC3) from its upper edge.
void writeBand(cv::Mat band, const std::vector<BandEntry>& entries, const TextStyle& style);

/// Returns a picture (CV_8UC3) with a band of entries below it; the picture itself without entries.
cv::Mat withBandBelow(const cv::Mat& picture, const std::vector<BandEntry>& entries);

}  // namespace angio::results
