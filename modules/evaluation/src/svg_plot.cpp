// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/svg_plot.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <tuple>

namespace angio {
namespace {

struct Area {
  double left, top, right, bottom;
};

// One axis: values to positions along it.
struct Axis {
  double low = 0, high = 1;
  bool log = false;
  double begin = 0, end = 1;  // Positions of low and high.

  // What lies beyond thirty decades is a mistake, and would leave no room for the rest.
  bool shows(double value) const { return std::abs(value) < 1e30 && (!log || value > 1e-30); }
  double at(double value) const {
    const auto scaled = [&](double v) { return log ? std::log10(v) : v; };
    const double share = (scaled(value) - scaled(low)) / (scaled(high) - scaled(low));
    return begin + std::clamp(share, -0.02, 1.02) * (end - begin);
  }
};

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", std::abs(value) < 1e-12 ? 0.0 : value);
  return text;
}

std::string place(double pixels) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", pixels);
  return text;
}

void reach(Axis& axis, const std::vector<double>& values, bool& begun) {
  for (const double v : values) {
    if (!axis.shows(v)) continue;
    axis.low = begun ? std::min(axis.low, v) : v;
    axis.high = begun ? std::max(axis.high, v) : v;
    begun = true;
  }
}

Axis axisOf(const SvgPlot& plot, bool upright) {
  Axis axis;
  axis.log = upright ? plot.log_y : plot.log_x;
  const auto& range = upright ? plot.y_range : plot.x_range;
  bool begun = false;
  for (const auto& s : plot.series) {
    reach(axis, upright ? s.y : s.x, begun);
    if (upright) reach(axis, s.low, begun), reach(axis, s.high, begun);
  }
  for (const auto& g : plot.guides) {
    if (g.upright == !upright) reach(axis, {g.at}, begun);
  }
  if (!begun) axis.low = axis.log ? 0.1 : 0, axis.high = 1;
  if (range) std::tie(axis.low, axis.high) = *range;
  if (axis.log) {  // Whole decades would waste room: one, two and five are round enough.
    const auto round_down = [](double v) {
      const double decade = std::pow(10, std::floor(std::log10(v)));
      return v >= 5 * decade ? 5 * decade : v >= 2 * decade ? 2 * decade : decade;
    };
    if (!range) axis.low = round_down(axis.low), axis.high = std::max(2.5 * round_down(axis.high), 10 * axis.low);
  } else if (!(axis.high - axis.low > 1e-12 * std::max(std::abs(axis.high), 1e-12))) {
    axis.high = axis.low + std::max(1.0, std::abs(axis.low));
  }
  return axis;
}

std::vector<double> ticksOf(const Axis& axis, int about) {
  std::vector<double> ticks;
  if (axis.log) {
    const bool wide = axis.high > 200 * axis.low;
    const int first = static_cast<int>(std::floor(std::log10(axis.low)));
    const int last = static_cast<int>(std::ceil(std::log10(axis.high)));
    for (int e = first; e <= last; e += 1 + (last - first) / 10) {
      for (const int digit : {1, 2, 5}) {
        const double v = digit * std::pow(10, e);
        if ((digit == 1 || !wide) && v >= axis.low * 0.999 && v <= axis.high * 1.001) ticks.push_back(v);
      }
    }
    return ticks;
  }
  const double raw = (axis.high - axis.low) / about, decade = std::pow(10, std::floor(std::log10(raw)));
  const double step = decade * (raw / decade < 1.5 ? 1 : raw / decade < 3.5 ? 2 : raw / decade < 7.5 ? 5 : 10);
  const double first = std::ceil(axis.low / step - 1e-9);
  for (int k = 0; k <= 2 * about + 1 && (first + k) * step <= axis.high + 1e-9 * step; ++k) {
    ticks.push_back((first + k) * step);
  }
  return ticks;
}

std::string text(double x, double y, const std::string& anchor, const std::string& words, const char* kind = "axis") {
  return "<text class=\"" + std::string(kind) + "\" x=\"" + place(x) + "\" y=\"" + place(y) + "\" text-anchor=\"" +
         anchor + "\">" + htmlEscaped(words) + "</text>\n";
}

std::string line(const char* kind, double x1, double y1, double x2, double y2) {
  return "<line class=\"" + std::string(kind) + "\" x1=\"" + place(x1) + "\" y1=\"" + place(y1) + "\" x2=\"" +
         place(x2) + "\" y2=\"" + place(y2) + "\"/>\n";
}

std::string frame(const SvgPlot& plot, const Axis& x, const Axis& y, const Area& area) {
  std::string svg;
  for (const double t : ticksOf(y, 5)) {
    svg += line("rule", area.left, y.at(t), area.right, y.at(t));
    svg += text(area.left - 8, y.at(t) + 4, "end", number(t));
  }
  auto ticks = plot.x_ticks;
  if (ticks.empty()) {
    for (const double t : ticksOf(x, 8)) ticks.emplace_back(t, number(t));
  }
  for (const auto& [at, words] : ticks) {
    if (x.log) svg += line("rule", x.at(at), area.top, x.at(at), area.bottom);
    svg += line("tick", x.at(at), area.bottom, x.at(at), area.bottom + 4);
    svg += text(x.at(at), area.bottom + 18, "middle", words);
  }
  svg += line("tick", area.left, area.bottom, area.right, area.bottom);
  svg += text((area.left + area.right) / 2, area.bottom + 38, "middle", plot.x_label, "label");
  svg += text(area.left - 44, area.top - 12, "start", plot.y_label, "label");
  return svg;
}

std::string barsOf(const SvgPlot& plot, const Axis& x, const Area& area) {
  double highest = 0, nearest = x.high - x.low;
  for (std::size_t i = 0; i < plot.bars.size(); ++i) {
    highest = std::max(highest, plot.bars[i].second);
    if (i > 0) nearest = std::min(nearest, plot.bars[i].first - plot.bars[i - 1].first);
  }
  std::string svg;
  for (const auto& [at, height] : plot.bars) {
    if (!(height > 0)) continue;
    const double left = std::max(area.left, x.at(at - 0.5 * nearest) + 1), right = x.at(at + 0.5 * nearest) - 1;
    const double tall = 0.22 * (area.bottom - area.top) * height / highest;
    svg += "<rect class=\"bar\" x=\"" + place(left) + "\" y=\"" + place(area.bottom - tall) + "\" width=\"" +
           place(std::max(1.0, right - left)) + "\" height=\"" + place(tall) + "\"><title>" + number(height) +
           "</title></rect>\n";
  }
  return svg;
}

std::string bandOf(const SvgSeries& s, const Axis& x, const Axis& y, const std::string& colour) {
  if (s.low.size() != s.x.size() || s.high.size() != s.x.size() || s.x.size() < 2) return "";
  std::string points;
  for (std::size_t i = 0; i < s.x.size(); ++i) points += place(x.at(s.x[i])) + "," + place(y.at(s.high[i])) + " ";
  for (std::size_t i = s.x.size(); i-- > 0;) points += place(x.at(s.x[i])) + "," + place(y.at(s.low[i])) + " ";
  return "<polygon class=\"band " + colour + "\" points=\"" + points + "\"/>\n";
}

std::string dotsOf(const SvgSeries& s, const Axis& x, const Axis& y, const std::string& colour, double radius) {
  std::string svg;
  for (std::size_t i = 0; i < std::min(s.x.size(), s.y.size()); ++i) {
    if (!x.shows(s.x[i]) || !y.shows(s.y[i])) continue;
    const bool ring = i < s.hollow.size() && s.hollow[i];
    svg += "<circle class=\"" + std::string(ring ? "ring " : "dot ") + colour + "\" cx=\"" + place(x.at(s.x[i])) +
           "\" cy=\"" + place(y.at(s.y[i])) + "\" r=\"" + place(radius) + "\"/>\n";
  }
  return svg;
}

std::string lineOf(const SvgSeries& s, const Axis& x, const Axis& y, const std::string& colour) {
  std::string path;
  bool joined = false;
  std::string last_y;
  for (std::size_t i = 0; i < std::min(s.x.size(), s.y.size()); ++i) {
    if (!x.shows(s.x[i]) || !y.shows(s.y[i])) {
      joined = false;
      continue;
    }
    const std::string px = place(x.at(s.x[i])), py = place(y.at(s.y[i]));
    if (joined && s.kind == SvgSeries::Kind::kSteps) path += " L" + px + " " + last_y;
    path += (joined ? " L" : " M") + px + " " + py;
    last_y = py;
    joined = true;
  }
  if (path.empty()) return "";
  return "<path class=\"" + std::string(s.dashed ? "dashed " : "line ") + colour + "\" d=\"" + path.substr(1) +
         "\"/>\n";
}

}  // namespace

std::string htmlEscaped(const std::string& plain) {
  std::string escaped;
  for (const char c : plain) {
    if (c == '&')
      escaped += "&amp;";
    else if (c == '<')
      escaped += "&lt;";
    else if (c == '>')
      escaped += "&gt;";
    else if (c == '"')
      escaped += "&quot;";
    else
      escaped += c;
  }
  return escaped;
}

std::string svgPlot(const SvgPlot& plot, int width, int height) {
  const Area area{56, 34, width - 16.0, height - 50.0};
  Axis x = axisOf(plot, false), y = axisOf(plot, true);
  x.begin = area.left, x.end = area.right;
  y.begin = area.bottom, y.end = area.top;
  std::string svg = "<svg viewBox=\"0 0 " + std::to_string(width) + " " + std::to_string(height) +
                    "\" role=\"img\" aria-label=\"" + htmlEscaped(plot.y_label + " by " + plot.x_label) + "\">\n";
  svg += barsOf(plot, x, area) + frame(plot, x, y, area);
  for (const auto& g : plot.guides) {
    const double at = g.upright ? x.at(g.at) : y.at(g.at);
    svg += g.upright ? line("guide", at, area.top, at, area.bottom) : line("guide", area.left, at, area.right, at);
    svg += g.upright ? text(at + 5, area.top + 10, "start", g.label, "note")
                     : text(area.right, at + 13, "end", g.label, "note");
  }
  for (const auto& s : plot.series) svg += bandOf(s, x, y, "c" + std::to_string(s.colour % kSvgColours));
  for (const auto& s : plot.series) {
    const std::string colour = "c" + std::to_string(s.colour % kSvgColours);
    if (s.kind != SvgSeries::Kind::kDots) svg += lineOf(s, x, y, colour);
    if (s.kind == SvgSeries::Kind::kLine && !s.dashed) svg += dotsOf(s, x, y, colour, 3);
    if (s.kind == SvgSeries::Kind::kDots) svg += dotsOf(s, x, y, colour, 3.4);
  }
  return svg + "</svg>\n";
}

}  // namespace angio
