// SPDX-License-Identifier: GPL-2.0-or-later
// angio-evaluate catheter: where a catheter's tip is in the tree, frame by frame of a sequence.
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/localisation/sequence_localiser.hpp"
#include "angio/results/campaign.hpp"
#include "angio/results/columns.hpp"
#include "angio/results/experiment.hpp"
#include "angio/vessel/tree_topology.hpp"
#include "catheter_sheet.hpp"
#include "evaluate.hpp"

namespace angio::apps {
namespace {

struct CatheterOptions {
  CampaignOptions campaign;
  std::string cases, settings, out, sheet;
  double period_s = 0.5;
  int learn_frames = 1;
  bool rigid = false;
  int columns = 8, side_px = 240;
};

// The settings file of this command.
struct CatheterFile {
  SequenceSettings sequence;
  SeenCatheterSettings catheter;

  void visit(SettingsVisitor& v) {
    v.section("sequence", [&](SettingsVisitor& inner) { sequence.visit(inner); });
    v.section("catheter", [&](SettingsVisitor& inner) { catheter.visit(inner); });
  }
};

std::vector<SequenceFrame> framesOf(const CaseSet& set, const SeenCatheterSettings& settings, double period_s) {
  std::vector<SequenceFrame> frames;
  for (const Case& one : set.cases) {
    const View& view = one.views.front();
    if (!view.centerline_path) throw InputError(one.name, "centerline", "", "must be given: the catheter's curve");
    if (one.tree_path != set.cases.front().tree_path)
      throw InputError(one.name, "tree", one.tree_path, "must be the same in all frames");
    // All that such a file holds is a catheter.
    Centerline2d seen = readCenterline(*view.centerline_path);
    seen.kind.assign(static_cast<std::size_t>(seen.size()), CurveKind::kDevice);
    const auto catheter = seenCatheter(seen, view.camera, settings);
    if (!catheter) throw InputError(*view.centerline_path, "", "", "must show a catheter, as a curve with branches");
    frames.push_back({*catheter, {view.camera, one.initial_pose, Matrix6d::Zero()}, {period_s, std::nullopt}});
  }
  return frames;
}

VesselTree displaced(const VesselTree& tree, const Eigen::Matrix3Xd& displacements_m) {
  return VesselTree(tree.points() + displacements_m, tree.parents(), tree.radii());
}

// All frames at once.
CatheterRoute offline(const std::string& name, const std::vector<SequenceFrame>& frames, const VesselTree& tree,
                      const SequenceSettings& settings) {
  ProgressBar bar("localising", settings.rounds + 1);
  const SequenceResult result = localiseSequence(frames, tree, settings, [&](int rounds) { bar.show(rounds); });
  CatheterRoute way{name, {}, displaced(tree, result.displacements_m), std::vector<bool>(frames.size(), true)};
  for (std::size_t t = 0; t < frames.size(); ++t) {
    way.frames.push_back({result.beliefs[t], frames[t].pose.T_camera_model * result.correction, 0});
  }
  return way;
}

// One frame after the other, with the pose and the vessels' displacements as found in those that are `learnt`.
CatheterRoute online(const std::string& name, const std::vector<SequenceFrame>& frames, std::vector<bool> learnt,
                     const VesselTree& tree, const SequenceSettings& settings) {
  ProgressBar bar("learning", settings.rounds + 1);
  std::vector<SequenceFrame> known;
  CatheterMotion since;  // The last frame that is learnt from.
  since.period_s = 0;
  for (std::size_t t = 0; t < frames.size(); ++t) {
    since.period_s += frames[t].motion.period_s;
    if (!learnt[t]) continue;
    known.push_back({frames[t].seen, frames[t].pose, since});
    since.period_s = 0;
  }
  const SequenceResult result = localiseSequence(known, tree, settings, [&](int rounds) { bar.show(rounds); });
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

// How far apart two places are along the vessels [m].
double alongVessels_m(const TreeTopology& map, const TipPlace& a, const TipPlace& b) {
  const auto to_a = map.pathTo(a.branch), to_b = map.pathTo(b.branch);
  std::size_t shared = 0;
  while (shared < to_a.size() && shared < to_b.size() && to_a[shared] == to_b[shared]) ++shared;
  if (shared == 0) return (a.tip_model - b.tip_model).norm();  // Different roots.
  const int last = to_a[shared - 1];
  const double end_m = map.start_m(last) + map.length_m(last);
  const double at_a_m = map.start_m(a.branch) + a.arc_m, at_b_m = map.start_m(b.branch) + b.arc_m;
  const double fork_m = std::min({end_m, at_a_m, at_b_m});
  return at_a_m + at_b_m - 2 * fork_m;
}

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
    if (t > 0) steps_mm.push_back(1e3 * alongVessels_m(map, way.frames[t - 1].belief.tip, b.tip));
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

// Of that, a line for each frame.
std::string catheterTable(const std::string& name, const Json& way) {
  std::string table =
      name +
      "\n\nframe      status    branch  arc mm  from root mm  sigma mm  probability  residual px  shift mm x, y\n";
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
      "located in {seen:%d} of {frames:%d} frames, in one branch with more than 90 % in {probability_above_0.9:%d}\n"
      "residual of the curve against the path from the root: mean {mean_residual_px:%.2f px}, largest "
      "{max_residual_px:%.2f px}, within 3 px in {within_3_px:%d}\n"
      "branches in order: " +
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

// How far two ways put the tip from each other, in one line.
std::string catheterComparison(const Json& a, const Json& b, const std::string& name_of_b) {
  std::vector<double> apart_mm;
  int same = 0;
  for (const auto& [frame, here] : a["cases"].items()) {
    const Json& there = b["cases"][frame];
    double squares = 0;
    for (int k = 0; k < 3; ++k) {
      const double off_mm = here["tip_mm"][k].get<double>() - there["tip_mm"][k].get<double>();
      squares += off_mm * off_mm;
    }
    apart_mm.push_back(std::sqrt(squares));
    same += here["chain"] == there["chain"];
  }
  return formatted("tip from that of %s: median %.1f mm, at most %.1f mm; in the same branch in %d frames\n",
                   name_of_b.c_str(), percentile(apart_mm, 0.5), percentile(apart_mm, 1), same);
}

constexpr int kWays = 3;  // Each is one run: its frames depend on each other.

std::string nameOfWay(int way, const CatheterOptions& o) {
  if (way == 0) return "all frames at once";
  if (way == 1) return formatted("frame by frame, pose and vessels learnt from the first %d", o.learn_frames);
  return "frame by frame, learnt from every second";
}

CatheterRoute routeOf(int way, const CatheterOptions& o, const std::vector<SequenceFrame>& frames,
                      const VesselTree& tree, const SequenceSettings& settings) {
  if (way == 0) return offline(nameOfWay(way, o), frames, tree, settings);
  std::vector<bool> learnt(frames.size());
  for (std::size_t t = 0; t < frames.size(); ++t) {
    learnt[t] = way == 1 ? t < static_cast<std::size_t>(o.learn_frames) : t % 2 == 0;
  }
  return online(nameOfWay(way, o), frames, std::move(learnt), tree, settings);
}

// Of all ways, as text.
std::string catheterReport(const Json& ways) {
  const std::string& first = ways.begin().key();
  std::string text;
  std::size_t way = 0;
  for (const auto& [name, located] : ways.items()) {
    // Of the last one only the figures: it says what was left out is explained as well.
    const bool last = ++way == ways.size();
    text += last ? name + "\n" : catheterTable(name, located);
    text += "\n" + catheterSummary(located);
    if (name != first) text += catheterComparison(located, ways.front(), first);
    if (!last) text += "\n";
  }
  return text;
}

int evaluateCatheter(const CatheterOptions& o, const CatheterFile& file, const CaseSet& set, const CampaignRun& run) {
  const VesselTree tree = readVesselTree(set.cases.front().tree_path);
  const auto frames = framesOf(set, file.catheter, o.period_s);
  cv::Mat sheet;
  const auto one = [&](int way) {
    const CatheterRoute route = routeOf(way, o, frames, tree, file.sequence);
    if (way == 0 && !o.sheet.empty()) sheet = catheterSheet(route, frames, set, o.columns, o.side_px);
    return catheterAsJson(route, set);
  };
  const auto nameOf = [&](int way) { return nameOfWay(way, o); };
  const std::vector<Json> located = recordsOf(run.rows, kWays, 1, nameOf, one);
  if (!run.done()) return 0;
  Json json;
  for (std::size_t way = 0; way < located.size(); ++way) {
    json["ways"][nameOfWay(static_cast<int>(way), o)] = run.shown(located[way]);
  }
  const std::string text = catheterReport(json["ways"]);
  json["settings"] = settingsAsJson(file);
  if (!o.sheet.empty()) writeImage(o.sheet, sheet);
  return reported(std::move(json), o.out, text, run.machine);
}

int evaluateCatheter(const CatheterOptions& o, const Campaigns& campaigns) {
  requireFolderOf(o.out);
  requireImagePath(o.sheet);
  CatheterFile file;
  if (!o.settings.empty()) file = readSettings(o.settings, file);
  if (o.rigid) file.sequence.deformation_std_mm = 0;
  const CaseSet set = readCaseSet(o.cases);
  CampaignJob job{
      o.campaign, o.out, kWays, {}, [&](const CampaignRun& run) { return evaluateCatheter(o, file, set, run); }};
  addInput(job.inputs, o.settings);
  addInputs(job.inputs, o.cases, set);
  return campaigns.run(job);
}

}  // namespace

void addEvaluateCatheter(cli::Command& app, Work& work, const Campaigns& campaigns) {
  const auto o = std::make_shared<CatheterOptions>();
  auto* command = app.addSubcommand("catheter", "Locate a catheter's tip in the tree, in each frame of a sequence");
  command->footer("Example:\n  angio-evaluate catheter examples/data/hepatic-tace/cases.yaml --sheet sheet.png");
  command
      ->addOption("cases", o->cases, "Case set (cases.yaml) whose centrelines are a catheter's, in the order of time")
      ->required();
  command->addOption("--period-s", o->period_s, "From frame to frame [s]")->check(cli::between(0.001, 100.0));
  command
      ->addOption("--learn-frames", o->learn_frames,
                  "Of the run frame by frame: these come first, to learn the pose from")
      ->check(cli::wholeBetween(1, 100000));
  command->addFlag("--rigid", o->rigid, "The vessels are where the tree has them, but for one pose");
  addSettingsOptions(*command, o->settings, "Settings (.yaml), sections sequence and catheter",
                     settingsInForce<CatheterFile>);
  command->addOption("--out", o->out, "All results (.json)");
  auto* sheet = command->addOption("--sheet", o->sheet, "Picture of all frames (.png, .jpg)");
  command->addOption("--columns", o->columns, "Of the sheet")->check(cli::wholeBetween(1, 100));
  command->addOption("--side-px", o->side_px, "Width of each picture on it")->check(cli::wholeBetween(50, 2000));
  o->campaign.addTo(*command, {sheet});
  command->onChosen([o, &work, &campaigns] { work = [o, &campaigns] { return evaluateCatheter(*o, campaigns); }; });
}

}  // namespace angio::apps
