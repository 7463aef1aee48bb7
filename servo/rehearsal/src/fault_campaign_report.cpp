// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/formatted.hpp"
#include "angio/evaluation/statistics.hpp"
#include "angio/rehearsal/fault_campaign.hpp"

namespace angio {
namespace {

using Json = nlohmann::ordered_json;

Json summaryOf(const std::vector<const FaultRow*>& rows, const char* name) {
  int unsafe = 0, unsound = 0, moved = 0, recovered = 0;
  std::vector<double> recovery_s, end_deg;
  for (const FaultRow* row : rows) {
    unsafe += row->breach.has_value();
    unsound += row->unsound_commands;
    moved += row->moved_before;
    recovered += row->recovered_s.has_value();
    if (row->recovered_s) recovery_s.push_back(*row->recovered_s);
    if (row->recovered_s) end_deg.push_back(radToDeg(row->error_at_end.direction_rad));
  }
  Json json = {{"fault", name},
               {"runs", rows.size()},
               {"servoed_before", moved},
               {"unsafe", unsafe},
               {"unsound_commands_at_the_machine", unsound},
               {"recovered", recovered}};
  if (recovery_s.empty()) return json;
  json["recovery_s"] = {{"p50", percentile(recovery_s, 0.5)}, {"max", percentile(recovery_s, 1)}};
  json["error_at_end_deg"] = {{"p50", percentile(end_deg, 0.5)}, {"max", percentile(end_deg, 1)}};
  return json;
}

}  // namespace

Json faultCampaignAsJson(const std::vector<FaultRow>& rows) {
  Json json;
  std::vector<const FaultRow*> all;
  for (const auto& row : rows) all.push_back(&row);
  json["all"] = summaryOf(all, "all");
  for (int kind = 0; kind < kFaultKindCount; ++kind) {
    std::vector<const FaultRow*> of_kind;
    for (const auto& row : rows) {
      if (static_cast<int>(row.kind) == kind) of_kind.push_back(&row);
    }
    if (!of_kind.empty()) json["faults"].push_back(summaryOf(of_kind, nameOf(static_cast<FaultKind>(kind))));
  }
  for (const auto& row : rows) {
    Json one = {{"seed", row.seed},
                {"fault", row.fault},
                {"servoed_before", row.moved_before},
                {"unsound_commands", row.unsound_commands},
                {"error_at_fault_deg", radToDeg(row.error_at_fault.direction_rad)},
                {"error_at_end_deg", radToDeg(row.error_at_end.direction_rad)},
                {"error_at_end_mm", 1e3 * row.error_at_end.target_m},
                {"changes", row.causes}};
    if (row.recovered_s) one["recovered_s"] = *row.recovered_s;
    if (row.breach) one["breach"] = *row.breach;
    json["each"].push_back(one);
  }
  return json;
}

std::string faultCampaignTable(const Json& j) {
  std::string table = formatted("%-14s %6s %8s %8s %9s %10s %18s %20s\n", "fault", "runs", "servoed", "unsafe",
                                "unsound", "recovered", "after [s]", "view error at end") +
                      formatted("%-14s %6s %8s %8s %9s %10s %18s %20s\n", "", "", "before", "motions", "commands", "",
                                "median, worst", "[deg] median, worst");
  const auto line = [&](const Json& row) {
    table += formatted("%-14s %6d %8d %8d %9d %10d", row["fault"].get<std::string>().c_str(), row["runs"].get<int>(),
                       row["servoed_before"].get<int>(), row["unsafe"].get<int>(),
                       row["unsound_commands_at_the_machine"].get<int>(), row["recovered"].get<int>());
    if (row.contains("recovery_s")) {
      table += formatted(" %8.2f, %8.2f %9.3f, %9.3f", row["recovery_s"]["p50"].get<double>(),
                         row["recovery_s"]["max"].get<double>(), row["error_at_end_deg"]["p50"].get<double>(),
                         row["error_at_end_deg"]["max"].get<double>());
    }
    table += "\n";
  };
  for (const Json& row : j["faults"]) line(row);
  line(j["all"]);
  for (const Json& row : j["each"]) {
    if (row.contains("breach")) {
      table += formatted("seed %d, %s: %s\n", row["seed"].get<int>(), row["fault"].get<std::string>().c_str(),
                         row["breach"].get<std::string>().c_str());
    }
  }
  return table;
}

}  // namespace angio
