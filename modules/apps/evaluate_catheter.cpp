// SPDX-License-Identifier: GPL-2.0-or-later
// angio-evaluate catheter: where a catheter's tip is in the tree, frame by frame of a sequence.
#include <memory>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/case_run.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "catheter_report.hpp"
#include "evaluate.hpp"

namespace angio::apps {
namespace {

struct CatheterOptions {
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
CatheterRoute offline(const std::vector<SequenceFrame>& frames, const VesselTree& tree,
                      const SequenceSettings& settings) {
  ProgressBar bar("localising", settings.rounds + 1);
  const SequenceResult result = localiseSequence(frames, tree, settings, [&](int rounds) { bar.show(rounds); });
  CatheterRoute way{
      "all frames at once", {}, displaced(tree, result.displacements_m), std::vector<bool>(frames.size(), true)};
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

int evaluateCatheter(const CatheterOptions& o) {
  for (const auto& path : {o.out, o.sheet}) requireFolderOf(path);
  CatheterFile file;
  if (!o.settings.empty()) file = readSettings(o.settings, file);
  if (o.rigid) file.sequence.deformation_std_mm = 0;
  const CaseSet set = readCaseSet(o.cases);
  const VesselTree tree = readVesselTree(set.cases.front().tree_path);
  const auto frames = framesOf(set, file.catheter, o.period_s);

  std::vector<bool> first(frames.size()), even(frames.size());
  for (std::size_t t = 0; t < frames.size(); ++t) {
    first[t] = t < static_cast<std::size_t>(o.learn_frames);
    even[t] = t % 2 == 0;
  }
  const CatheterRoute all = offline(frames, tree, file.sequence);
  const CatheterRoute one_by_one =
      online(formatted("frame by frame, pose and vessels learnt from the first %d", o.learn_frames), frames, first,
             tree, file.sequence);
  const CatheterRoute halved = online("frame by frame, learnt from every second", frames, even, tree, file.sequence);

  Json json;
  std::string text;
  for (const CatheterRoute* way : {&all, &one_by_one, &halved}) {
    const Json& located = json["ways"][way->name] = catheterAsJson(*way, set);
    // Of the last one only the figures: it says what was left out is explained as well.
    text += way == &halved ? way->name + "\n" : catheterTable(way->name, located);
    text += "\n" + catheterSummary(located);
    if (way != &all) text += catheterComparison(*way, all);
    if (way != &halved) text += "\n";
  }
  json["settings"] = settingsAsJson(file);
  if (!o.sheet.empty()) writeImage(o.sheet, catheterSheet(all, frames, set, o.columns, o.side_px));
  return reported(json, o.out, text);
}

}  // namespace

void addEvaluateCatheter(CLI::App& app, Work& work) {
  const auto o = std::make_shared<CatheterOptions>();
  auto* command = app.add_subcommand("catheter", "Locate a catheter's tip in the tree, in each frame of a sequence");
  command->option_defaults()->always_capture_default();
  command->footer("Example:\n  angio-evaluate catheter examples/data/hepatic-tace/cases.yaml --sheet sheet.png");
  command
      ->add_option("cases", o->cases, "Case set (cases.yaml) whose centrelines are a catheter's, in the order of time")
      ->required();
  command->add_option("--period-s", o->period_s, "From frame to frame [s]")->check(CLI::Range(0.001, 100.0));
  command
      ->add_option("--learn-frames", o->learn_frames,
                   "Of the run frame by frame: these come first, to learn the pose from")
      ->check(CLI::Range(1, 100000));
  command->add_flag("--rigid", o->rigid, "The vessels are where the tree has them, but for one pose");
  command->add_option("--settings", o->settings, "Settings (.yaml), sections sequence and catheter");
  command->add_option("--out", o->out, "All results (.json)");
  command->add_option("--sheet", o->sheet, "Picture of all frames (.png, .jpg)");
  command->add_option("--columns", o->columns, "Of the sheet")->check(CLI::Range(1, 100));
  command->add_option("--side-px", o->side_px, "Width of each picture on it")->check(CLI::Range(50, 2000));
  command->callback([o, &work] { work = [o] { return evaluateCatheter(*o); }; });
}

}  // namespace angio::apps
