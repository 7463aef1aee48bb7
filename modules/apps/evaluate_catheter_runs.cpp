// SPDX-License-Identifier: GPL-2.0-or-later
// angio-evaluate catheter-runs: trees registered by a catheter that is pushed on in them, with known truth.
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/catheter_runs.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/results/columns.hpp"
#include "angio/results/experiment.hpp"
#include "evaluate.hpp"

namespace angio::apps {
namespace {

// From this share of the points beyond three standard deviations on a converged frame is wrong.
constexpr double kMaxBeyond = 0.05;

struct CatheterRunsOptions {
  std::vector<std::string> trees;
  std::string out;
  int runs = 20;
  CatheterRunSettings run;
};

using F = const CatheterRunFrame&;

Json ofConverged(F frame, double (*value)(F)) { return frame.claim ? Json(value(frame)) : Json(nullptr); }

std::vector<Column<CatheterRunFrame>> frameColumns() {
  return {{"registered", "registered_percent", "percent", [](F f) { return f.registered; }},
          {"converged", "converged_percent", "percent", [](F f) { return f.converged; }},
          {"for_centre", "usable_for_centre_percent", "percent", [](F f) { return f.for_centre; }},
          {"", "converged_and_wrong_percent", "percent", [](F f) { return f.claim && f.claim->beyond > kMaxBeyond; }},
          {"across_mm", "across_mm", "median p95 max",
           [](F f) { return ofConverged(f, [](F g) { return 1e3 * *g.across_m; }); }},
          {"beyond", "", "", [](F f) { return ofConverged(f, [](F g) { return g.claim->beyond; }); }},
          {"plane_in", "plane_in_90_percent", "mean",
           [](F f) { return ofConverged(f, [](F g) { return 100 * g.claim->plane_in; }); }},
          {"depth_in", "depth_in_90_percent", "mean",
           [](F f) { return ofConverged(f, [](F g) { return 100 * g.claim->depth_in; }); }}};
}

int evaluateCatheterRuns(const CatheterRunsOptions& o) {
  requireFolderOf(o.out);
  std::vector<VesselTree> trees;
  for (const auto& path : o.trees) trees.push_back(readVesselTree(path));
  Json json;
  std::vector<CatheterRunFrame> all;
  int wrong_runs = 0;
  {
    ProgressBar bar("following catheters", o.runs);
    for (int index = 0; index < o.runs; ++index) {
      const std::size_t tree = static_cast<std::size_t>(index) % trees.size();
      const auto frames = catheterRun(trees[tree], o.run, index);
      wrong_runs +=
          std::any_of(frames.begin(), frames.end(), [](F f) { return f.claim && f.claim->beyond > kMaxBeyond; });
      json["runs"].push_back({{"tree", std::filesystem::path(o.trees[tree]).filename().string()},
                              {"frames", rowsOf(frames, frameColumns())}});
      all.insert(all.end(), frames.begin(), frames.end());
      bar.show(index + 1);
    }
  }
  Json& summary = json["summary"] = {{"runs", o.runs}, {"frames", all.size()}, {"runs_with_wrong", wrong_runs}};
  summarise(all, frameColumns(), summary);
  const std::string text = filled(
      "{runs:%d} runs, {frames:%d} frames, the first ones of each included\n"
      "registered by their catheter {registered_percent:%.0f %%}, converged {converged_percent:%.0f %%}, usable for "
      "centre {usable_for_centre_percent:%.0f %%}, converged and wrong {converged_and_wrong_percent:%.1f %%}, in "
      "{runs_with_wrong:%d} runs\n"
      "converged: across the beam {across_mm/median:%.2f mm} off (median), {across_mm/p95:%.2f} (p95), "
      "{across_mm/max:%.2f} at most; within 90 % intervals {plane_in_90_percent:%.0f %%} across, "
      "{depth_in_90_percent:%.0f %%} of depths\n",
      summary);
  return reported(json, o.out, text, machineAsJson());
}

}  // namespace

void addEvaluateCatheterRuns(cli::Command& app, Work& work) {
  const auto o = std::make_shared<CatheterRunsOptions>();
  auto* command =
      app.addSubcommand("catheter-runs", "Register trees by a simulated catheter that is pushed on in them");
  command->footer("Example:\n  angio-evaluate catheter-runs --tree examples/data/hepatic-tace/tree.csv --runs 4");
  command->addOption("--tree", o->trees, "Vessel tree (.csv, .swc, .vtp, HMM .txt); may be repeated: runs take turns")
      ->required();
  command->addOption("--runs", o->runs, "Runs in all")->check(cli::wholeBetween(1, 100000));
  command->addOption("--frames", o->run.frames, "Of a run")->check(cli::wholeBetween(1, 1000));
  command->addOption("--seed", o->run.seed, "Of all draws")->check(cli::wholeBetween(0, 1000000));
  command->addOption("--rotation-deg", o->run.rotation_std_deg, "What poses are wrong by, std per axis")
      ->check(cli::between(0.0, 90.0));
  command->addOption("--translation-mm", o->run.translation_std_mm, "What poses are wrong by, std per axis")
      ->check(cli::between(0.0, 1000.0));
  command->addOption("--deformation-mm", o->run.deformation_rms_mm, "Smooth deformation of the tree, rms")
      ->check(cli::between(0.0, 100.0));
  command->addOption("--breath-mm", o->run.breath_mm, "Amplitude of the shift from frame to frame")
      ->check(cli::between(0.0, 100.0));
  command->addOption("--beside-mm", o->run.beside_mm, "How far the catheter lies beside the vessels' axes")
      ->check(cli::between(0.0, 20.0));
  command->addOption("--noise-px", o->run.noise_px, "Of the curve's points, std of each coordinate")
      ->check(cli::between(0.0, 100.0));
  command->addOption("--out", o->out, "All results (.json)");
  command->onChosen([o, &work] { work = [o] { return evaluateCatheterRuns(*o); }; });
}

}  // namespace angio::apps
