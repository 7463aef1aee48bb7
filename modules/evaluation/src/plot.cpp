// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/plot.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace angio {
namespace {

constexpr int kLeft = 74, kRight = 190, kTop = 34, kBottom = 44;
const cv::Scalar kInk(40, 40, 40), kGrid(228, 228, 228);

struct Axis {
  double low, high;
  Panel::Scale scale;

  double share(double value) const {
    if (scale == Panel::Scale::kLinear) return (value - low) / (high - low);
    return (std::log10(value) - std::log10(low)) / (std::log10(high) - std::log10(low));
  }
  bool shows(double value) const { return std::isfinite(value) && (scale == Panel::Scale::kLinear || value > 0); }
};

// 1, 2 or 5 times a power of ten, so that about `count` steps cover the range.
double niceStep(double range, int count) {
  const double raw = range / count, power = std::pow(10, std::floor(std::log10(raw))), lead = raw / power;
  return power * (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10);
}

std::vector<double> ticks(const Axis& axis, int count) {
  std::vector<double> result;
  if (axis.scale == Panel::Scale::kLog) {
    for (double t = axis.low; t <= axis.high * 1.0001; t *= 10) result.push_back(t);
    return result;
  }
  const double step = niceStep(axis.high - axis.low, count);
  for (double t = std::ceil(axis.low / step - 1e-9) * step; t <= axis.high + 1e-9 * step; t += step) {
    result.push_back(std::abs(t) < 1e-9 * step ? 0 : t);
  }
  return result;
}

Axis axisOf(const Panel& panel, bool vertical) {
  const auto scale = vertical ? panel.y_scale : Panel::Scale::kLinear;
  double low = std::numeric_limits<double>::max(), high = std::numeric_limits<double>::lowest();
  for (const auto& s : panel.series) {
    for (const double value : vertical ? s.y : s.x) {
      if (!Axis{0, 1, scale}.shows(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  if (low > high) low = scale == Panel::Scale::kLog ? 0.1 : 0, high = 1;
  if (scale == Panel::Scale::kLog) {
    low = std::pow(10, std::max(-300.0, std::floor(std::log10(low))));  // Never zero, which no factor of ten leaves.
    high = std::max(low * 10, std::pow(10, std::ceil(std::log10(high))));
  } else if (vertical) {
    const double flat = high == 0 ? 1 : 0.1 * std::abs(high);  // What stands still is not looked at under a lens.
    const double margin = high > low ? std::max(0.05 * (high - low), 1e-9 + 1e-3 * std::abs(high)) : flat;
    low -= margin, high += margin;
  } else if (!(high > low)) {
    high = low + 1;
  }
  return {low, high, scale};
}

std::string label(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

void write(cv::Mat& canvas, const std::string& text, cv::Point at, double size, const cv::Scalar& colour) {
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, size, colour, 1, cv::LINE_AA);
}

int textWidth(const std::string& text, double size) {
  return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size, 1, nullptr).width;
}

void drawPanel(cv::Mat canvas, const Panel& panel) {
  const cv::Rect area(kLeft, kTop, canvas.cols - kLeft - kRight, canvas.rows - kTop - kBottom);
  const Axis x = axisOf(panel, false), y = axisOf(panel, true);
  const auto at = [&](double vx, double vy) {
    return cv::Point2d(area.x + x.share(vx) * area.width, area.y + (1 - y.share(vy)) * area.height);
  };
  for (const double t : ticks(y, 5)) {
    const cv::Point p(at(x.low, t));
    cv::line(canvas, p, {area.x + area.width, p.y}, kGrid, 1);
    write(canvas, label(t), {area.x - 8 - textWidth(label(t), 0.4), p.y + 4}, 0.4, kInk);
  }
  for (const double t : ticks(x, 10)) {
    const cv::Point p(at(t, y.low));
    cv::line(canvas, p, {p.x, area.y}, kGrid, 1);
    write(canvas, label(t), {p.x - textWidth(label(t), 0.4) / 2, area.y + area.height + 16}, 0.4, kInk);
  }
  cv::rectangle(canvas, area, kInk, 1);
  write(canvas, panel.title, {area.x, area.y - 12}, 0.5, kInk);
  write(canvas, panel.y_label, {8, area.y - 12}, 0.4, kInk);
  write(canvas, panel.x_label, {area.x + (area.width - textWidth(panel.x_label, 0.42)) / 2, canvas.rows - 8}, 0.42,
        kInk);

  int line = area.y + 14;
  for (const auto& s : panel.series) {
    std::optional<cv::Point> last;
    for (std::size_t i = 0; i < std::min(s.x.size(), s.y.size()); ++i) {
      if (!x.shows(s.x[i]) || !y.shows(s.y[i])) {
        last.reset();
        continue;
      }
      const cv::Point2d p = at(s.x[i], s.y[i]) * 16;
      const cv::Point now(static_cast<int>(std::lround(p.x)), static_cast<int>(std::lround(p.y)));
      if (last) cv::line(canvas, *last, now, s.colour_bgr, 2, cv::LINE_AA, 4);
      last = now;
    }
    cv::line(canvas, {area.x + area.width + 12, line - 4}, {area.x + area.width + 32, line - 4}, s.colour_bgr, 2,
             cv::LINE_AA);
    write(canvas, s.name, {area.x + area.width + 38, line}, 0.4, kInk);
    line += 20;
  }
}

}  // namespace

cv::Scalar plotColour(int index) {
  static const cv::Scalar kColours[] = {{178, 114, 0},   {0, 94, 213},  {115, 158, 0},
                                        {167, 121, 204}, {0, 159, 230}, {233, 180, 86}};
  return kColours[static_cast<std::size_t>(index) % (sizeof kColours / sizeof *kColours)];
}

cv::Mat drawPlot(const std::vector<Panel>& panels, int width_px, int panel_height_px) {
  cv::Mat canvas(panel_height_px * static_cast<int>(panels.size()), width_px, CV_8UC3, cv::Scalar(255, 255, 255));
  for (std::size_t i = 0; i < panels.size(); ++i) {
    drawPanel(canvas.rowRange(static_cast<int>(i) * panel_height_px, static_cast<int>(i + 1) * panel_height_px),
              panels[i]);
  }
  return canvas;
}

}  // namespace angio
