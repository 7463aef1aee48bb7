// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "angio/plotting/namespace.hpp"

namespace angio::plotting {

/// One series of a plot. Values that cannot be shown (not finite, not positive on a log axis) leave a gap.
struct PlotSeries {
  enum class Kind { kLine, kSteps, kDots, kBars };

  std::string name;  ///< In the legend; empty: not there.
  std::vector<double> x, y;
  int color = 0;                            ///< Number of a plotColour.
  Kind kind = Kind::kLine;                  ///< Bars are 0.72 wide and stand on zero.
  std::vector<double> low = {}, high = {};  ///< Bounds of y as a band, as many as y, or empty.
  bool dashed = false;                      ///< A fine broken line without marks.
  std::vector<bool> hollow = {};            ///< Which of the dots are rings; empty for none.
  std::vector<double> radii_px = {};        ///< Of the dots; empty: all of one size.
  bool marked = true;                       ///< Whether a line of few points has marks on them.
};

/// A line across the plot that says something.
struct PlotGuide {
  double at = 0;
  std::string label;
  bool upright = false;  ///< At an x instead of a y.
};

/// Words at a place, shifted by so many pixels to the right and down.
struct PlotText {
  double x = 0, y = 0;
  std::string words;
  int color = 0;
  cv::Point shift_px = {8, 4};
};

/// Words beside one of several places, of the series' colour: where they cover neither another label nor a line if
/// there is such room, with a thin line to the place if that is far.
struct PlotLabel {
  std::vector<std::pair<double, double>> places;  ///< x and y, the best first; one at least.
  std::string words;
  int color = 0;
};

/// Words at the middle of each side of the frame, inside it.
struct PlotSides {
  std::string left, right, top, bottom;
};

/// An axis: what it says and what it covers.
struct PlotAxis {
  std::string label;
  bool log = false;
  std::optional<std::pair<double, double>> range = {};  ///< Absent: what the series need.
  /// Absent: round numbers. Words that have no room are left out.
  std::optional<std::vector<std::pair<double, std::string>>> ticks = {};
};

/// One pair of axes.
struct Plot {
  std::string title;
  PlotAxis x, y;
  std::vector<PlotSeries> series = {};
  std::vector<PlotGuide> guides = {};
  std::vector<PlotText> texts = {};
  std::vector<PlotLabel> labels = {};
  PlotSides sides = {};
  std::vector<std::pair<double, double>> counts = {};  ///< x and height, of any unit: drawn faintly along the x axis.
  bool equal_scale = false;  ///< As many pixels to a unit along both axes, about the middle of them.
  cv::Mat ground = {};       ///< CV_8UC3, fills the axes behind everything; not in an SVG.
  bool bare = false;         ///< Without ticks and rules: a drawing.
};

/// Series colours after Okabe and Ito, which most colour-blind readers tell apart: 0 to 5, which count round; text's
/// and a warning's.
constexpr int kPlotColors = 6, kInkColor = -1, kWarningColor = -2;
cv::Scalar plotColor(int index);  ///< BGR.

/// The plot as an `<svg>` element without colours of its own: it has the classes `c0` to `c5`, `line`, `rule`, `guide`,
/// `count`, `band` and so on, and the page around it says how they look, light or dark. Without title and legend.
std::string svgPlot(const Plot& plot, int width_px = 560, int height_px = 320);

/// How the classes of svgPlot look, as CSS rules in the variables --paper, --ink, --soft, --rule, --guide, --bar and
/// --c0 to --c5.
std::string svgPlotStyle();

/// Plots side by side, each `width_px` x `height_px`, as an SVG file of its own: with titles, on white, in the colours
/// of drawPlots.
std::string svgPlotFile(const std::vector<Plot>& plots, int width_px, int height_px);

/// Draws plots below each other, each `width_px` x `height_px` and with as wide a frame, CV_8UC3 on white.
cv::Mat drawPlots(const std::vector<Plot>& plots, int width_px = 900, int height_px = 260);

/// The largest of 1, 2 and 5 times a power of ten that is not above a positive value.
double roundedDown(double value);

/// Text as it may stand in HTML and SVG.
std::string htmlEscaped(const std::string& text);

}  // namespace angio::plotting
