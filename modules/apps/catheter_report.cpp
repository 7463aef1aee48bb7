// SPDX-License-Identifier: GPL-2.0-or-later
#include "catheter_report.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "angio/base/formatted.hpp"
#include "angio/evaluation/experiment.hpp"
#include "angio/evaluation/overlay.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::apps {
namespace {

// How far apart two places are along the vessels [m].
double alongVessels_m(const TreeTopology& map, const TipPlace& a, const TipPlace& b) {
  const auto to_a = map.pathTo(a.chain), to_b = map.pathTo(b.chain);
  std::size_t shared = 0;
  while (shared < to_a.size() && shared < to_b.size() && to_a[shared] == to_b[shared]) ++shared;
  if (shared == 0) return (a.tip_model - b.tip_model).norm();  // Different roots.
  const int last = to_a[shared - 1];
  const double end_m = map.start_m(last) + map.length_m(last);
  const double at_a_m = map.start_m(a.chain) + a.arc_m, at_b_m = map.start_m(b.chain) + b.arc_m;
  const double fork_m = std::min({end_m, at_a_m, at_b_m});
  return at_a_m + at_b_m - 2 * fork_m;
}

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

}  // namespace

Json catheterAsJson(const CatheterRoute& way, const CaseSet& set) {
  Json json, residuals_px, left_out_px, times_ms, steps_mm;
  const TreeTopology map(way.tree);
  std::string chains;
  for (std::size_t t = 0; t < way.frames.size(); ++t) {
    const auto& [b, T, time_s] = way.frames[t];
    const double mm_per_px = 1e3 * (T * b.tip.tip_model).z() / set.cases[t].views.front().camera.parameters().fx_px;
    const Eigen::Vector3d tip_mm = 1e3 * b.tip.tip_model;
    Json& one = json["cases"][set.cases[t].name];
    one = {{"status", statusName(b.status)},
           {"chain", b.tip.chain},
           {"arc_mm", 1e3 * b.tip.arc_m},
           {"path_mm", 1e3 * b.tip.path_m},
           {"std_mm", 1e3 * b.tip.std_m},
           {"probability", b.tip.probability},
           {"shift_px", {b.shift_px.x(), b.shift_px.y()}},
           {"shift_mm", {mm_per_px * b.shift_px.x(), mm_per_px * b.shift_px.y()}},
           {"tip_mm", {tip_mm.x(), tip_mm.y(), tip_mm.z()}}};
    if (b.residual_px) one["residual_px"] = *b.residual_px;
    if (!b.why.empty()) one["why"] = b.why;
    if (b.residual_px) residuals_px.push_back(*b.residual_px);
    if (b.residual_px && !way.learnt[t]) left_out_px.push_back(*b.residual_px);
    if (time_s > 0) times_ms.push_back(1e3 * time_s);
    if (t > 0) steps_mm.push_back(1e3 * alongVessels_m(map, way.frames[t - 1].belief.tip, b.tip));
    if (t == 0 || b.tip.chain != way.frames[t - 1].belief.tip.chain) {
      chains += (t > 0 ? " " : "") + std::to_string(b.tip.chain);
    }
  }
  using F = const Located&;
  Json& summary = json["summary"] = {{"frames", way.frames.size()}};
  summarise(way.frames,
            {{"", "seen", "sum", [](F f) { return f.belief.status == BeliefStatus::kSeen; }},
             {"", "probability_above_0.9", "sum", [](F f) { return f.belief.tip.probability > 0.9; }},
             {"", "within_3_px", "sum", [](F f) { return f.belief.residual_px && *f.belief.residual_px <= 3; }}},
            summary);
  summary["mean_residual_px"] = figuresOf(residuals_px, "mean");
  summary["max_residual_px"] = figuresOf(residuals_px, "max");
  summary["chains"] = chains;
  summary["median_step_mm"] = figuresOf(steps_mm, "median");
  summary["max_step_mm"] = figuresOf(steps_mm, "max");
  if (!times_ms.empty()) summary["time_ms"] = figuresOf(times_ms, "median max");
  const bool all_learnt = std::find(way.learnt.begin(), way.learnt.end(), false) == way.learnt.end();
  if (!all_learnt) summary["left_out_residual_px"] = figuresOf(left_out_px, "mean");
  return json;
}

std::string catheterTable(const std::string& name, const Json& way) {
  std::string table =
      name +
      "\n\nframe      status     chain  arc mm  from root mm  sigma mm  probability  residual px  shift mm x, y\n";
  for (const auto& [frame, located] : way["cases"].items()) {
    Json row = located;
    row["residual_px"] = located.value("residual_px", 0.0);
    table += formatted("%-10s ", frame.c_str()) +
             filled(
                 "{status:%-10s} {chain:%5d} {arc_mm:%7.1f} {path_mm:%13.1f} {std_mm:%9.2f} {probability:%12.3f} "
                 "{residual_px:%12.2f} {shift_mm/0:%9.1f} {shift_mm/1:%5.1f}\n",
                 row);
  }
  return table;
}

std::string catheterSummary(const Json& way) {
  const Json& summary = way["summary"];
  std::string text =
      "located in {seen:%d} of {frames:%d} frames, in one chain with more than 90 % in {probability_above_0.9:%d}\n"
      "residual of the curve against the path from the root: mean {mean_residual_px:%.2f px}, largest "
      "{max_residual_px:%.2f px}, within 3 px in {within_3_px:%d}\n"
      "chains in order: " +
      summary["chains"].get<std::string>() +
      "\n"
      "from frame to frame along the vessels: median {median_step_mm:%.1f mm}, at most {max_step_mm:%.1f mm}\n";
  if (summary.contains("time_ms")) {
    text += "a frame takes {time_ms/median:%.1f ms} (median), {time_ms/max:%.1f ms} at most\n";
  }
  if (summary.contains("left_out_residual_px")) {
    text += "residual of the frames that were not learnt from: mean {left_out_residual_px:%.2f px}\n";
  }
  return filled(text, summary);
}

std::string catheterComparison(const CatheterRoute& a, const CatheterRoute& b) {
  std::vector<double> apart_mm;
  int same = 0;
  for (std::size_t t = 0; t < a.frames.size(); ++t) {
    apart_mm.push_back(1e3 * (a.frames[t].belief.tip.tip_model - b.frames[t].belief.tip.tip_model).norm());
    same += a.frames[t].belief.tip.chain == b.frames[t].belief.tip.chain;
  }
  return formatted("tip from that of %s: median %.1f mm, at most %.1f mm; in the same chain in %d frames\n",
                   b.name.c_str(), percentile(apart_mm, 0.5), percentile(apart_mm, 1), same);
}

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
    scene.caption = formatted("%s: %d %.0f", set.cases[t].name.c_str(), b.tip.chain, 1e3 * b.tip.arc_m);
    cv::Mat canvas = drawOverlay(scene, way.tree, camera);
    std::vector<Eigen::Vector2d> curve;
    for (const auto& p : frames[t].seen.points_px.colwise()) curve.push_back(scale * (p - low));
    const auto path = wayTo(b.tip, way.tree, camera, T);
    drawLine(canvas, path, kPathColor, 2);
    drawLine(canvas, curve, kCurveColor, 1);
    if (!path.empty()) cv::circle(canvas, at(path.back()), 6, kInk, 1, cv::LINE_AA);
    pictures.push_back(canvas);
  }
  return tiled(pictures, columns, kMargin_px, kInk);
}

}  // namespace angio::apps
