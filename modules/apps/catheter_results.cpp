// SPDX-License-Identifier: GPL-2.0-or-later
#include "catheter_results.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/interruption.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/results/columns.hpp"
#include "angio/results/experiment.hpp"
#include "angio/vessel/tree_distance.hpp"

namespace angio::apps {

CatheterSequenceSettings CatheterSequenceAsked::inForce() const {
  CatheterSequenceSettings force = settings;
  if (rigid) force.sequence.deformation_std_mm = 0;
  return force;
}

std::vector<SequenceFrame> catheterFrames(const CaseSet& set, const CatheterSequenceAsked& asked) {
  std::vector<SequenceFrame> frames;
  for (const Case& one : set.cases) {
    const View& view = one.views.front();
    if (!view.centerline_path) throw InputError(one.name, "centerline", "", "must be given: the catheter's curve");
    if (one.tree_path != set.cases.front().tree_path)
      throw InputError(one.name, "tree", one.tree_path, "must be the same in all frames");
    // All that such a file holds is a catheter.
    Centerline2d seen = readCenterline(*view.centerline_path);
    seen.kind.assign(static_cast<std::size_t>(seen.size()), CurveKind::kDevice);
    const auto catheter = seenCatheter(seen, view.camera, asked.settings.catheter);
    if (!catheter) throw InputError(*view.centerline_path, "", "", "must show a catheter, as a curve with branches");
    frames.push_back({*catheter, {view.camera, one.initial_pose, Matrix6d::Zero()}, {asked.period_s, std::nullopt}});
  }
  return frames;
}

namespace {

// After each round of a way.
void goesOn(int) { throwIfInterrupted(); }

VesselTree displaced(const VesselTree& tree, const Eigen::Matrix3Xd& displacements_m) {
  return VesselTree(tree.points() + displacements_m, tree.parents(), tree.radii());
}

// All frames at once.
CatheterRoute offline(const std::string& name, const std::vector<SequenceFrame>& frames, const VesselTree& tree,
                      const SequenceSettings& settings) {
  const SequenceResult result = localiseSequence(frames, tree, settings, goesOn);
  CatheterRoute way{name, {}, displaced(tree, result.displacements_m), std::vector<bool>(frames.size(), true)};
  for (std::size_t t = 0; t < frames.size(); ++t) {
    way.frames.push_back({result.beliefs[t], frames[t].pose.T_camera_model * result.correction, 0});
  }
  return way;
}

// One frame after the other, with the pose and the vessels' displacements as found in those that are `learnt`.
CatheterRoute online(const std::string& name, const std::vector<SequenceFrame>& frames, std::vector<bool> learnt,
                     const VesselTree& tree, const SequenceSettings& settings) {
  std::vector<SequenceFrame> known;
  CatheterMotion since;  // The last frame that is learnt from.
  since.period_s = 0;
  for (std::size_t t = 0; t < frames.size(); ++t) {
    since.period_s += frames[t].motion.period_s;
    if (!learnt[t]) continue;
    known.push_back({frames[t].seen, frames[t].pose, since});
    since.period_s = 0;
  }
  const SequenceResult result = localiseSequence(known, tree, settings, goesOn);
  CatheterRoute way{name, {}, displaced(tree, result.displacements_m), std::move(learnt)};
  CatheterLocaliser localiser(settings.localiser, way.tree);
  for (const SequenceFrame& frame : frames) {
    SeenPose pose = frame.pose;
    pose.T_camera_model = pose.T_camera_model * result.correction;
    const Stopwatch watch;
    Located one{localiser.update(frame.seen, pose, frame.motion), pose.T_camera_model, 0};
    one.time_s = watch.seconds();
    way.frames.push_back(one);
  }
  return way;
}

TreeLocation placeOf(const TipBelief& belief) { return {belief.tip.branch, belief.tip.arc_m}; }

// The way as other programs read it: {"summary": ..., "cases": {name: chain, arc length, how sure, residual, ...}}.
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
           {"chain", b.tip.branch},
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
    if (t > 0) steps_mm.push_back(1e3 * alongVessels_m(map, placeOf(way.frames[t - 1].belief), placeOf(b)));
    if (t == 0 || b.tip.branch != way.frames[t - 1].belief.tip.branch) {
      chains += (t > 0 ? " " : "") + std::to_string(b.tip.branch);
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

std::string nameOfWay(int way, int learn_frames) {
  if (way == 0) return "all frames at once";
  if (way == 1) return formatted("frame by frame, pose and vessels learnt from the first %d", learn_frames);
  return "frame by frame, learnt from every second";
}

CatheterRoute routeOf(int way, int learn_frames, const std::vector<SequenceFrame>& frames, const VesselTree& tree,
                      const SequenceSettings& settings) {
  if (way == 0) return offline(nameOfWay(way, learn_frames), frames, tree, settings);
  std::vector<bool> learnt(frames.size());
  for (std::size_t t = 0; t < frames.size(); ++t) {
    learnt[t] = way == 1 ? t < static_cast<std::size_t>(learn_frames) : t % 2 == 0;
  }
  return online(nameOfWay(way, learn_frames), frames, std::move(learnt), tree, settings);
}

}  // namespace

Json catheterSequenceResults(const CaseSet& set, const CatheterSequenceAsked& asked,
                             const std::function<void(int way, const CatheterRoute& route)>& look_on,
                             const Progress& progress) {
  requireBetween("evaluate catheter", "period_s", asked.period_s, 0.001, 100);
  requireBetween("evaluate catheter", "learn_frames", asked.learn_frames, 1, 100000);
  const VesselTree tree = readVesselTree(set.cases.front().tree_path);
  const auto frames = catheterFrames(set, asked);
  const CatheterSequenceSettings settings = asked.inForce();
  const auto one = [&](int way) {
    const CatheterRoute route = routeOf(way, asked.learn_frames, frames, tree, settings.sequence);
    if (look_on) look_on(way, route);
    return catheterAsJson(route, set);
  };
  const auto nameOf = [&](int way) { return nameOfWay(way, asked.learn_frames); };
  const std::vector<Json> located = recordsOf(asked.campaign, kCatheterWays, 1, nameOf, one, progress);
  Json json;
  for (std::size_t way = 0; way < located.size(); ++way) json["ways"][nameOf(static_cast<int>(way))] = located[way];
  json["settings"] = settingsAsJson(settings);
  return json;
}

}  // namespace angio::apps
