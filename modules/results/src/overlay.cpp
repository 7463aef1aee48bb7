// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/overlay.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/joined.hpp"
#include "angio/results/text_band.hpp"
#include "drawing.hpp"

namespace angio::results {

const cv::Scalar kGroundColor(24, 20, 18), kStartColor(255, 170, 80), kCenterlineColor(255, 110, 200),
    kConvergedColor(140, 235, 40), kLimitedColor(0, 160, 255), kRejectedColor(60, 50, 240);

// The darkest and brightest half per cent do not count: a few hot pixels must not make the image grey.
cv::Mat greyPicture(const cv::Mat& image) {
  cv::Mat color;
  cv::Mat values = image.clone().reshape(1, 1);  // Cloned first: a window into a larger image is no single row.
  cv::sort(values, values, cv::SORT_EVERY_ROW | cv::SORT_ASCENDING);
  values.convertTo(values, CV_32F);
  const int n = values.cols;
  const float low = values.at<float>(n / 200), high = std::max(low + 1, values.at<float>(n - 1 - n / 200));
  cv::Mat grey;
  image.convertTo(grey, CV_8U, 255.0 / (high - low), -255.0 * low / (high - low));
  cv::cvtColor(grey, color, cv::COLOR_GRAY2BGR);
  return color;
}

void drawCurve(cv::Mat& canvas, const Centerline2d& centerline, const cv::Scalar& color_bgr, int width_px) {
  for (int i = 0; i < centerline.size(); ++i) {
    const cv::Point here = subpixel(centerline.points_px.col(i));
    const bool joined = i > 0 && centerline.ordered() && centerline.branch[i] == centerline.branch[i - 1];
    const cv::Point there = joined ? subpixel(centerline.points_px.col(i - 1)) : here;
    cv::line(canvas, there, here, color_bgr, width_px, cv::LINE_AA, kSubpixelBits);
  }
}

void writeText(cv::Mat& canvas, const std::string& text, const cv::Point& at, const cv::Scalar& color_bgr, double size,
               int stroke_px, int rim_px) {
  const cv::Scalar dark(0, 0, 0);
  const int width_px = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size, stroke_px, nullptr).width;
  const double fitting = static_cast<double>(canvas.cols - at.x) / std::max(1, width_px);
  if (fitting > 0 && fitting < 1) {
    size *= fitting;
    stroke_px = std::max(1, static_cast<int>(fitting * stroke_px));
  }
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, size, dark, stroke_px + rim_px, cv::LINE_AA);
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, size, color_bgr, stroke_px, cv::LINE_AA);
}

namespace {

constexpr int kMargin_px = 6;
const cv::Scalar kLetterColor(0, 225, 255), kCaptionColor(240, 240, 240), kSheetVesselColor(30, 90, 255);

void drawTree(cv::Mat& canvas, const VesselTree& tree, const XrayCamera& camera, const OverlayTree& what) {
  std::vector<std::optional<Eigen::Vector2d>> pixel(static_cast<std::size_t>(tree.size()));
  for (int i = 0; i < tree.size(); ++i) {
    Eigen::Vector3d p = tree.points().col(i);
    if (what.displacements_m.cols() == tree.size()) p += what.displacements_m.col(i);
    pixel[i] = camera.project(what.T_camera_model * p);
  }
  for (int i = 0; i < tree.size(); ++i) {
    const int parent = tree.parents()[i];
    if (parent < 0) continue;
    const auto &a = pixel[i], &b = pixel[parent];
    if (a && b) cv::line(canvas, subpixel(*a), subpixel(*b), what.color_bgr, 2, cv::LINE_AA, kSubpixelBits);
  }
}

void drawKinds(cv::Mat& canvas, const Centerline2d& seen, double scale) {
  for (const CurveKind kind : {CurveKind::kVessel, CurveKind::kDevice}) {
    Centerline2d curves = ofKind(seen, kind);
    curves.points_px = (scale * (curves.points_px.array() + 0.5) - 0.5).matrix().eval();
    drawCurve(canvas, curves, kind == CurveKind::kVessel ? kSheetVesselColor : kStartColor, 1);
  }
}

cv::Mat drawn(const SheetPicture& picture, int side_px) {
  const double scale = static_cast<double>(side_px) / std::max(picture.image.cols, picture.image.rows);
  cv::Mat scaled;
  cv::resize(picture.image, scaled, {}, scale, scale, scale < 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
  cv::Mat canvas(side_px, side_px, CV_8UC3, kGroundColor);
  const cv::Rect frame(0, 0, std::min(side_px, scaled.cols), std::min(side_px, scaled.rows));
  greyPicture(scaled)(frame).copyTo(canvas(frame));
  drawKinds(canvas, picture.centerline, scale);
  return withBandBelow(canvas, {{picture.caption, kCaptionColor}});
}

}  // namespace

StatusStyle statusStyle(RegistrationStatus status, const std::optional<std::vector<std::string>>& usable_for) {
  const std::string name = statusName(status);
  if (status != RegistrationStatus::kConverged) return {kRejectedColor, name + ", not to be trusted"};
  if (!usable_for) return {kConvergedColor, name};
  if (usable_for->empty()) return {kLimitedColor, name + ", too unsure for any task"};
  // The task that needs the most: places of the tree in all directions.
  const bool all = std::find(usable_for->begin(), usable_for->end(), "navigate") != usable_for->end();
  return {all ? kConvergedColor : kLimitedColor, name + ", usable for " + joined(*usable_for) + (all ? "" : " only")};
}

std::string alignmentInWords(const AlignmentScore& alignment) {
  return formatted("image to tree %.2f px, %.0f %% of the tree in view explained", alignment.image_residual_px,
                   100 * alignment.model_explained);
}

cv::Mat drawOverlayImage(const OverlayScene& scene, const VesselTree& tree, const XrayCamera& camera) {
  cv::Mat canvas = scene.image.empty() ? cv::Mat(camera.height_px(), camera.width_px(), CV_8UC3, kGroundColor)
                                       : greyPicture(scene.image);
  // A broad line, so that the model can be drawn as a fine one on top of it.
  if (scene.centerline) drawCurve(canvas, *scene.centerline, kCenterlineColor, 5);
  for (const auto& what : scene.trees) drawTree(canvas, tree, camera, what);
  if (scene.R_camera_lps) drawPatientLetters(canvas, *scene.R_camera_lps);
  return canvas;
}

cv::Mat drawOverlay(const OverlayScene& scene, const VesselTree& tree, const XrayCamera& camera) {
  std::vector<BandEntry> entries;
  const auto stroke = BandEntry::Mark::kStroke;
  if (scene.centerline) entries.push_back({"centreline in the image", kCenterlineColor, stroke});
  for (const auto& what : scene.trees) entries.push_back({what.label, what.color_bgr, stroke});
  entries.push_back({scene.caption, kCaptionColor});
  return withBandBelow(drawOverlayImage(scene, tree, camera), entries);
}

cv::Mat drawCenterline(const cv::Mat& image, const Centerline2d& seen) {
  cv::Mat canvas = greyPicture(image);
  drawKinds(canvas, seen, 1);
  const auto stroke = BandEntry::Mark::kStroke;
  return withBandBelow(canvas, {{"vessels", kSheetVesselColor, stroke}, {"devices", kStartColor, stroke}});
}

std::string patientLetters(const Eigen::Vector3d& direction_lps) {
  constexpr const char* kLetters[3][2] = {{"L", "R"}, {"P", "A"}, {"H", "F"}};
  const double least = std::sin(degToRad(20)) * direction_lps.norm();
  std::vector<int> axes;
  for (const int axis : {0, 1, 2}) {
    if (std::abs(direction_lps[axis]) > least) axes.push_back(axis);
  }
  std::stable_sort(axes.begin(), axes.end(),
                   [&](int a, int b) { return std::abs(direction_lps[a]) > std::abs(direction_lps[b]); });
  std::string letters;
  for (const int axis : axes) letters += kLetters[axis][direction_lps[axis] < 0];
  return letters;
}

void drawPatientLetters(cv::Mat& picture, const Eigen::Matrix3d& R_camera_lps) {
  const double size = std::max(0.7, picture.cols / 750.0);
  const int rim = std::max(6, static_cast<int>(std::lround(10 * size)));
  const int stroke = std::max(2, static_cast<int>(std::lround(2 * size)));
  const auto write = [&](const Eigen::Vector3d& direction_lps, double x, double y) {
    const std::string letters = patientLetters(direction_lps);
    const cv::Size box = cv::getTextSize(letters, cv::FONT_HERSHEY_SIMPLEX, size, stroke, nullptr);
    // x and y: the share of what is left beside the letters.
    const cv::Point at(rim + static_cast<int>(x * (picture.cols - box.width - 2 * rim)),
                       rim + box.height + static_cast<int>(y * (picture.rows - box.height - 2 * rim)));
    writeText(picture, letters, at, kLetterColor, size, stroke, 4);
  };
  const Eigen::Vector3d right = R_camera_lps.row(0), down = R_camera_lps.row(1);
  write(-right, 0, 0.5);
  write(right, 1, 0.5);
  write(-down, 0.5, 0);
  write(down, 0.5, 1);
}

cv::Mat sideBySide(const std::vector<cv::Mat>& pictures) {
  int height = 0, width = 0;
  for (const cv::Mat& picture : pictures) {
    height = std::max(height, picture.rows);
    width += picture.cols;
  }
  cv::Mat row(height, width, pictures.front().type(), kGroundColor);
  int left = 0;
  for (const cv::Mat& picture : pictures) {
    picture.copyTo(row(cv::Rect(left, 0, picture.cols, picture.rows)));
    left += picture.cols;
  }
  return row;
}

cv::Mat tiled(const std::vector<cv::Mat>& pictures, int columns, int gap_px, const cv::Scalar& ground) {
  const int count = static_cast<int>(pictures.size()), across = std::min(columns, count);
  cv::Size pitch(0, 0);
  for (const cv::Mat& picture : pictures) {
    pitch.width = std::max(pitch.width, picture.cols + gap_px);
    pitch.height = std::max(pitch.height, picture.rows + gap_px);
  }
  cv::Mat sheet((count + across - 1) / across * pitch.height, across * pitch.width, CV_8UC3, ground);
  for (int i = 0; i < count; ++i) {
    const cv::Point corner(i % across * pitch.width, i / across * pitch.height);
    pictures[i].copyTo(sheet(cv::Rect(corner, pictures[i].size())));
  }
  return sheet;
}

cv::Mat contactSheet(const std::vector<SheetPicture>& pictures, int columns, int side_px) {
  if (pictures.empty()) throw InputError("contact sheet", "pictures", "0", "must be at least one");
  if (columns < 1) throw InputError("contact sheet", "columns", std::to_string(columns), "must be at least 1");
  if (side_px < 1) throw InputError("contact sheet", "side_px", std::to_string(side_px), "must be at least 1");
  std::vector<cv::Mat> squares;
  for (const SheetPicture& picture : pictures) squares.push_back(drawn(picture, side_px));
  cv::Mat sheet;
  cv::copyMakeBorder(tiled(squares, columns, kMargin_px, kGroundColor), sheet, kMargin_px, 0, kMargin_px, 0,
                     cv::BORDER_CONSTANT, kGroundColor);
  return sheet;
}

}  // namespace angio::results
