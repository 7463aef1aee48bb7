// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/overlay.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "drawing.hpp"

namespace angio::evaluation {
namespace {

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
    if (a && b) cv::line(canvas, subpixel(*a), subpixel(*b), what.color_bgr, 2, cv::LINE_AA, kSubpixelBits);
  }
}

}  // namespace

const cv::Scalar kStartColor(255, 170, 80), kModelColor(80, 255, 60), kCenterlineColor(30, 90, 255);

cv::Mat drawOverlay(const OverlayScene& scene, const VesselTree& tree, const XrayCamera& camera) {
  cv::Mat canvas = scene.image.empty() ? cv::Mat(camera.height_px(), camera.width_px(), CV_8UC3, kGroundColor)
                                       : greyPicture(scene.image);
  // A broad line, so that the model can be drawn as a fine one on top of it.
  if (scene.centerline) drawCurve(canvas, *scene.centerline, kCenterlineColor, 5);
  int line = 32;
  if (scene.centerline) writeText(canvas, "centreline in the image", {14, line}, kCenterlineColor), line += 30;
  for (const auto& what : scene.trees) {
    drawTree(canvas, tree, camera, what);
    writeText(canvas, what.label, {14, line}, what.color_bgr);
    line += 30;
  }
  if (!scene.caption.empty()) writeText(canvas, scene.caption, {14, canvas.rows - 14}, cv::Scalar(255, 255, 255));
  return canvas;
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

}  // namespace angio::evaluation
