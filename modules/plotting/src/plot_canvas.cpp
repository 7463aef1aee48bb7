// SPDX-License-Identifier: GPL-2.0-or-later
#include "plot_canvas.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/base/formatted.hpp"
#include "angio/plotting/subpixel.hpp"

namespace angio::plotting {
namespace {

const cv::Scalar kFaint(228, 228, 228), kGuide(166, 159, 154);

std::string classOf(const PlotCanvas::Look& look) {
  return " class=\"" + look.part + (look.color < 0 ? "" : " c" + std::to_string(look.color % kPlotColors)) + "\"";
}

cv::Scalar colorOf(const PlotCanvas::Look& look) {
  if (look.part == "rule" || look.part == "count") return kFaint;
  if (look.part == "name") return kNameShade * plotColor(look.color);
  return look.part == "guide" ? kGuide : plotColor(look.color);
}

std::vector<cv::Point> fixed(const PlotCanvas::Points& points) {
  std::vector<cv::Point> all;
  std::transform(points.begin(), points.end(), std::back_inserter(all), subpixel);
  return all;
}

constexpr double kTextSize = 0.42, kTitleSize = 0.5;

}  // namespace

cv::Scalar plotColor(int index) {
  static const cv::Scalar kColors[kPlotColors] = {{178, 114, 0},   {0, 94, 213},  {115, 158, 0},
                                                  {167, 121, 204}, {0, 159, 230}, {233, 180, 86}};
  if (index == kWarningColor) return {40, 40, 214};
  return index < 0 ? cv::Scalar::all(45) : kColors[index % kPlotColors];
}

std::string htmlEscaped(const std::string& plain) {
  std::string escaped;
  for (const char c : plain) {
    escaped += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '"' ? "&quot;" : std::string(1, c);
  }
  return escaped;
}

void SvgCanvas::shape(const std::string& tag, const Points& points, const Look& look) {
  svg_ += "<" + tag + classOf(look) + " points=\"";
  for (const cv::Point2d& p : points) svg_ += formatted("%.1f,%.1f ", p.x, p.y);
  svg_ += "\"/>\n";
}

void SvgCanvas::circle(const cv::Point2d& center, double radius_px, const Look& look) {
  svg_ +=
      "<circle" + classOf(look) + formatted(" cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"/>\n", center.x, center.y, radius_px);
}

void SvgCanvas::text(const cv::Point2d& at, Anchor anchor, const std::string& words, const Look& look) {
  if (words.empty()) return;
  static const char* const kAnchors[] = {"start", "middle", "end"};
  svg_ += "<text" + classOf(look) +
          formatted(" x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">", at.x, at.y, kAnchors[static_cast<int>(anchor)]) +
          htmlEscaped(words) + "</text>\n";
}

double SvgCanvas::widthOf(const std::string& words) const { return 6.0 * static_cast<double>(words.size()); }

void PictureCanvas::line(const Points& points, const Look& look) {
  const std::vector<cv::Point> path = fixed(points);
  const bool dashed = look.part == "dashed";
  if (!dashed && look.part != "line") {
    cv::polylines(picture_, path, false, colorOf(look), 1, cv::LINE_8, kSubpixelBits);
    return;
  }
  const cv::Rect inside = cv::Rect(frame_) & cv::Rect({}, picture_.size());
  cv::Mat frame = picture_(inside);
  const cv::Point corner = inside.tl() * (1 << kSubpixelBits);
  for (std::size_t i = 1; i < path.size(); ++i) {
    if (dashed && i % 2 == 0 && path.size() > 40) continue;  // Of a curve, every other piece.
    const int pieces = dashed ? std::max(1, static_cast<int>(cv::norm(points[i] - points[i - 1]) / 5)) : 1;
    const cv::Point from = path[i - 1] - corner, along = path[i] - path[i - 1];
    for (int k = 0; k < pieces; k += 2) {
      cv::line(frame, from + along * (static_cast<double>(k) / pieces), from + along * ((k + 1.0) / pieces),
               colorOf(look), dashed ? 1 : 2, cv::LINE_AA, kSubpixelBits);
    }
  }
}

void PictureCanvas::area(const Points& corners, const Look& look) {
  const double opacity = look.part == "band" ? 0.13 : 1;
  cv::Mat filled = picture_.clone();
  cv::fillPoly(filled, std::vector<std::vector<cv::Point>>{fixed(corners)}, colorOf(look), cv::LINE_AA, kSubpixelBits);
  cv::addWeighted(filled, opacity, picture_, 1 - opacity, 0, picture_);
}

void PictureCanvas::circle(const cv::Point2d& center, double radius_px, const Look& look) {
  const int radius = static_cast<int>(std::lround(radius_px * (1 << kSubpixelBits)));
  cv::circle(picture_, subpixel(center), radius, colorOf(look), look.part == "ring" ? 2 : cv::FILLED, cv::LINE_AA,
             kSubpixelBits);
}

void PictureCanvas::text(const cv::Point2d& at, Anchor anchor, const std::string& words, const Look& look) {
  if (words.empty()) return;
  const double size = look.part == "title" ? kTitleSize : kTextSize;
  const double back = anchor == Anchor::kStart ? 0 : (anchor == Anchor::kEnd ? 1 : 0.5) * widthOf(words);
  const cv::Point from(cvRound(at.x - back), cvRound(at.y));
  if (look.part == "note" || look.part == "name") {  // On white, so that lines behind do not cross it out.
    const cv::Size box = cv::getTextSize(words, cv::FONT_HERSHEY_SIMPLEX, size, 1, nullptr);
    cv::rectangle(picture_, from + cv::Point(-2, 4), from + cv::Point(box.width + 2, -box.height - 2),
                  cv::Scalar::all(255), cv::FILLED);
  }
  cv::putText(picture_, words, from, cv::FONT_HERSHEY_SIMPLEX, size, colorOf(look), 1, cv::LINE_AA);
}

void PictureCanvas::ground(const cv::Mat& picture, const cv::Rect2d& frame) {
  cv::Mat inside = picture_(cv::Rect(frame));
  cv::resize(picture, inside, inside.size(), 0, 0, cv::INTER_NEAREST);
}

double PictureCanvas::widthOf(const std::string& words) const {
  return cv::getTextSize(words, cv::FONT_HERSHEY_SIMPLEX, kTextSize, 1, nullptr).width;
}

}  // namespace angio::plotting
