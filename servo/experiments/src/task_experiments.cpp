// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/experiments/task_experiments.hpp"

#include <iterator>
#include <nlohmann/json.hpp>
#include <random>

#include "angio/base/errors.hpp"
#include "angio/experiments/observers.hpp"
#include "angio/results/columns.hpp"
#include "angio/robot/motion_time.hpp"

namespace angio::experiments {
namespace {

// A run succeeds when its view is reached, or when the target's rms distance from its pixel stays below this, at the
// isocentre.
constexpr double kCenterWithin_mm = 1;

constexpr double kDrift_mm_per_min = 3;

constexpr const char* kWorst = "p50 p95 max";

// A value of the runs' rows in the summary.
Column<Json> figures(const std::string& path, const std::string& summary, const std::string& names) {
  const Json::json_pointer at("/" + path);
  return {"", summary, names, [=](const Json& row) { return row.contains(at) ? row[at] : Json(nullptr); }};
}

// What all tasks' runs have, in the rows and in the summary below `under`.
std::vector<Column<Json>> loopColumns(const std::string& under) {
  return {figures(under + "frames", under + "frames", "sum"),
          figures(under + "held", under + "held", "sum"),
          figures(under + "succeeded", under + "succeeded", "sum"),
          figures(under + "limit_exceeded", under + "limits_exceeded", "sum"),
          figures(under + "frame_to_command_ms/p50", under + "frame_to_command_ms/p50", "mean"),
          figures(under + "frame_to_command_ms/p99", under + "frame_to_command_ms/p99", "mean")};
}

Json runOf(const std::vector<ClosedLoopFrame>& frames, const LimitObserver& limits) {
  Json answer_ms = Json::array();
  int held = 0;
  for (const ClosedLoopFrame& frame : frames) {
    held += frame.hold_reason.has_value();
    answer_ms.push_back(1e3 * frame.answer_s);  // Wall time from frame to command.
  }
  Json row = {{"frames", frames.size()}, {"held", held}, {"limit_exceeded", limits.breach().has_value()}};
  if (limits.breach()) row["breach"] = *limits.breach();
  row["frame_to_command_ms"] = figuresOf(answer_ms, "p50 p99");
  return row;
}

ClosedLoopRun watchedRun(const LoopParts& parts, const Scenario& world, LimitObserver& limits) {
  return runClosedLoop(parts.tree, world, parts.scenario, parts.loop, parts.patient, {},
                       [&](const CArmState& s) { limits.see(s); });
}

Json degrees(const ViewAngles& view) { return {radToDeg(view.primary_rad), radToDeg(view.secondary_rad)}; }

std::string spread(const std::string& path, const std::string& format) {
  std::string cells;
  for (const char* name : {"p50", "p95", "max"}) cells += "{" + path + "/" + name + ":" + format + "}";
  return cells;
}

Json runView(LoopParts parts) {
  // Other numbers than those of the world of the same seed.
  std::mt19937_64 engine(static_cast<std::uint64_t>(parts.scenario.seed) ^ 0x76696577);
  const auto [start, goal] = drawViews(engine, 45, 25, parts.scenario, parts.loop);
  LimitObserver limits(parts.loop.limits);
  const Scenario world = randomScenario(parts.tree, parts.nominal, parts.scenario, goal);
  const ClosedLoopRun run = watchedRun(parts, world, limits);
  const std::optional<double> settled_s = settlingTime_s(run);
  Json row = {{"seed", parts.scenario.seed},
              {"start_deg", degrees(start)},
              {"view_deg", degrees(goal)},
              {"error_deg", radToDeg(run.closed_end.direction_rad)},
              {"error_mm", 1e3 * run.closed_end.target_m},
              {"table_excursion_mm", 1e3 * run.max_table_excursion_m},
              {"target_excursion_mm", 1e3 * run.max_target_excursion_m},
              {"open_loop_error_deg", radToDeg(run.open_end.direction_rad)},
              {"open_loop_error_mm", 1e3 * run.open_end.target_m},
              {"succeeded", settled_s.has_value()}};
  row.update(runOf(run.closed, limits));
  // What the machine's limits allow at best, for the joints that it went by.
  row["min_s"] = minTime_s(run.closed.front().joints, run.closed.back().joints, parts.loop.limits);
  if (settled_s) row["settled_s"] = *settled_s;
  return row;
}

// From the target to the heart, in units of its reach: there its motion is largest.
const Eigen::Vector3d kToHeart_lps = Eigen::Vector3d(0.4, -0.3, 1).normalized();

// The motion of which the target has the whole.
MotionSettings motionOf(const CenterExperimentSettings& experiment, MotionSettings motion, const VesselTree& tree,
                        const Eigen::Matrix3d& R_lps_model, const Eigen::Vector3d& target) {
  const Eigen::Vector3d from_centroid_mm = 1e3 * (R_lps_model * (target - tree.centroid()));
  motion.breathing.amplitude_mm = experiment.breathing_mm;
  motion.breathing.drift_mm_per_min = kDrift_mm_per_min;
  motion.breathing.diaphragm_mm = from_centroid_mm.z();
  motion.heartbeat.amplitude_mm = experiment.heartbeat_mm;
  Eigen::Map<Eigen::Vector3d>(motion.heartbeat.center_mm) = from_centroid_mm + motion.heartbeat.reach_mm * kToHeart_lps;
  return motion;
}

// How near the target's image really was to the wanted pixel, as a distance at the isocentre.
Json errorsOf(const ClosedLoopRun& run, const LimitObserver& limits, double learn_s) {
  Json off_mm = Json::array();
  for (const ClosedLoopFrame& frame : run.closed) {
    if (frame.time_s - run.closed.front().time_s >= learn_s) off_mm.push_back(1e3 * frame.target_off_m);
  }
  const double rms_mm = off_mm.empty() ? 0 : figuresOf(off_mm, "rms").get<double>();
  Json row = {{"rms_mm", rms_mm}, {"worst_mm", figuresOf(off_mm, "max")}, {"succeeded", rms_mm <= kCenterWithin_mm}};
  row.update(runOf(run.closed, limits));
  return row;
}

Json runCenter(LoopParts parts, const CenterExperimentSettings& experiment, CenterTaskSettings center) {
  std::mt19937_64 engine(static_cast<std::uint64_t>(parts.scenario.seed) ^ 0x63656e74);
  const Eigen::Vector2d start_deg = drawnAngles_deg(engine, 30, 20);
  parts.scenario.start_primary_deg = start_deg[0];
  parts.scenario.start_secondary_deg = start_deg[1];
  const ViewAngles view{degToRad(start_deg[0]), degToRad(start_deg[1])};
  const auto points = static_cast<std::uint64_t>(parts.tree.size());
  const Eigen::Vector3d target = parts.tree.points().col(static_cast<Eigen::Index>(engine() % points));
  const Eigen::Vector3d target_mm = 1e3 * target;
  parts.loop.target_model = target;
  parts.patient.motion = motionOf(experiment, parts.patient.motion, parts.tree, parts.nominal.R_lps_model, target);
  const Scenario world = randomScenario(parts.tree, parts.nominal, parts.scenario, view);
  Json row = {{"seed", parts.scenario.seed},
              {"view_deg", degrees(view)},
              {"target_mm", {target_mm.x(), target_mm.y(), target_mm.z()}}};
  for (const auto& [name, predict] : {std::pair("predicted", true), std::pair("last_value", false)}) {
    center.predict = predict;
    parts.loop.task = center;
    LimitObserver limits(parts.loop.limits);
    row[name] = errorsOf(watchedRun(parts, world, limits), limits, experiment.learn_s);
  }
  return row;
}

// Of runs that other programs made: how each ended, "succeeded" below `under`.
void requireEnds(const std::vector<Json>& rows, const std::vector<std::string>& under) {
  for (const Json& row : rows) {
    for (const std::string& path : under) {
      const Json::json_pointer at(path + "/succeeded");
      if (!row.contains(at) || !row[at].is_boolean()) throw InputError("runs", "succeeded", "", "must be in each row");
    }
  }
}

LoopParts withScenario(const LoopParts& parts, const ScenarioSettings& scenario) {
  return {parts.tree, parts.nominal, scenario, parts.loop, parts.patient};
}

}  // namespace

Json viewExperiment(const LoopParts& parts, const Runs& runs) {
  const std::vector<Json> rows =
      runs.records(parts.scenario, [&](const ScenarioSettings& s) { return runView(withScenario(parts, s)); });
  requireEnds(rows, {""});
  std::vector<Json> settled;
  std::copy_if(rows.begin(), rows.end(), std::back_inserter(settled), [](const Json& r) { return r["succeeded"]; });
  Json json = {{"runs", rows.size()}, {"within", {{"view_deg", kViewWithin_deg}, {"target_mm", kViewWithin_mm}}}};
  summarise(rows, loopColumns(""), json);
  summarise(rows,
            {figures("error_deg", "view_deg", kWorst), figures("error_mm", "target_mm", kWorst),
             figures("open_loop_error_deg", "open_loop_view_deg", kWorst),
             figures("open_loop_error_mm", "open_loop_target_mm", kWorst),
             figures("table_excursion_mm", "table_excursion_mm", kWorst),
             figures("target_excursion_mm", "target_excursion_mm", kWorst), figures("settled_s", "settling_s", kWorst)},
            json);
  summarise(settled, {figures("min_s", "min_possible_s", kWorst)}, json);
  json["each"] = rows;
  return json;
}

std::string viewExperimentTable(const Json& summary) {
  const auto closedAndOpen = [](const std::string& path, const char* format) {
    return spread(path, format) + spread("open_loop_" + path, format) + "\n";
  };
  const std::string table =
      "view: {succeeded:%d} of {runs:%d} runs end and stay within {within/view_deg:%g} deg and "
      "{within/target_mm:%g} mm; limits exceeded in {limits_exceeded:%d}; {held:%d} of {frames:%d} frames held\n\n"
      "                                       median      95 %     worst    median      95 %     worst\n"
      "true error at the end                                 closed loop                     open loop\n"
      "view [deg]                         " +
      closedAndOpen("view_deg", "%10.4f") + "target [mm]                        " +
      closedAndOpen("target_mm", "%10.3f") +
      "                                                          servoed    the machine's limits allow\n"
      "settling time [s]                  " +
      spread("settling_s", "%10.2f") + spread("min_possible_s", "%10.2f") + "\ntable outside start and goal [mm]   " +
      spread("table_excursion_mm", "%10.2f") + "\ntarget further than at start [mm]  " +
      spread("target_excursion_mm", "%10.2f") +
      "\nframe to command, wall time [ms]   {frame_to_command_ms/p50:%10.1f} (p99 {frame_to_command_ms/p99:%.1f})\n";
  return filled(table, summary);
}

Json centerExperiment(const LoopParts& parts, const CenterExperimentSettings& experiment,
                      const CenterTaskSettings& center, const Runs& runs) {
  checkSettings("centre study", experiment);
  const std::vector<Json> rows = runs.records(
      parts.scenario, [&](const ScenarioSettings& s) { return runCenter(withScenario(parts, s), experiment, center); });
  requireEnds(rows, {"/predicted", "/last_value"});
  Json json = {{"runs", rows.size()},
               {"within_mm", kCenterWithin_mm},
               {"breathing_mm", experiment.breathing_mm},
               {"heartbeat_mm", experiment.heartbeat_mm}};
  for (const std::string under : {"predicted/", "last_value/"}) {
    summarise(rows,
              {figures(under + "rms_mm", under + "rms_mm", "rms"),
               figures(under + "rms_mm", under + "rms_mm_of_runs", kWorst),
               figures(under + "worst_mm", under + "worst_mm", kWorst)},
              json);
    summarise(rows, loopColumns(under), json);
  }
  json["times_better"] = json["last_value"]["rms_mm"].get<double>() / json["predicted"]["rms_mm"].get<double>();
  json["each"] = rows;
  return json;
}

std::string centerExperimentTable(const Json& summary) {
  const auto line = [](const std::string& law) {
    return "{" + law + "/rms_mm:%10.3f}" + spread(law + "/rms_mm_of_runs", "%10.3f") + "\n";
  };
  const std::string table =
      "centre: {predicted/succeeded:%d} of {runs:%d} runs keep the target within {within_mm:%g} mm rms at the "
      "isocentre (breathing {breathing_mm:%g} mm, heartbeat {heartbeat_mm:%g} mm); limits exceeded in "
      "{predicted/limits_exceeded:%d}; {predicted/held:%d} of {predicted/frames:%d} frames held\n\n"
      "distance at the isocentre [mm]            rms    median      95 %     worst\n"
      "rms of a run, predicted            " +
      line("predicted") + "rms of a run, last value           " + line("last_value") +
      "times better                       {times_better:%10.2f}\n"
      "frame to command, wall time [ms]   {predicted/frame_to_command_ms/p50:%10.1f} "
      "(p99 {predicted/frame_to_command_ms/p99:%.1f})\n";
  return filled(table, summary);
}

}  // namespace angio::experiments
