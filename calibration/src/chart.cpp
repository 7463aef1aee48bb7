// SPDX-License-Identifier: GPL-2.0-or-later
#include "chart.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/base/formatted.hpp"

namespace angio {

const cv::Scalar kChartInk(50, 50, 50), kChartGood(178, 114, 0), kChartHeldOut(0, 159, 230), kChartLeftOut(40, 40, 214);

namespace {

constexpr int kLeft = 66, kRight = 22, kTop = 40, kBottom = 52, kShift = 4;
const cv::Scalar kGrid(230, 230, 230), kFrame(150, 150, 150);

// 1, 2 or 5 times a power of ten, so that about five steps cover the range.
double stepOf(double range) {
  const double raw = range / 5, power = std::pow(10, std::floor(std::log10(raw))), lead = raw / power;
  return power * (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10);
}

std::vector<double> ticksOf(const Chart::Axis& axis) {
  std::vector<double> ticks;
  const double step = stepOf(axis.high - axis.low);
  for (double t = std::ceil(axis.low / step - 1e-9) * step; t <= axis.high + 1e-9 * step; t += step) {
    ticks.push_back(std::abs(t) < 1e-9 * step ? 0 : t);
  }
  return ticks;
}

void write(cv::Mat& picture, const std::string& text, cv::Point at, const cv::Scalar& colour, double size) {
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, size, colour, 1, cv::LINE_AA);
}

int widthOf(const std::string& text, double size) {
  int baseline = 0;
  return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size, 1, &baseline).width;
}

// OpenCV writes from left to right only.
void writeUpwards(cv::Mat& picture, const std::string& text, cv::Point middle) {
  cv::Mat label(20, widthOf(text, 0.45) + 8, CV_8UC3, cv::Scalar::all(255));
  write(label, text, {4, 14}, kChartInk, 0.45);
  cv::rotate(label, label, cv::ROTATE_90_COUNTERCLOCKWISE);
  const cv::Rect place(cv::Point(middle.x - label.cols / 2, middle.y - label.rows / 2), label.size());
  const cv::Rect seen = place & cv::Rect({0, 0}, picture.size());
  label(seen - place.tl()).copyTo(picture(seen));
}

}  // namespace

Chart::Chart(const std::string& title, const Axis& x, const Axis& y, cv::Size size)
    : picture_(size, CV_8UC3, cv::Scalar::all(255)),
      frame_(kLeft, kTop, size.width - kLeft - kRight, size.height - kTop - kBottom),
      x_(x),
      y_(y) {
  write(picture_, title, {kLeft, 26}, kChartInk, 0.55);
  constexpr int kUnit = 1 << kShift;
  for (const double t : x.ticks ? ticksOf(x) : std::vector<double>()) {
    const cv::Point p = at({t, y.low}) / kUnit;
    cv::line(picture_, p, {p.x, kTop}, kGrid);
    const std::string label = formatted("%.4g", t);
    write(picture_, label, {p.x - widthOf(label, 0.42) / 2, frame_.br().y + 17}, kChartInk, 0.42);
  }
  for (const double t : y.ticks ? ticksOf(y) : std::vector<double>()) {
    const cv::Point p = at({x.low, t}) / kUnit;
    cv::line(picture_, p, {frame_.br().x, p.y}, kGrid);
    const std::string label = formatted("%.4g", t);
    write(picture_, label, {kLeft - 6 - widthOf(label, 0.42), p.y + 4}, kChartInk, 0.42);
  }
  cv::rectangle(picture_, frame_, kFrame);
  write(picture_, x.label, {frame_.x + (frame_.width - widthOf(x.label, 0.45)) / 2, size.height - 12}, kChartInk, 0.45);
  writeUpwards(picture_, y.label, {12, frame_.y + frame_.height / 2});
}

Chart Chart::ofEqualScale(const std::string& title, const Axis& x, const Axis& y, cv::Size size) {
  const double width = size.width - kLeft - kRight, height = size.height - kTop - kBottom;
  const double per_px = std::max((x.high - x.low) / width, (y.high - y.low) / height);
  const auto widened = [&](Axis axis, double length_px) {
    const double middle = 0.5 * (axis.low + axis.high), half = 0.5 * length_px * per_px;
    axis.low = middle - half;
    axis.high = middle + half;
    return axis;
  };
  return Chart(title, widened(x, width), widened(y, height), size);
}

cv::Point Chart::at(const Eigen::Vector2d& value) const {
  constexpr int kUnit = 1 << kShift;
  // Far outside is as good as further.
  const double right = std::clamp((value.x() - x_.low) / (x_.high - x_.low), -20.0, 20.0),
               up = std::clamp((value.y() - y_.low) / (y_.high - y_.low), -20.0, 20.0);
  return {static_cast<int>(std::lround(kUnit * (frame_.x + right * frame_.width))),
          static_cast<int>(std::lround(kUnit * (frame_.br().y - up * frame_.height)))};
}

void Chart::disc(const Eigen::Vector2d& place, double radius_px, const cv::Scalar& colour) {
  cv::circle(picture_, at(place), static_cast<int>(radius_px * (1 << kShift)), colour, cv::FILLED, cv::LINE_AA, kShift);
}

void Chart::ring(const Eigen::Vector2d& place, double radius_px, const cv::Scalar& colour, int width_px) {
  cv::circle(picture_, at(place), static_cast<int>(radius_px * (1 << kShift)), colour, width_px, cv::LINE_AA, kShift);
}

void Chart::line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const cv::Scalar& colour, int width_px) {
  cv::Mat inside = picture_(frame_);
  const cv::Point corner = frame_.tl() * (1 << kShift);
  cv::line(inside, at(from) - corner, at(to) - corner, colour, width_px, cv::LINE_AA, kShift);
}

void Chart::box(const Eigen::Vector2d& low, const Eigen::Vector2d& high, const cv::Scalar& colour) {
  cv::rectangle(picture_, at(low), at(high), colour, cv::FILLED, cv::LINE_AA, kShift);
}

void Chart::text(const std::string& words, const Eigen::Vector2d& place, const cv::Scalar& colour, cv::Point shift_px,
                 double size) {
  const cv::Point from = at(place) / (1 << kShift) + shift_px;
  // On white, so that lines behind do not cross it out.
  const int height = static_cast<int>(std::lround(24 * size));
  cv::rectangle(picture_, from + cv::Point(-2, -height), from + cv::Point(widthOf(words, size) + 2, height / 3),
                cv::Scalar::all(255), cv::FILLED);
  write(picture_, words, from, colour, size);
}

cv::Mat barChart(const std::string& title, const std::string& unit, const std::vector<Bar>& bars, cv::Size size) {
  double most = 0;
  for (const Bar& bar : bars) most = std::max(most, bar.value);
  const auto count = static_cast<double>(bars.size());
  Chart chart(title, {"", -0.6, count - 0.4, false}, {unit, 0, most > 0 ? 1.1 * most : 1}, size);
  const double room_px = (size.width - kLeft - kRight) / (count + 0.2);
  double clear = -0.5 * size.width;  // The next name may begin here.
  for (std::size_t i = 0; i < bars.size(); ++i) {
    const auto x = static_cast<double>(i);
    chart.box({x - 0.36, 0}, {x + 0.36, bars[i].value}, bars[i].colour);
    const int width = widthOf(bars[i].name, 0.4);
    if (x * room_px - 0.5 * width < clear) continue;
    clear = x * room_px + 0.5 * width + 8;
    chart.text(bars[i].name, {x, 0}, kChartInk, {-width / 2, 17}, 0.4);
  }
  return chart.picture();
}

cv::Mat stacked(const std::vector<cv::Mat>& pictures) {
  cv::Mat column;
  cv::vconcat(pictures, column);
  return column;
}

}  // namespace angio
