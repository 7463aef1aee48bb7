// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/rehearsal/centre_study.hpp"

#include <random>

#include "angio/base/formatted.hpp"
#include "angio/evaluation/statistics.hpp"
#include "angio/rehearsal/limit_observer.hpp"

namespace angio {
namespace {

using Json = nlohmann::ordered_json;

// From the target to the heart, in units of its reach: there its motion is largest.
const Eigen::Vector3d kToHeart_lps = Eigen::Vector3d(0.4, -0.3, 1).normalized();

// The motion of which the target has the whole.
MotionSettings motionOf(const CentreStudySettings& study, MotionSettings motion, const VesselTree& tree,
                        const Eigen::Matrix3d& R_lps_model, const Eigen::Vector3d& target) {
  const Eigen::Vector3d from_centroid_mm = 1e3 * (R_lps_model * (target - tree.centroid()));
  motion.breathing.amplitude_mm = study.breathing_mm;
  motion.breathing.drift_mm_per_min = study.drift_mm_per_min;
  motion.breathing.diaphragm_mm = from_centroid_mm.z();
  motion.heartbeat.amplitude_mm = study.heartbeat_mm;
  Eigen::Map<Eigen::Vector3d>(motion.heartbeat.centre_mm) = from_centroid_mm + motion.heartbeat.reach_mm * kToHeart_lps;
  return motion;
}

CentreErrors errorsOf(const Rehearsal& run, const LimitObserver& limits, double learn_s) {
  CentreErrors errors;
  double sum = 0;
  int counted = 0;
  std::vector<double> answer_s;
  for (const RehearsalFrame& frame : run.closed) {
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

Json asJson(const CentreErrors& e) {
  Json json = {{"rms_mm", e.rms_mm}, {"worst_mm", e.worst_mm}, {"frames", e.frames}, {"held", e.held}};
  if (e.breach) json["breach"] = *e.breach;
  return json;
}

Json summaryOf(const std::vector<CentreStudyRow>& rows, CentreErrors CentreStudyRow::*which,
               const CentreStudySettings& study) {
  std::vector<double> rms, worst, p50, p99;
  double sum = 0;
  int succeeded = 0, breaches = 0, frames = 0, held = 0;
  for (const auto& row : rows) {
    const CentreErrors& e = row.*which;
    rms.push_back(e.rms_mm);
    worst.push_back(e.worst_mm);
    p50.push_back(e.answer_p50_s);
    p99.push_back(e.answer_p99_s);
    sum += e.rms_mm * e.rms_mm;
    succeeded += e.rms_mm <= study.within_mm;
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

CentreStudyRow studyCentre(const VesselTree& tree, const CArmCalibration& nominal, const CentreStudySettings& study,
                           RehearsalSettings rehearsal, ServoLoopSettings parts, CentreTaskSettings centre,
                           SimulatedPatientSettings patient) {
  checkSettings("centre study", study);
  // Other numbers than those of the world of the same seed.
  std::mt19937_64 engine(static_cast<std::uint64_t>(rehearsal.seed) ^ 0x63656e74);
  const auto symmetric = [&] { return 2 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1; };
  CentreStudyRow row;
  row.seed = rehearsal.seed;
  rehearsal.start_primary_deg = symmetric() * study.most_primary_deg;
  rehearsal.start_secondary_deg = symmetric() * study.most_secondary_deg;
  row.view = {degToRad(rehearsal.start_primary_deg), degToRad(rehearsal.start_secondary_deg)};
  row.target_model = tree.points().col(static_cast<Eigen::Index>(engine() % static_cast<std::uint64_t>(tree.size())));
  parts.target_model = row.target_model;
  patient.motion = motionOf(study, patient.motion, tree, nominal.R_lps_model, row.target_model);

  const RehearsalWorld world = madeUpWorld(tree, nominal, rehearsal, row.view);
  const auto run = [&](bool predict) {
    centre.predict = predict;
    parts.task = centre;
    LimitObserver limits(parts.limits);
    const Rehearsal result =
        rehearse(tree, world, rehearsal, parts, patient, {}, [&](const CArmState& s) { limits.see(s); });
    return errorsOf(result, limits, study.learn_s);
  };
  row.predicted = run(true);
  row.last_value = run(false);
  return row;
}

Json centreStudyAsJson(const std::vector<CentreStudyRow>& rows, const CentreStudySettings& study) {
  Json json;
  json["runs"] = rows.size();
  json["within_mm"] = study.within_mm;
  json["breathing_mm"] = study.breathing_mm;
  json["heartbeat_mm"] = study.heartbeat_mm;
  json["predicted"] = summaryOf(rows, &CentreStudyRow::predicted, study);
  json["last_value"] = summaryOf(rows, &CentreStudyRow::last_value, study);
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

std::string centreStudyTable(const Json& j) {
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

}  // namespace angio
