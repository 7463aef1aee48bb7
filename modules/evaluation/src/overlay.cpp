// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/overlay.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace angio {
namespace {

constexpr int kSubpixelBits = 4;
const cv::Scalar kGround(24, 20, 18);

cv::Point subpixel(const Eigen::Vector2d& p) {
  const double scale = 1 << kSubpixelBits;
  // Far outside is far outside: keeps the fixed point numbers from overflowing.
  const auto fixed = [&](double x) { return static_cast<int>(std::lround(std::clamp(x, -3e4, 3e4) * scale)); };
  return {fixed(p.x()), fixed(p.y())};
}

// The darkest and brightest half per cent do not count: a few hot pixels must not make the image grey.
cv::Mat asGround(const cv::Mat& image, const XrayCamera& camera) {
  cv::Mat colour;
  if (image.empty()) return cv::Mat(camera.height_px(), camera.width_px(), CV_8UC3, kGround);
  cv::Mat values = image.clone().reshape(1, 1);  // Cloned first: a window into a larger image is no single row.
  cv::sort(values, values, cv::SORT_EVERY_ROW | cv::SORT_ASCENDING);
  values.convertTo(values, CV_32F);
  const int n = values.cols;
  const float low = values.at<float>(n / 200), high = std::max(low + 1, values.at<float>(n - 1 - n / 200));
  cv::Mat grey;
  image.convertTo(grey, CV_8U, 255.0 / (high - low), -255.0 * low / (high - low));
  cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
  return colour;
}

void drawTree(cv::Mat& canvas, const VesselTree& tree, const XrayCamera& camera, const OverlayTree& what) {
  std::vector<std::optional<Eigen::Vector2d>> pixel(static_cast<std::size_t>(tree.size()));
  for (int i = 0; i < tree.size(); ++i) {
    Eigen::Vector3d p = tree.points().col(i);
    if (what.displacements_m.cols() == tree.size()) p += what.displacements_m.col(i);
    pixel[static_cast<std::size_t>(i)] = camera.project(what.T_camera_model * p);
  }
  for (int i = 0; i < tree.size(); ++i) {
    const int parent = tree.parents()[static_cast<std::size_t>(i)];
    if (parent < 0) continue;
    const auto &a = pixel[static_cast<std::size_t>(i)], &b = pixel[static_cast<std::size_t>(parent)];
    if (a && b) cv::line(canvas, subpixel(*a), subpixel(*b), what.colour_bgr, 2, cv::LINE_AA, kSubpixelBits);
  }
}

// A broad line, so that the model can be drawn as a fine one on top of it. Points without order stay points.
void drawCenterline(cv::Mat& canvas, const Centerline2d& centerline) {
  for (int i = 0; i < centerline.size(); ++i) {
    const cv::Point here = subpixel(centerline.points_px.col(i));
    const bool joined = i > 0 && centerline.ordered() && centerline.branch[i] == centerline.branch[i - 1];
    const cv::Point there = joined ? subpixel(centerline.points_px.col(i - 1)) : here;
    cv::line(canvas, there, here, kCenterlineColour, 5, cv::LINE_AA, kSubpixelBits);
  }
}

void write(cv::Mat& canvas, const std::string& text, const cv::Point& at, const cv::Scalar& colour) {
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, 0.75, cv::Scalar(0, 0, 0), 5, cv::LINE_AA);
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, 0.75, colour, 2, cv::LINE_AA);
}

}  // namespace

const cv::Scalar kStartColour(255, 170, 80), kModelColour(80, 255, 60), kCenterlineColour(30, 90, 255);

cv::Mat drawOverlay(const OverlayScene& scene, const VesselTree& tree, const XrayCamera& camera) {
  cv::Mat canvas = asGround(scene.image, camera);
  if (scene.centerline) drawCenterline(canvas, *scene.centerline);
  int line = 32;
  if (scene.centerline) write(canvas, "centreline in the image", {14, line}, kCenterlineColour), line += 30;
  for (const auto& what : scene.trees) {
    drawTree(canvas, tree, camera, what);
    write(canvas, what.label, {14, line}, what.colour_bgr);
    line += 30;
  }
  if (!scene.caption.empty()) write(canvas, scene.caption, {14, canvas.rows - 14}, cv::Scalar(255, 255, 255));
  return canvas;
}

cv::Mat sideBySide(const std::vector<cv::Mat>& pictures) {
  int height = 0, width = 0;
  for (const cv::Mat& picture : pictures) {
    height = std::max(height, picture.rows);
    width += picture.cols;
  }
  cv::Mat row(height, width, pictures.front().type(), kGround);
  int left = 0;
  for (const cv::Mat& picture : pictures) {
    picture.copyTo(row(cv::Rect(left, 0, picture.cols, picture.rows)));
    left += picture.cols;
  }
  return row;
}

}  // namespace angio
