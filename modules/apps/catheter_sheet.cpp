// SPDX-License-Identifier: GPL-2.0-or-later
#include "catheter_sheet.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "angio/base/formatted.hpp"
#include "angio/results/overlay.hpp"
#include "angio/results/text_band.hpp"
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
  std::vector<Eigen::Vector2d> line;
  for (const int point : TreeTopology(tree).pointsTo({tip.branch, tip.arc_m})) {
    if (const auto u = camera.project(T * tree.points().col(point))) line.push_back(*u);
  }
  if (const auto u = camera.project(T * tip.tip_model)) line.push_back(*u);
  return line;
}

}  // namespace

cv::Mat catheterSheet(const CatheterRoute& way, const std::vector<SequenceFrame>& frames, const CaseSet& set,
                      int columns, int side_px) {
  Eigen::Vector2d low = frames.front().seen.points_px.rowwise().minCoeff(),
                  high = frames.front().seen.points_px.rowwise().maxCoeff();
  for (const auto& frame : frames) {
    low = low.cwiseMin(frame.seen.points_px.rowwise().minCoeff());
    high = high.cwiseMax(frame.seen.points_px.rowwise().maxCoeff());
  }
  low.array() -= kAround_px;
  high.array() += kAround_px;
  const double scale = side_px / (high - low).x();
  const cv::Size size(side_px, std::max(1, cvRound(scale * (high - low).y())));
  std::vector<cv::Mat> pictures;
  for (std::size_t t = 0; t < frames.size(); ++t) {
    const auto& [b, T, time_s] = way.frames[t];
    const XrayCamera camera = pictured(frames[t].pose.camera, b.shift_px, low, scale, size);
    OverlayScene scene;
    scene.trees.push_back({T, {}, kTreeColor, ""});
    cv::Mat canvas = drawOverlayImage(scene, way.tree, camera);
    std::vector<Eigen::Vector2d> curve;
    for (const auto& p : frames[t].seen.points_px.colwise()) curve.push_back(scale * (p - low));
    const auto path = wayTo(b.tip, way.tree, camera, T);
    drawLine(canvas, path, kPathColor, 2);
    drawLine(canvas, curve, kCurveColor, 1);
    if (!path.empty()) cv::circle(canvas, at(path.back()), 6, kInk, 1, cv::LINE_AA);
    const std::string caption =
        formatted("%s: branch %d at %.0f mm", set.cases[t].name.c_str(), b.tip.branch, 1e3 * b.tip.arc_m);
    pictures.push_back(withBandBelow(canvas, {{caption, cv::Scalar::all(240)}}));
  }
  return tiled(pictures, columns, kMargin_px, kInk);
}

}  // namespace angio::apps
