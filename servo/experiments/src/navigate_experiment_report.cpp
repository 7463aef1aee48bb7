// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>

#include "angio/base/formatted.hpp"
#include "angio/evaluation/statistics.hpp"
#include "angio/experiments/navigate_experiment.hpp"

namespace angio::experiments {
namespace {

using Json = nlohmann::ordered_json;

bool isNear(double error_m) { return error_m <= 1.5e-3; }

}  // namespace

Json navigateExperimentAsJson(const std::string& tree_name, const std::vector<NavigateResult>& rows) {
  Json json;
  std::vector<double> errors_mm, arcs_mm, times, contacts;
  int reached = 0, misses = 0, frames = 0, held = 0, breaches = 0, wrong = 0, believed = 0, near = 0, forks = 0,
      views = 0, looked = 0;
  double force = 0;
  Json each = Json::array();
  for (const NavigateResult& row : rows) {
    reached += row.reached;
    misses += row.misses;
    frames += row.frames;
    held += row.held;
    breaches += row.breach.has_value();
    wrong += row.wrong_chain;
    looked += row.looked;
    forks += row.forks;
    views += row.views;
    believed += static_cast<int>(row.errors_m.size());
    force = std::max(force, row.max_force_n);
    contacts.push_back(row.wall_contacts);
    times.push_back(row.time_s);
    for (const double e : row.errors_m) errors_mm.push_back(1e3 * e), near += isNear(e);
    for (const double e : row.arc_errors_m) arcs_mm.push_back(1e3 * e);
    each.push_back({{"seed", row.seed},
                    {"branch", row.target.chain},
                    {"into_branch_mm", 1e3 * row.target.arc_m},
                    {"reached", row.reached},
                    {"ended", row.ended},
                    {"time_s", row.time_s},
                    {"way_mm", 1e3 * row.route_m},
                    {"forks", row.forks},
                    {"misses", row.misses},
                    {"views", row.views},
                    {"wall_contacts", row.wall_contacts},
                    {"frames_with_catheter", row.looked},
                    {"believed", row.errors_m.size()},
                    {"within_1.5", std::count_if(row.errors_m.begin(), row.errors_m.end(), isNear)}});
  }
  json["tree"] = tree_name;
  json["targets"] = rows.size();
  json["reached"] = reached;
  json["forks"] = forks;
  json["misses"] = misses;
  json["views"] = views;
  json["wall_contacts"] = {{"median", percentile(contacts, 0.5)}, {"max", percentile(contacts, 1)}};
  json["max_force_n"] = force;
  json["time_s"] = {{"median", percentile(times, 0.5)}, {"max", percentile(times, 1)}};
  json["frames"] = frames;
  json["held"] = held;
  json["limits_exceeded"] = breaches;
  json["frames_with_catheter"] = looked;
  json["believed"] = believed;
  json["wrong_chain"] = wrong;
  json["tip_error_mm"] = {{"median", percentile(errors_mm, 0.5)},
                          {"p95", percentile(errors_mm, 0.95)},
                          {"within_1.5", believed > 0 ? static_cast<double>(near) / believed : 0.0}};
  json["along_vessel_mm"] = {{"median", percentile(arcs_mm, 0.5)}, {"p95", percentile(arcs_mm, 0.95)}};
  json["each"] = each;
  return json;
}

std::string navigateExperimentTable(const Json& trees) {
  std::string table = formatted("%-24s %9s %7s %7s %7s %16s %9s %20s %10s %10s %8s %7s %14s\n", "navigate", "reached",
                                "forks", "misses", "views", "wall contacts", "force", "tip error mm", "within",
                                "believed", "held", "limits", "time s");
  table +=
      formatted("%-24s %9s %7s %7s %7s %16s %9s %20s %10s %10s %8s %7s %14s\n", "", "", "", "", "", "median (most)",
                "most N", "median (95 %)", "1.5 mm", "frames", "frames", "broken", "median (most)");
  for (const Json& j : trees) {
    table += formatted(
        "%-24s %4d / %2d %7d %7d %7d %10.0f (%3.0f) %9.2f %12.2f (%5.2f) %8.1f %% %8.1f %% %6.1f %% %7d %7.0f "
        "(%4.0f)\n",
        j["tree"].get<std::string>().c_str(), j["reached"].get<int>(), j["targets"].get<int>(), j["forks"].get<int>(),
        j["misses"].get<int>(), j["views"].get<int>(), j["wall_contacts"]["median"].get<double>(),
        j["wall_contacts"]["max"].get<double>(), j["max_force_n"].get<double>(),
        j["tip_error_mm"]["median"].get<double>(), j["tip_error_mm"]["p95"].get<double>(),
        100 * j["tip_error_mm"]["within_1.5"].get<double>(),
        100.0 * j["believed"].get<int>() / std::max(1, j["frames_with_catheter"].get<int>()),
        100.0 * j["held"].get<int>() / std::max(1, j["frames"].get<int>()), j["limits_exceeded"].get<int>(),
        j["time_s"]["median"].get<double>(), j["time_s"]["max"].get<double>());
  }
  return table;
}

}  // namespace angio::experiments
