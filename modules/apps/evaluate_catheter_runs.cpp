// SPDX-License-Identifier: GPL-2.0-or-later
// angio-evaluate catheter-runs: trees registered by a catheter that is pushed on in them, with known truth.
#include <memory>
#include <nlohmann/json.hpp>

#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/results/columns.hpp"
#include "catheter_results.hpp"
#include "evaluate.hpp"

namespace angio::apps {
namespace {

struct CatheterRunsOptions {
  CatheterRunsAsked asked;
  std::string out;
  CampaignOptions campaign;
};

int evaluateCatheterRuns(const CatheterRunsOptions& o, const CampaignRun& run) {
  CatheterRunsAsked asked = o.asked;
  asked.campaign = run.rows;
  ProgressBar bar("following catheters", run.share(asked.runs));
  Json json = catheterRunsResults(asked, [&](int done) { bar.show(done); });
  if (!run.done()) return 0;
  const std::string text = filled(
      "{runs:%d} runs, {frames:%d} frames, the first ones of each included\n"
      "registered by their catheter {registered_percent:%.0f %%}, converged {converged_percent:%.0f %%}, usable for "
      "centre {usable_for_centre_percent:%.0f %%}, converged and wrong {converged_and_wrong_percent:%.1f %%}, in "
      "{runs_with_wrong:%d} runs\n"
      "converged: across the beam {across_mm/median:%.2f mm} off (median), {across_mm/p95:%.2f} (p95), "
      "{across_mm/max:%.2f} at most; within 90 % intervals {plane_in_90_percent:%.0f %%} across, "
      "{depth_in_90_percent:%.0f %%} of depths\n"
      "other vessels that may be a target of centre: within 90 % {beside_in_90_percent:%.0f %%} across, beyond 3 "
      "standard deviations {beside_beyond_percent:%.1f %%}\n",
      json["summary"]);
  return reported(std::move(json), o.out, text, run.machine);
}

int evaluateCatheterRuns(const CatheterRunsOptions& o, const Campaigns& campaigns) {
  requireFolderOf(o.out);
  CampaignJob job{
      o.campaign, o.out, o.asked.runs, {}, [&](const CampaignRun& run) { return evaluateCatheterRuns(o, run); }};
  for (const auto& path : o.asked.trees) addInput(job.inputs, path);
  return campaigns.run(job);
}

}  // namespace

void addEvaluateCatheterRuns(cli::Command& app, Work& work, const Campaigns& campaigns) {
  const auto o = std::make_shared<CatheterRunsOptions>();
  auto* command =
      app.addSubcommand("catheter-runs", "Register trees by a simulated catheter that is pushed on in them");
  command->footer("Example:\n  angio-evaluate catheter-runs --tree examples/data/hepatic-tace/tree.csv --runs 4");
  command
      ->addOption("--tree", o->asked.trees,
                  "Vessel tree (.csv, .swc, .vtp, HMM .txt); may be repeated: runs take turns")
      ->required();
  command->addOption("--runs", o->asked.runs, "Runs in all")->check(cli::wholeBetween(1, 100000));
  command->addOption("--frames", o->asked.run.frames, "Of a run")->check(cli::wholeBetween(1, 1000));
  command->addOption("--seed", o->asked.run.seed, "Of all draws")->check(cli::wholeBetween(0, 1000000));
  command->addOption("--rotation-deg", o->asked.run.rotation_std_deg, "What poses are wrong by, std per axis")
      ->check(cli::between(0.0, 90.0));
  command->addOption("--translation-mm", o->asked.run.translation_std_mm, "What poses are wrong by, std per axis")
      ->check(cli::between(0.0, 1000.0));
  command->addOption("--deformation-mm", o->asked.run.deformation_rms_mm, "Smooth deformation of the tree, rms")
      ->check(cli::between(0.0, 100.0));
  command->addOption("--breath-mm", o->asked.run.breath_mm, "Amplitude of the shift from frame to frame")
      ->check(cli::between(0.0, 100.0));
  command->addOption("--beside-mm", o->asked.run.beside_mm, "How far the catheter lies beside the vessels' axes")
      ->check(cli::between(0.0, 20.0));
  command->addOption("--noise-px", o->asked.run.noise_px, "Of the curve's points, std of each coordinate")
      ->check(cli::between(0.0, 100.0));
  command->addOption("--out", o->out, "All results (.json)");
  o->campaign.addTo(*command);
  command->onChosen([o, &work, &campaigns] { work = [o, &campaigns] { return evaluateCatheterRuns(*o, campaigns); }; });
}

}  // namespace angio::apps
