// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/experiments/view_experiment.hpp"

#include <random>

#include "angio/base/formatted.hpp"
#include "angio/evaluation/statistics.hpp"
#include "angio/experiments/limit_observer.hpp"
#include "angio/robot/motion_time.hpp"

namespace angio::experiments {
namespace {

using Json = nlohmann::ordered_json;

ViewAngles randomView(std::mt19937_64& engine, const ViewExperimentSettings& s) {
  const auto symmetric = [&] { return 2 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1; };
  const double primary = symmetric() * s.max_primary_deg;
  return {degToRad(primary), degToRad(symmetric() * s.max_secondary_deg)};
}

bool within(const ViewError& e, const ViewExperimentSettings& s) {
  return radToDeg(e.direction_rad) <= s.within_deg && 1e3 * e.target_m <= s.within_mm;
}

std::vector<double> of(const std::vector<ViewResult>& rows, const std::function<double(const ViewResult&)>& value) {
  std::vector<double> values;
  for (const auto& row : rows) values.push_back(value(row));
  return values;
}

Json spread(const std::vector<double>& values) {
  return {{"p50", percentile(values, 0.5)}, {"p95", percentile(values, 0.95)}, {"max", percentile(values, 1)}};
}

}  // namespace

ViewResult runViewExperiment(const VesselTree& tree, const CArmCalibration& nominal,
                             const ViewExperimentSettings& experiment, ScenarioSettings scenario,
                             ServoLoopSettings parts, const SimulatedPatientSettings& patient) {
  // Other numbers than those of the world of the same seed.
  std::mt19937_64 engine(static_cast<std::uint64_t>(scenario.seed) ^ 0x76696577);
  ViewResult row;
  row.seed = scenario.seed;
  row.start = randomView(engine, experiment);
  row.goal = randomView(engine, experiment);
  scenario.start_primary_deg = radToDeg(row.start.primary_rad);
  scenario.start_secondary_deg = radToDeg(row.start.secondary_rad);
  ViewTaskSettings view;
  view.primary_deg = radToDeg(row.goal.primary_rad);
  view.secondary_deg = radToDeg(row.goal.secondary_rad);
  parts.task = view;

  LimitObserver limits(parts.limits);
  const Scenario world = randomScenario(tree, nominal, scenario, row.goal);
  const ClosedLoopRun run =
      runClosedLoop(tree, world, scenario, parts, patient, {}, [&](const CArmState& s) { limits.see(s); });
  row.end = run.closed_end;
  row.open_end = run.open_end;
  row.breach = limits.breach();
  std::vector<double> answer_s;
  for (const auto& frame : run.closed) {
    row.held += frame.hold_reason.has_value();
    answer_s.push_back(frame.answer_s);
    if (!within(frame.true_error, experiment))
      row.settled_s.reset();
    else if (!row.settled_s)
      row.settled_s = frame.time_s - run.closed.front().time_s;
  }
  if (!within(run.closed_end, experiment)) row.settled_s.reset();
  row.frames = static_cast<int>(run.closed.size());
  row.min_s = minTime_s(run.closed.front().joints, run.closed.back().joints, parts.limits);
  row.answer_p50_s = percentile(answer_s, 0.5);
  row.answer_p99_s = percentile(answer_s, 0.99);
  return row;
}

Json viewExperimentAsJson(const std::vector<ViewResult>& rows, const ViewExperimentSettings& experiment) {
  Json json;
  std::vector<double> settled, shortest, ratio;
  int succeeded = 0, breaches = 0, frames = 0, held = 0;
  for (const auto& row : rows) {
    succeeded += row.settled_s.has_value();
    breaches += row.breach.has_value();
    frames += row.frames;
    held += row.held;
    if (!row.settled_s) continue;
    settled.push_back(*row.settled_s);
    shortest.push_back(row.min_s);
  }
  json["runs"] = rows.size();
  json["succeeded"] = succeeded;
  json["limits_exceeded"] = breaches;
  json["frames"] = frames;
  json["held"] = held;
  json["within"] = {{"view_deg", experiment.within_deg}, {"target_mm", experiment.within_mm}};
  json["view_deg"] = spread(of(rows, [](const auto& r) { return radToDeg(r.end.direction_rad); }));
  json["target_mm"] = spread(of(rows, [](const auto& r) { return 1e3 * r.end.target_m; }));
  json["open_loop_view_deg"] = spread(of(rows, [](const auto& r) { return radToDeg(r.open_end.direction_rad); }));
  json["open_loop_target_mm"] = spread(of(rows, [](const auto& r) { return 1e3 * r.open_end.target_m; }));
  json["settling_s"] = spread(settled);
  json["min_possible_s"] = spread(shortest);
  json["frame_to_command_ms"] = {{"p50", 1e3 * mean(of(rows, [](const auto& r) { return r.answer_p50_s; }))},
                                 {"p99", 1e3 * mean(of(rows, [](const auto& r) { return r.answer_p99_s; }))}};
  for (const auto& row : rows) {
    Json one = {{"seed", row.seed},
                {"start_deg", {radToDeg(row.start.primary_rad), radToDeg(row.start.secondary_rad)}},
                {"view_deg", {radToDeg(row.goal.primary_rad), radToDeg(row.goal.secondary_rad)}},
                {"error_deg", radToDeg(row.end.direction_rad)},
                {"error_mm", 1e3 * row.end.target_m},
                {"held", row.held},
                {"min_s", row.min_s}};
    if (row.settled_s) one["settled_s"] = *row.settled_s;
    if (row.breach) one["breach"] = *row.breach;
    json["each"].push_back(one);
  }
  return json;
}

std::string viewExperimentTable(const Json& j) {
  const auto line = [&](const char* name, const Json& closed, const Json& open, const char* format) {
    return formatted("%-34s ", name) +
           formatted(format, closed["p50"].get<double>(), closed["p95"].get<double>(), closed["max"].get<double>()) +
           formatted(format, open["p50"].get<double>(), open["p95"].get<double>(), open["max"].get<double>()) + "\n";
  };
  std::string table = formatted(
      "view: %d of %d runs end and stay within %g deg and %g mm; limits exceeded in %d; %d of %d frames held\n\n",
      j["succeeded"].get<int>(), j["runs"].get<int>(), j["within"]["view_deg"].get<double>(),
      j["within"]["target_mm"].get<double>(), j["limits_exceeded"].get<int>(), j["held"].get<int>(),
      j["frames"].get<int>());
  table += formatted("%-34s %10s%10s%10s%10s%10s%10s\n", "", "median", "95 %", "worst", "median", "95 %", "worst");
  table += formatted("%-34s %30s%30s\n", "true error at the end", "closed loop", "open loop");
  table += line("view [deg]", j["view_deg"], j["open_loop_view_deg"], "%10.4f%10.4f%10.4f");
  table += line("target [mm]", j["target_mm"], j["open_loop_target_mm"], "%10.3f%10.3f%10.3f");
  table += formatted("%-34s %30s%30s\n", "", "servoed", "the machine's limits allow");
  table += line("settling time [s]", j["settling_s"], j["min_possible_s"], "%10.2f%10.2f%10.2f");
  table += formatted("%-34s %10.1f (p99 %.1f)\n", "frame to command, wall time [ms]",
                     j["frame_to_command_ms"]["p50"].get<double>(), j["frame_to_command_ms"]["p99"].get<double>());
  return table;
}

}  // namespace angio::experiments
