// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/experiments/centre_experiment.hpp"

#include <random>

#include "angio/base/formatted.hpp"
#include "angio/evaluation/statistics.hpp"
#include "angio/experiments/limit_observer.hpp"

namespace angio::experiments {
namespace {

using Json = nlohmann::ordered_json;

// From the target to the heart, in units of its reach: there its motion is largest.
const Eigen::Vector3d kToHeart_lps = Eigen::Vector3d(0.4, -0.3, 1).normalized();

// The motion of which the target has the whole.
MotionSettings motionOf(const CenterExperimentSettings& experiment, MotionSettings motion, const VesselTree& tree,
                        const Eigen::Matrix3d& R_lps_model, const Eigen::Vector3d& target) {
  const Eigen::Vector3d from_centroid_mm = 1e3 * (R_lps_model * (target - tree.centroid()));
  motion.breathing.amplitude_mm = experiment.breathing_mm;
  motion.breathing.drift_mm_per_min = experiment.drift_mm_per_min;
  motion.breathing.diaphragm_mm = from_centroid_mm.z();
  motion.heartbeat.amplitude_mm = experiment.heartbeat_mm;
  Eigen::Map<Eigen::Vector3d>(motion.heartbeat.center_mm) = from_centroid_mm + motion.heartbeat.reach_mm * kToHeart_lps;
  return motion;
}

CenterErrors errorsOf(const ClosedLoopRun& run, const LimitObserver& limits, double learn_s) {
  CenterErrors errors;
  double sum = 0;
  int counted = 0;
  std::vector<double> answer_s;
  for (const ClosedLoopFrame& frame : run.closed) {
    ++errors.frames;
    errors.held += frame.hold_reason.has_value();
    answer_s.push_back(frame.answer_s);
    if (frame.time_s - run.closed.front().time_s < learn_s) continue;
    const double off_mm = 1e3 * frame.target_off_m;
    sum += off_mm * off_mm;
    errors.worst_mm = std::max(errors.worst_mm, off_mm);
    ++counted;
  }
  errors.rms_mm = std::sqrt(sum / std::max(counted, 1));
  errors.breach = limits.breach();
  errors.answer_p50_s = percentile(answer_s, 0.5);
  errors.answer_p99_s = percentile(answer_s, 0.99);
  return errors;
}

Json asJson(const CenterErrors& e) {
  Json json = {{"rms_mm", e.rms_mm}, {"worst_mm", e.worst_mm}, {"frames", e.frames}, {"held", e.held}};
  if (e.breach) json["breach"] = *e.breach;
  return json;
}

Json summaryOf(const std::vector<CenterResult>& rows, CenterErrors CenterResult::*which,
               const CenterExperimentSettings& experiment) {
  std::vector<double> rms, worst, p50, p99;
  double sum = 0;
  int succeeded = 0, breaches = 0, frames = 0, held = 0;
  for (const auto& row : rows) {
    const CenterErrors& e = row.*which;
    rms.push_back(e.rms_mm);
    worst.push_back(e.worst_mm);
    p50.push_back(e.answer_p50_s);
    p99.push_back(e.answer_p99_s);
    sum += e.rms_mm * e.rms_mm;
    succeeded += e.rms_mm <= experiment.within_mm;
    breaches += e.breach.has_value();
    frames += e.frames;
    held += e.held;
  }
  return {
      {"rms_mm", std::sqrt(sum / static_cast<double>(rows.size()))},
      {"rms_mm_of_runs", {{"p50", percentile(rms, 0.5)}, {"p95", percentile(rms, 0.95)}, {"max", percentile(rms, 1)}}},
      {"worst_mm", {{"p50", percentile(worst, 0.5)}, {"p95", percentile(worst, 0.95)}, {"max", percentile(worst, 1)}}},
      {"succeeded", succeeded},
      {"limits_exceeded", breaches},
      {"frames", frames},
      {"held", held},
      {"frame_to_command_ms", {{"p50", 1e3 * mean(p50)}, {"p99", 1e3 * mean(p99)}}}};
}

}  // namespace

CenterResult runCenterExperiment(const VesselTree& tree, const CArmCalibration& nominal,
                                 const CenterExperimentSettings& experiment, ScenarioSettings scenario,
                                 ServoLoopSettings parts, CenterTaskSettings center, SimulatedPatientSettings patient) {
  checkSettings("centre study", experiment);
  // Other numbers than those of the world of the same seed.
  std::mt19937_64 engine(static_cast<std::uint64_t>(scenario.seed) ^ 0x63656e74);
  const auto symmetric = [&] { return 2 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1; };
  CenterResult row;
  row.seed = scenario.seed;
  scenario.start_primary_deg = symmetric() * experiment.max_primary_deg;
  scenario.start_secondary_deg = symmetric() * experiment.max_secondary_deg;
  row.view = {degToRad(scenario.start_primary_deg), degToRad(scenario.start_secondary_deg)};
  row.target_model = tree.points().col(static_cast<Eigen::Index>(engine() % static_cast<std::uint64_t>(tree.size())));
  parts.target_model = row.target_model;
  patient.motion = motionOf(experiment, patient.motion, tree, nominal.R_lps_model, row.target_model);

  const Scenario world = randomScenario(tree, nominal, scenario, row.view);
  const auto run = [&](bool predict) {
    center.predict = predict;
    parts.task = center;
    LimitObserver limits(parts.limits);
    const ClosedLoopRun result =
        runClosedLoop(tree, world, scenario, parts, patient, {}, [&](const CArmState& s) { limits.see(s); });
    return errorsOf(result, limits, experiment.learn_s);
  };
  row.predicted = run(true);
  row.last_value = run(false);
  return row;
}

Json centerExperimentAsJson(const std::vector<CenterResult>& rows, const CenterExperimentSettings& experiment) {
  Json json;
  json["runs"] = rows.size();
  json["within_mm"] = experiment.within_mm;
  json["breathing_mm"] = experiment.breathing_mm;
  json["heartbeat_mm"] = experiment.heartbeat_mm;
  json["predicted"] = summaryOf(rows, &CenterResult::predicted, experiment);
  json["last_value"] = summaryOf(rows, &CenterResult::last_value, experiment);
  json["times_better"] = json["last_value"]["rms_mm"].get<double>() / json["predicted"]["rms_mm"].get<double>();
  for (const auto& row : rows) {
    json["each"].push_back(
        {{"seed", row.seed},
         {"view_deg", {radToDeg(row.view.primary_rad), radToDeg(row.view.secondary_rad)}},
         {"target_mm", {1e3 * row.target_model.x(), 1e3 * row.target_model.y(), 1e3 * row.target_model.z()}},
         {"predicted", asJson(row.predicted)},
         {"last_value", asJson(row.last_value)}});
  }
  return json;
}

std::string centerExperimentTable(const Json& j) {
  const Json &p = j["predicted"], &l = j["last_value"];
  std::string table = formatted(
      "centre: %d of %d runs keep the target within %g mm rms at the isocentre (breathing %g mm, heartbeat %g mm); "
      "limits exceeded in %d; %d of %d frames held\n\n",
      p["succeeded"].get<int>(), j["runs"].get<int>(), j["within_mm"].get<double>(), j["breathing_mm"].get<double>(),
      j["heartbeat_mm"].get<double>(), p["limits_exceeded"].get<int>(), p["held"].get<int>(), p["frames"].get<int>());
  table += formatted("%-34s %10s%10s%10s%10s\n", "distance at the isocentre [mm]", "rms", "median", "95 %", "worst");
  const auto line = [&](const char* name, double all, const Json& of) {
    return formatted("%-34s %10.3f%10.3f%10.3f%10.3f\n", name, all, of["p50"].get<double>(), of["p95"].get<double>(),
                     of["max"].get<double>());
  };
  table += line("rms of a run, predicted", p["rms_mm"].get<double>(), p["rms_mm_of_runs"]);
  table += line("rms of a run, last value", l["rms_mm"].get<double>(), l["rms_mm_of_runs"]);
  table += formatted("%-34s %10.2f\n", "times better", j["times_better"].get<double>());
  table += formatted("%-34s %10.1f (p99 %.1f)\n", "frame to command, wall time [ms]",
                     p["frame_to_command_ms"]["p50"].get<double>(), p["frame_to_command_ms"]["p99"].get<double>());
  return table;
}

}  // namespace angio::experiments
