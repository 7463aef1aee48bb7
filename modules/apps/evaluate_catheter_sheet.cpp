// SPDX-License-Identifier: GPL-2.0-or-later
#include "evaluate_catheter_sheet.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "angio/apps/namespace.hpp"
#include "angio/evaluation/overlay.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::apps {
namespace {

constexpr int kMargin_px = 4;
constexpr double kAround_px = 60;  // Of the curves, in the image.
const cv::Scalar kTreeColor(110, 110, 110), kPathColor(90, 255, 90), kCurveColor(60, 70, 255), kInk(255, 255, 255);

// The camera whose image is cut, scaled and shifted as the picture is.
XrayCamera pictured(const XrayCamera& camera, const Eigen::Vector2d& shift_px, const Eigen::Vector2d& corner_px,
                    double scale, const cv::Size& size) {
  XrayCamera::Parameters p = camera.parameters();
  p.width_px = size.width;
  p.height_px = size.height;
  p.fx_px *= scale;
  p.fy_px *= scale;
  p.cx_px = (p.cx_px + shift_px.x() - corner_px.x()) * scale;
  p.cy_px = (p.cy_px + shift_px.y() - corner_px.y()) * scale;
  return XrayCamera(p);
}

cv::Point at(const Eigen::Vector2d& p) { return {cvRound(p.x()), cvRound(p.y())}; }

void drawLine(cv::Mat& canvas, const std::vector<Eigen::Vector2d>& line, const cv::Scalar& color, int width_px) {
  for (std::size_t i = 1; i < line.size(); ++i)
    cv::line(canvas, at(line[i - 1]), at(line[i]), color, width_px, cv::LINE_AA);
}

// The vessels from the root to the tip, in the camera.
std::vector<Eigen::Vector2d> wayTo(const TipPlace& tip, const VesselTree& tree, const XrayCamera& camera,
                                   const Pose& T) {
  const TreeTopology map(tree);
  std::vector<Eigen::Vector2d> line;
  for (const int chain : map.pathTo(tip.chain)) {
    double arc_m = 0;
    const std::vector<int>& points = map.points(chain);
    for (std::size_t k = 0; k < points.size(); ++k) {
      if (k > 0) arc_m += (tree.points().col(points[k]) - tree.points().col(points[k - 1])).norm();
      if (chain == tip.chain && arc_m > tip.arc_m) break;
      if (const auto u = camera.project(T * tree.points().col(points[k]))) line.push_back(*u);
    }
  }
  if (const auto u = camera.project(T * tip.tip_model)) line.push_back(*u);
  return line;
}

cv::Mat drawn(const CatheterPicture& picture, const VesselTree& tree, const Eigen::Vector2d& corner_px, double scale,
              const cv::Size& size) {
  const XrayCamera camera = pictured(picture.camera, picture.shift_px, corner_px, scale, size);
  OverlayScene scene;
  scene.trees.push_back({picture.T_camera_model, {}, kTreeColor, ""});
  scene.caption = picture.caption;
  cv::Mat canvas = drawOverlay(scene, tree, camera);
  std::vector<Eigen::Vector2d> curve;
  for (int i = 0; i < picture.seen_px.cols(); ++i) curve.push_back(scale * (picture.seen_px.col(i) - corner_px));
  const auto way = wayTo(picture.tip, tree, camera, picture.T_camera_model);
  drawLine(canvas, way, kPathColor, 2);
  drawLine(canvas, curve, kCurveColor, 1);
  if (!way.empty()) cv::circle(canvas, at(way.back()), 6, kInk, 1, cv::LINE_AA);
  return canvas;
}

}  // namespace

cv::Mat catheterSheet(const std::vector<CatheterPicture>& pictures, const VesselTree& tree, int columns, int side_px) {
  Eigen::Vector2d low = pictures.front().seen_px.rowwise().minCoeff(),
                  high = pictures.front().seen_px.rowwise().maxCoeff();
  for (const auto& picture : pictures) {
    low = low.cwiseMin(picture.seen_px.rowwise().minCoeff());
    high = high.cwiseMax(picture.seen_px.rowwise().maxCoeff());
  }
  low.array() -= kAround_px;
  high.array() += kAround_px;
  const double scale = side_px / (high - low).x();
  const cv::Size size(side_px, std::max(1, cvRound(scale * (high - low).y())));
  const int count = static_cast<int>(pictures.size()), across = std::min(columns, count);
  const cv::Size pitch(size.width + kMargin_px, size.height + kMargin_px);
  cv::Mat sheet((count + across - 1) / across * pitch.height, across * pitch.width, CV_8UC3, kInk);
  for (int i = 0; i < count; ++i) {
    const cv::Rect place(i % across * pitch.width, i / across * pitch.height, size.width, size.height);
    drawn(pictures[i], tree, low, scale, size).copyTo(sheet(place));
  }
  return sheet;
}

}  // namespace angio::apps
