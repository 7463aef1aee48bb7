// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace angio {

/// One series of an SVG plot.
struct SvgSeries {
  enum class Kind { kLine, kSteps, kDots };

  std::string name;
  std::vector<double> x, y;       ///< As many; what cannot be shown (not finite, not positive on a log axis) is a gap.
  std::vector<double> low, high;  ///< Bounds of y as a band, as many as y, or empty.
  Kind kind = Kind::kLine;
  int colour = 0;                 ///< Number of a colour of the page; counts round after kSvgColours.
  bool dashed = false;            ///< A fine broken line without marks.
  std::vector<bool> hollow = {};  ///< Dots only: which of them are rings; empty for none.
};
constexpr int kSvgColours = 6;

/// A line across the plot that says something.
struct SvgGuide {
  double at = 0;
  std::string label;
  bool upright = false;  ///< At an x instead of a y.
};

/// One pair of axes.
struct SvgPlot {
  std::string x_label, y_label;
  bool log_x = false, log_y = false;
  std::optional<std::pair<double, double>> x_range, y_range;  ///< Absent: what the series need.
  std::vector<std::pair<double, std::string>> x_ticks;        ///< Empty: chosen.
  std::vector<SvgSeries> series;
  std::vector<SvgGuide> guides;
  std::vector<std::pair<double, double>> bars;  ///< x and height, of any unit: drawn faintly along the x axis.
};

/// The plot as an <svg> element without colours of its own: it has the classes `c0` to `c5`, `line`, `rule`, `guide`,
/// `bar`, `band` and so on, and the page around it says how they look, light or dark.
std::string svgPlot(const SvgPlot& plot, int width = 560, int height = 320);

/// Text as it may stand in HTML and SVG.
std::string htmlEscaped(const std::string& text);

}  // namespace angio
