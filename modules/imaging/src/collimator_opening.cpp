// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/collimator_opening.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "area_resampler.hpp"
#include "field_outline.hpp"
#include "largest_region.hpp"
#include "quantile.hpp"
#include "xray_image.hpp"

namespace angio::imaging {
namespace {

constexpr int kSmallSide = 160;  // The field is sought on an image of about this size.
constexpr int kMinOpeningSide = 16;

// Of the image's rim a tenth at least is in shadow where there is a blade, and the patient is in its middle.
constexpr double kShadowPart = 0.1;

// A shadow's border rises by this much at least, as a logarithm, within some small pixels to both sides, along most of
// its length.
constexpr float kRise = 0.25f, kSharpLength = 0.85f, kBorderReach = 3;

// The open part fills its hull and is neither a spot nor everything.
constexpr double kConvex = 0.95, kMinArea = 0.15, kMaxArea = 0.99;

// How far below the patient's median the border is tried, as a logarithm. Displays lift the shadow and leave it uneven,
// and patients have dark parts: the sharpest border is taken.
constexpr float kLevels[] = {0.35f, 0.6f, 1.0f, 1.6f};

std::vector<float> rimOf(const cv::Mat& small) {
  std::vector<float> rim;
  for (int y = 0; y < small.rows; ++y) {
    const bool whole = y < 2 || y >= small.rows - 2;
    for (int x = 0; x < small.cols; ++x) {
      if (whole || x < 2 || x >= small.cols - 2) rim.push_back(small.at<float>(y, x));
    }
  }
  return rim;
}

double filledArea(const cv::Mat& region) {
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(region, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  double area = 0;
  // A contour runs through the centres of the outermost pixels.
  for (const auto& c : contours) area = std::max(area, cv::contourArea(c) + 0.5 * static_cast<double>(c.size()));
  return area;
}

// Where each row and column enters and leaves the region, between pixels where the image passes the level.
std::vector<cv::Point2f> outermost(const cv::Mat& small, const cv::Mat& region, float level) {
  std::vector<cv::Point2f> points;
  const auto crossing = [&](int inside_x, int inside_y, int dx, int dy) {
    const int x = inside_x + dx, y = inside_y + dy;
    // Open up to the rim: the image's edge, half a pixel further on.
    if (x < 0 || y < 0 || x >= small.cols || y >= small.rows) return 0.5f;
    const float in = small.at<float>(inside_y, inside_x), out = small.at<float>(y, x);
    return in > out ? std::clamp((in - level) / (in - out), 0.0f, 1.0f) : 0.5f;
  };
  const auto scan = [&](int lines, int length, bool rows) {
    for (int line = 0; line < lines; ++line) {
      const auto isIn = [&](int i) { return region.at<std::uint8_t>(rows ? line : i, rows ? i : line) != 0; };
      int first = 0, last = length - 1;
      while (first < length && !isIn(first)) ++first;
      if (first == length) continue;
      while (!isIn(last)) --last;
      const float at = static_cast<float>(line);
      const float from =
          static_cast<float>(first) - (rows ? crossing(first, line, -1, 0) : crossing(line, first, 0, -1));
      const float to = static_cast<float>(last) + (rows ? crossing(last, line, 1, 0) : crossing(line, last, 0, 1));
      points.emplace_back(rows ? from : at, rows ? at : from);
      points.emplace_back(rows ? to : at, rows ? at : to);
    }
  };
  scan(small.rows, small.cols, true);
  scan(small.cols, small.rows, false);
  return points;
}

// The part of the polygon's sides across which the image rises, 0 if they are the image's own edges nearly everywhere.
float sharpPart(const cv::Mat& small, const std::vector<cv::Point2f>& polygon) {
  cv::Point2f center(0, 0);
  for (const cv::Point2f& p : polygon) center += p * (1.0f / static_cast<float>(polygon.size()));
  int sharp = 0, total = 0;
  const cv::Rect2f inside(0, 0, static_cast<float>(small.cols - 1), static_cast<float>(small.rows - 1));
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const cv::Point2f a = polygon[i], side = polygon[(i + 1) % polygon.size()] - a;
    const float length = static_cast<float>(cv::norm(side));
    if (length < 1e-3f) continue;
    cv::Point2f normal(-side.y / length, side.x / length);
    if (normal.dot(center - a) < 0) normal = -normal;
    for (float s = 0.5f; s < length; s += 1) {
      const cv::Point2f p = a + side * (s / length), in = p + kBorderReach * normal, out = p - kBorderReach * normal;
      if (!inside.contains(in) || !inside.contains(out)) continue;
      const auto at = [&](const cv::Point2f& q) {
        return small.at<float>(cv::Point(static_cast<int>(q.x + 0.5f), static_cast<int>(q.y + 0.5f)));
      };
      ++total;
      sharp += at(in) - at(out) > kRise ? 1 : 0;
    }
  }
  // A rim too narrow to be looked across is no shadow to care about.
  return total > small.cols / 8 ? static_cast<float>(sharp) / static_cast<float>(total) : 0;
}

// The field in a small image whose shadow is dark.
std::vector<cv::Point2f> darkFramed(const cv::Mat& small) {
  const cv::Mat middle = small(cv::Rect(small.cols / 4, small.rows / 4, small.cols / 2, small.rows / 2)).clone();
  std::vector<float> rim = rimOf(small), inner(middle.begin<float>(), middle.end<float>());
  const float shadow = quantileOf(rim, 0.5 * kShadowPart), patient = quantileOf(inner, 0.5);
  const double all = static_cast<double>(small.total());
  std::vector<cv::Point2f> best;
  float sharpest = kSharpLength;
  for (const float below : kLevels) {
    const float level = patient - below;
    if (level < shadow + 0.5f * kRise) break;
    const cv::Mat region = largestRegion(openedByDisc(small > level));  // Without specks.
    if (region.empty()) continue;
    std::vector<cv::Point2f> hull, polygon;
    cv::convexHull(outermost(small, region, level), hull);
    cv::approxPolyDP(hull, polygon, 0.4, true);
    if (polygon.size() < 3) continue;
    const double area = cv::contourArea(hull);
    if (area < kMinArea * all || area > kMaxArea * all || filledArea(region) < kConvex * area) continue;
    const float sharp = sharpPart(small, polygon);
    if (sharp <= sharpest) continue;
    sharpest = sharp;
    best = std::move(polygon);
  }
  return best;
}

}  // namespace

std::vector<cv::Point2f> outlineOfField(const cv::Mat& image) {
  const int shorter = std::min(image.cols, image.rows);
  if (shorter < kMinOpeningSide) return {};
  const float factor = std::max(1.0f, static_cast<float>(shorter) / kSmallSide);
  AreaResampler shrink;
  Plane plane;
  const cv::Size size(static_cast<int>(static_cast<float>(image.cols) / factor),
                      static_cast<int>(static_cast<float>(image.rows) / factor));
  shrink(image, size, plane);
  cv::Mat small = plane.mat();
  const double mean = cv::mean(small)[0];
  if (!(mean > 0)) return {};
  cv::log(small + 0.02 * mean, small);
  std::vector<cv::Point2f> polygon = darkFramed(small);
  if (polygon.empty()) polygon = darkFramed(-small);
  const float fx = static_cast<float>(image.cols) / static_cast<float>(size.width);
  const float fy = static_cast<float>(image.rows) / static_cast<float>(size.height);
  for (cv::Point2f& p : polygon) p = {fx * (p.x + 0.5f) - 0.5f, fy * (p.y + 0.5f) - 0.5f};
  return polygon;
}

std::vector<RowRange> rowsInside(const std::vector<cv::Point2f>& polygon, const cv::Size& size, float inset) {
  std::vector<RowRange> rows(static_cast<std::size_t>(size.height), RowRange{0, size.width});
  const double area = cv::contourArea(polygon, true);
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const cv::Point2f a = polygon[i], side = polygon[(i + 1) % polygon.size()] - a;
    const float length = static_cast<float>(cv::norm(side));
    if (length < 1e-3f) continue;
    const cv::Point2f inwards = cv::Point2f(-side.y, side.x) * ((area > 0 ? 1 : -1) / length);
    for (int y = 0; y < size.height; ++y) {
      // inwards . (p - a) >= inset, solved for x.
      const float rest = inset - inwards.y * (static_cast<float>(y) - a.y);
      RowRange& row = rows[y];
      if (std::abs(inwards.x) < 1e-6f) {
        if (rest > 0) row.end = row.begin;
      } else if (inwards.x > 0) {
        row.begin = std::max(row.begin, static_cast<int>(std::ceil(std::min(a.x + rest / inwards.x, 1e6f))));
      } else {
        row.end = std::min(row.end, static_cast<int>(std::floor(std::max(a.x + rest / inwards.x, -1e6f))) + 1);
      }
    }
  }
  for (RowRange& row : rows) {
    row.begin = std::min(row.begin, size.width);
    row.end = std::max(row.begin, row.end);
  }
  return rows;
}

OpenField findOpenField(const cv::Mat& image) {
  requireXray(image);
  OpenField field;
  const std::vector<cv::Point2f> polygon = outlineOfField(image);
  field.mask = cv::Mat(image.size(), CV_8UC1, cv::Scalar(polygon.empty() ? 255 : 0));
  if (polygon.empty()) return field;
  for (const cv::Point2f& p : polygon) field.polygon_px.emplace_back(p.x, p.y);
  const std::vector<RowRange> rows = rowsInside(polygon, image.size(), 0);
  for (int y = 0; y < image.rows; ++y) {
    std::fill(field.mask.ptr(y) + rows[y].begin, field.mask.ptr(y) + rows[y].end, std::uint8_t{255});
  }
  return field;
}

}  // namespace angio::imaging
