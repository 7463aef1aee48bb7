// SPDX-License-Identifier: GPL-2.0-or-later
// angio-evaluate catheter-runs: trees registered by a catheter that is pushed on in them, with known truth.
#include <algorithm>
#include <filesystem>
#include <functional>
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

struct CatheterRunsOptions {
  std::vector<std::string> trees;
  std::string out;
  int runs = 20;
  CatheterRunSettings run;
  CampaignOptions campaign;
};

Json frameAsJson(const CatheterRunFrame& frame) {
  Json json = {{"registered", frame.registered},
               {"converged", frame.converged},
               {"for_centre", frame.for_centre},
               {"wrong", frame.wrong}};
  if (!frame.claim) return json;
  json["across_mm"] = 1e3 * *frame.across_m;
  json["beyond"] = frame.claim->beyond;
  json["plane_in_90_percent"] = 100 * frame.claim->plane_in;
  json["depth_in_90_percent"] = 100 * frame.claim->depth_in;
  return json;
}

bool isWrong(const Json& frame) { return frame["wrong"]; }

// Null where a frame has none.
std::function<Json(const Json&)> valueOf(const char* key) {
  return [key](const Json& frame) { return frame.value(key, Json(nullptr)); };
}

std::vector<Column<Json>> frameColumns() {
  return {{"", "registered_percent", "percent", valueOf("registered")},
          {"", "converged_percent", "percent", valueOf("converged")},
          {"", "usable_for_centre_percent", "percent", valueOf("for_centre")},
          {"", "converged_and_wrong_percent", "percent", valueOf("wrong")},
          {"", "across_mm", "median p95 max", valueOf("across_mm")},
          {"", "plane_in_90_percent", "mean", valueOf("plane_in_90_percent")},
          {"", "depth_in_90_percent", "mean", valueOf("depth_in_90_percent")}};
}

Json summaryOfRuns(const Json& runs) {
  std::vector<Json> frames;
  int wrong_runs = 0;
  for (const Json& run : runs) {
    const Json& of_run = run["frames"];
    wrong_runs += std::any_of(of_run.begin(), of_run.end(), isWrong);
    frames.insert(frames.end(), of_run.begin(), of_run.end());
  }
  Json summary = {{"runs", runs.size()}, {"frames", frames.size()}, {"runs_with_wrong", wrong_runs}};
  summarise(frames, frameColumns(), summary);
  return summary;
}

int evaluateCatheterRuns(const CatheterRunsOptions& o, const CampaignRun& run) {
  std::vector<VesselTree> trees;
  std::vector<std::string> names;
  for (const auto& path : o.trees) {
    trees.push_back(readVesselTree(path));
    names.push_back(std::filesystem::path(path).filename().string());
  }
  const auto treeOf = [&](int index) { return static_cast<std::size_t>(index) % trees.size(); };
  const auto one = [&](int index) {
    Json json = {{"tree", names[treeOf(index)]}, {"frames", Json::array()}};
    for (const CatheterRunFrame& frame : catheterRun(trees[treeOf(index)], o.run, index)) {
      json["frames"].push_back(frameAsJson(frame));
    }
    return json;
  };
  const auto nameOf = [](int index) { return "run " + std::to_string(index); };
  ProgressBar bar("following catheters", run.share(o.runs));
  const std::vector<Json> runs = recordsOf(run.rows, o.runs, 1, nameOf, one, [&](int done) { bar.show(done); });
  if (!run.done()) return 0;
  Json json;
  json["runs"] = runs;
  json["summary"] = summaryOfRuns(json["runs"]);
  const std::string text = filled(
      "{runs:%d} runs, {frames:%d} frames, the first ones of each included\n"
      "registered by their catheter {registered_percent:%.0f %%}, converged {converged_percent:%.0f %%}, usable for "
      "centre {usable_for_centre_percent:%.0f %%}, converged and wrong {converged_and_wrong_percent:%.1f %%}, in "
      "{runs_with_wrong:%d} runs\n"
      "converged: across the beam {across_mm/median:%.2f mm} off (median), {across_mm/p95:%.2f} (p95), "
      "{across_mm/max:%.2f} at most; within 90 % intervals {plane_in_90_percent:%.0f %%} across, "
      "{depth_in_90_percent:%.0f %%} of depths\n",
      json["summary"]);
  return reported(std::move(json), o.out, text, run.machine);
}

int evaluateCatheterRuns(const CatheterRunsOptions& o, const Campaigns& campaigns) {
  requireFolderOf(o.out);
  CampaignJob job{o.campaign, o.out, o.runs, {}, [&](const CampaignRun& run) { return evaluateCatheterRuns(o, run); }};
  for (const auto& path : o.trees) addInput(job.inputs, path);
  return campaigns.run(job);
}

}  // namespace

void addEvaluateCatheterRuns(cli::Command& app, Work& work, const Campaigns& campaigns) {
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
  o->campaign.addTo(*command);
  command->onChosen([o, &work, &campaigns] { work = [o, &campaigns] { return evaluateCatheterRuns(*o, campaigns); }; });
}

}  // namespace angio::apps
