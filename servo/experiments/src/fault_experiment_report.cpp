// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/formatted.hpp"
#include "angio/evaluation/statistics.hpp"
#include "angio/experiments/fault_experiment.hpp"

namespace angio::experiments {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kMachineNames[] = {"carm", "catheter"};

Json summaryOf(const std::vector<const FaultResult*>& rows, const char* machine, const char* name) {
  int unsafe = 0, unsound = 0, moved = 0, recovered = 0;
  std::vector<double> recovery_s, end;
  for (const FaultResult* row : rows) {
    unsafe += row->breach.has_value();
    unsound += row->unsound_commands;
    moved += row->moved_before;
    recovered += row->recovered_s.has_value();
    if (row->recovered_s) recovery_s.push_back(*row->recovered_s);
    if (row->recovered_s) end.push_back(row->error_at_end);
  }
  Json json = {{"machine", machine},      {"fault", name},    {"runs", rows.size()},
               {"servoed_before", moved}, {"unsafe", unsafe}, {"unsound_commands_at_the_machine", unsound},
               {"recovered", recovered}};
  if (recovery_s.empty()) return json;
  json["recovery_s"] = {{"p50", percentile(recovery_s, 0.5)}, {"max", percentile(recovery_s, 1)}};
  json["error_at_end"] = {{"p50", percentile(end, 0.5)}, {"max", percentile(end, 1)}};
  return json;
}

}  // namespace

Json faultExperimentAsJson(const std::vector<FaultResult>& rows) {
  Json json;
  int unsafe = 0;
  for (const auto& row : rows) unsafe += row.breach.has_value();
  json["unsafe"] = unsafe;
  for (const auto machine : {OperatedMachine::kCArm, OperatedMachine::kCatheter}) {
    const char* name = kMachineNames[static_cast<int>(machine)];
    std::vector<const FaultResult*> all, of_kind[kFaultKindCount];
    for (const auto& row : rows) {
      if (row.machine != machine) continue;
      all.push_back(&row);
      of_kind[static_cast<int>(row.kind)].push_back(&row);
    }
    for (int kind = 0; kind < kFaultKindCount; ++kind) {
      if (of_kind[kind].empty()) continue;
      json["faults"].push_back(summaryOf(of_kind[kind], name, nameOf(static_cast<FaultKind>(kind))));
    }
    if (!all.empty()) json["faults"].push_back(summaryOf(all, name, "all"));
  }
  for (const auto& row : rows) {
    Json one = {{"machine", kMachineNames[static_cast<int>(row.machine)]},
                {"seed", row.seed},
                {"fault", row.fault},
                {"servoed_before", row.moved_before},
                {"unsound_commands", row.unsound_commands},
                {"error_at_fault", row.error_at_fault},
                {"error_at_end", row.error_at_end},
                {"changes", row.causes}};
    if (row.recovered_s) one["recovered_s"] = *row.recovered_s;
    if (row.breach) one["breach"] = *row.breach;
    json["each"].push_back(one);
  }
  return json;
}

std::string faultExperimentTable(const Json& j) {
  std::string table = formatted("%-9s %-17s %6s %8s %8s %9s %10s %18s %20s\n", "machine", "fault", "runs", "servoed",
                                "unsafe", "unsound", "recovered", "after [s]", "error at end") +
                      formatted("%-9s %-17s %6s %8s %8s %9s %10s %18s %20s\n", "", "", "", "before", "motions",
                                "commands", "", "median, worst", "median, worst");
  const auto line = [&](const Json& row) {
    table += formatted("%-9s %-17s %6d %8d %8d %9d %10d", row["machine"].get<std::string>().c_str(),
                       row["fault"].get<std::string>().c_str(), row["runs"].get<int>(),
                       row["servoed_before"].get<int>(), row["unsafe"].get<int>(),
                       row["unsound_commands_at_the_machine"].get<int>(), row["recovered"].get<int>());
    if (row.contains("recovery_s")) {
      table += formatted(" %8.2f, %8.2f %9.3f, %9.3f", row["recovery_s"]["p50"].get<double>(),
                         row["recovery_s"]["max"].get<double>(), row["error_at_end"]["p50"].get<double>(),
                         row["error_at_end"]["max"].get<double>());
    }
    table += "\n";
  };
  for (const Json& row : j["faults"]) line(row);
  table += "error: of the C-arm's view [deg], of the catheter's tip [mm]\n";
  for (const Json& row : j["each"]) {
    if (row.contains("breach")) {
      table += formatted("%s, seed %d, %s: %s\n", row["machine"].get<std::string>().c_str(), row["seed"].get<int>(),
                         row["fault"].get<std::string>().c_str(), row["breach"].get<std::string>().c_str());
    }
  }
  return table;
}

}  // namespace angio::experiments
