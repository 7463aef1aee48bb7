// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/contact_sheet.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "angio/base/errors.hpp"
#include "angio/evaluation/overlay.hpp"
#include "drawing.hpp"

namespace angio::evaluation {
namespace {

constexpr int kMargin_px = 6;

cv::Mat drawn(const SheetPicture& picture, int side_px) {
  const double scale = static_cast<double>(side_px) / std::max(picture.image.cols, picture.image.rows);
  cv::Mat scaled;
  cv::resize(picture.image, scaled, {}, scale, scale, scale < 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
  cv::Mat canvas(side_px, side_px, CV_8UC3, kGroundColor);
  const cv::Rect frame(0, 0, std::min(side_px, scaled.cols), std::min(side_px, scaled.rows));
  greyPicture(scaled)(frame).copyTo(canvas(frame));
  for (const CurveKind kind : {CurveKind::kVessel, CurveKind::kDevice}) {
    Centerline2d curves = ofKind(picture.centerline, kind);
    curves.points_px = (scale * (curves.points_px.array() + 0.5) - 0.5).matrix().eval();
    drawCurve(canvas, curves, kind == CurveKind::kVessel ? kCenterlineColor : kStartColor, 1);
  }
  if (!picture.caption.empty()) writeText(canvas, picture.caption, {10, side_px - 12}, {255, 255, 255});
  return canvas;
}

}  // namespace

cv::Mat contactSheet(const std::vector<SheetPicture>& pictures, int columns, int side_px) {
  if (pictures.empty()) throw InputError("contact sheet", "pictures", "0", "must be at least one");
  if (columns < 1) throw InputError("contact sheet", "columns", std::to_string(columns), "must be at least 1");
  if (side_px < 1) throw InputError("contact sheet", "side_px", std::to_string(side_px), "must be at least 1");
  const int count = static_cast<int>(pictures.size());
  const int across = std::min(columns, count), down = (count + across - 1) / across, pitch_px = side_px + kMargin_px;
  cv::Mat sheet(down * pitch_px + kMargin_px, across * pitch_px + kMargin_px, CV_8UC3, kGroundColor);
  for (int i = 0; i < count; ++i) {
    const cv::Rect place(kMargin_px + (i % across) * pitch_px, kMargin_px + (i / across) * pitch_px, side_px, side_px);
    drawn(pictures[static_cast<std::size_t>(i)], side_px).copyTo(sheet(place));
  }
  return sheet;
}

}  // namespace angio::evaluation
