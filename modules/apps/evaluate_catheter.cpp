// SPDX-License-Identifier: GPL-2.0-or-later
// angio-evaluate catheter: where a catheter's tip is in the tree, frame by frame of a sequence.
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "angio/base/formatted.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/results/columns.hpp"
#include "catheter_results.hpp"
#include "catheter_sheet.hpp"
#include "evaluate.hpp"

namespace angio::apps {
namespace {

struct CatheterOptions {
  CampaignOptions campaign;
  std::string cases, settings, out, sheet;
  CatheterSequenceAsked asked;
  int columns = 8, side_px = 240;
};

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

int evaluateCatheter(const CatheterOptions& o, const CaseSet& set, CatheterSequenceAsked asked,
                     const CampaignRun& run) {
  asked.campaign = run.rows;
  cv::Mat sheet;
  const auto look_on = [&](int way, const CatheterRoute& route) {
    if (way == 0 && !o.sheet.empty()) {
      sheet = catheterSheet(route, catheterFrames(set, asked), set, o.columns, o.side_px);
    }
  };
  ProgressBar bar("localising", run.share(kCatheterWays));
  Json json = catheterSequenceResults(set, asked, look_on, [&](int done) { bar.show(done); });
  if (!run.done()) return 0;
  for (Json& way : json["ways"]) way = run.shown(way);
  const std::string text = catheterReport(json["ways"]);
  if (!o.sheet.empty()) writeImage(o.sheet, sheet);
  return reported(std::move(json), o.out, text, run.machine);
}

int evaluateCatheter(const CatheterOptions& o, const Campaigns& campaigns) {
  requireFolderOf(o.out);
  requireImagePath(o.sheet);
  CatheterSequenceAsked asked = o.asked;
  if (!o.settings.empty()) asked.settings = readSettings(o.settings, asked.settings);
  const CaseSet set = readCaseSet(o.cases);
  CampaignJob job{o.campaign, o.out, kCatheterWays, {}, [&](const CampaignRun& run) {
                    return evaluateCatheter(o, set, asked, run);
                  }};
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
  command->addOption("--period-s", o->asked.period_s, "From frame to frame [s]")->check(cli::between(0.001, 100.0));
  command
      ->addOption("--learn-frames", o->asked.learn_frames,
                  "Of the run frame by frame: these come first, to learn the pose from")
      ->check(cli::wholeBetween(1, 100000));
  command->addFlag("--rigid", o->asked.rigid, "The vessels are where the tree has them, but for one pose");
  addSettingsOptions(*command, o->settings, "Settings (.yaml), sections sequence and catheter",
                     settingsInForce<CatheterSequenceSettings>);
  command->addOption("--out", o->out, "All results (.json)");
  auto* sheet = command->addOption("--sheet", o->sheet, "Picture of all frames (.png, .jpg)");
  command->addOption("--columns", o->columns, "Of the sheet")->check(cli::wholeBetween(1, 100));
  command->addOption("--side-px", o->side_px, "Width of each picture on it")->check(cli::wholeBetween(50, 2000));
  o->campaign.addTo(*command, {sheet});
  command->onChosen([o, &work, &campaigns] { work = [o, &campaigns] { return evaluateCatheter(*o, campaigns); }; });
}

}  // namespace angio::apps
