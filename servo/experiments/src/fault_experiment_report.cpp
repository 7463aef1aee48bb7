// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <nlohmann/json.hpp>

#include "angio/experiments/fault_experiment.hpp"
#include "angio/results/columns.hpp"
#include "angio/results/experiment.hpp"

namespace angio::experiments {
namespace {

const char* machineName(OperatedMachine machine) { return machine == OperatedMachine::kCArm ? "carm" : "catheter"; }

const std::vector<Column<FaultResult>>& faultColumns() {
  using R = const FaultResult&;
  static const std::vector<Column<FaultResult>> kColumns = {
      {"machine", "", "", [](R r) { return machineName(r.machine); }},
      {"seed", "", "", [](R r) { return r.seed; }},
      {"fault", "", "", [](R r) { return r.fault; }},
      {"servoed_before", "servoed_before", "sum", [](R r) { return r.moved_before; }},
      {"", "unsafe", "sum", [](R r) { return r.breach.has_value(); }},
      {"unsound_commands", "unsound_commands_at_the_machine", "sum", [](R r) { return r.unsound_commands; }},
      {"error_at_fault", "", "", [](R r) { return orNull(r.error_at_fault); }},
      {"error_at_end", "", "", [](R r) { return orNull(r.error_at_end); }},
      {"changes", "", "", [](R r) { return r.causes; }},
      {"", "recovered", "sum", [](R r) { return r.recovered_s.has_value(); }},
      {"recovered_s", "recovery_s", "p50 max", [](R r) { return orNull(r.recovered_s); }},
      {"", "error_at_end", "p50 max", [](R r) { return r.recovered_s ? orNull(r.error_at_end) : Json(); }},
      {"breach", "", "", [](R r) { return orNull(r.breach); }}};
  return kColumns;
}

Json summaryOf(const std::vector<FaultResult>& rows, const char* machine, const char* fault) {
  Json json = {{"machine", machine}, {"fault", fault}, {"runs", rows.size()}};
  summarise(rows, faultColumns(), json);
  if (json["recovered"] == 0) json.erase("recovery_s");
  const auto known = [](const FaultResult& r) { return r.recovered_s && r.error_at_end; };
  if (std::none_of(rows.begin(), rows.end(), known)) json.erase("error_at_end");
  return json;
}

}  // namespace

Json faultExperimentAsJson(const std::vector<FaultResult>& rows) {
  Json json = {{"unsafe", 0}, {"faults", Json::array()}};
  for (const auto machine : {OperatedMachine::kCArm, OperatedMachine::kCatheter}) {
    std::vector<FaultResult> all, of_kind[kFaultKindCount];
    for (const auto& row : rows) {
      if (row.machine != machine) continue;
      all.push_back(row);
      of_kind[static_cast<int>(row.kind)].push_back(row);
    }
    for (const auto& some : of_kind) {
      if (!some.empty()) json["faults"].push_back(summaryOf(some, machineName(machine), nameOf(some.front().kind)));
    }
    if (all.empty()) continue;
    json["faults"].push_back(summaryOf(all, machineName(machine), "all"));
    json["unsafe"] = json["unsafe"].get<int>() + json["faults"].back()["unsafe"].get<int>();
  }
  json["each"] = rowsOf(rows, faultColumns());
  return json;
}

std::string faultExperimentTable(const Json& summary) {
  std::string table =
      "machine   fault               runs  servoed   unsafe   unsound  recovered          after [s]         error at "
      "end\n"
      "                                     before  motions  commands                 median, worst        median, "
      "worst\n";
  for (const Json& row : summary["faults"]) {
    table += filled(
        "{machine:%-9s} {fault:%-17s} {runs:%6d} {servoed_before:%8d} {unsafe:%8d} "
        "{unsound_commands_at_the_machine:%9d} {recovered:%10d}",
        row);
    if (row.contains("recovery_s")) {
      table += filled(
          " {recovery_s/p50:%8.2f}, {recovery_s/max:%8.2f} {error_at_end/p50:%9.3f}, "
          "{error_at_end/max:%9.3f}",
          row);
    }
    table += "\n";
  }
  table += "error: of the C-arm's view [deg], of the catheter's tip [mm]\n";
  for (const Json& row : summary["each"]) {
    if (row.contains("breach")) table += filled("{machine:%s}, seed {seed:%d}, {fault:%s}: {breach:%s}\n", row);
  }
  return table;
}

}  // namespace angio::experiments
