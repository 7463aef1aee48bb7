// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/results/columns.hpp"
#include "catheter_results.hpp"

namespace angio::apps {
namespace {

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
  if (!frame.beside) return json;
  json["beside_in_90_percent"] = 100 * frame.beside->plane_in;
  json["beside_beyond_percent"] = 100 * frame.beside->beyond;
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
          {"", "depth_in_90_percent", "mean", valueOf("depth_in_90_percent")},
          {"", "beside_in_90_percent", "mean", valueOf("beside_in_90_percent")},
          {"", "beside_beyond_percent", "mean", valueOf("beside_beyond_percent")}};
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

}  // namespace

Json catheterRunsResults(const CatheterRunsAsked& asked, const Progress& progress) {
  if (asked.trees.empty()) throw InputError("", "trees", "", "must be at least one");
  if (asked.runs < 1) throw InputError("", "runs", std::to_string(asked.runs), "must be at least 1");
  std::vector<VesselTree> trees;
  std::vector<std::string> names;
  for (const auto& path : asked.trees) {
    trees.push_back(readVesselTree(path));
    names.push_back(std::filesystem::path(path).filename().string());
  }
  const auto treeOf = [&](int index) { return static_cast<std::size_t>(index) % trees.size(); };
  const auto one = [&](int index) {
    Json json = {{"tree", names[treeOf(index)]}, {"frames", Json::array()}};
    for (const CatheterRunFrame& frame : catheterRun(trees[treeOf(index)], asked.run, index)) {
      json["frames"].push_back(frameAsJson(frame));
    }
    return json;
  };
  const auto nameOf = [](int index) { return "run " + std::to_string(index); };
  Json json;
  json["runs"] = recordsOf(asked.campaign, asked.runs, 1, nameOf, one, progress);
  json["summary"] = summaryOfRuns(json["runs"]);
  return json;
}

}  // namespace angio::apps
