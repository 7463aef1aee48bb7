// SPDX-License-Identifier: GPL-2.0-or-later
#include <fstream>
#include <thread>

#include "angio/evaluation/case_run.hpp"
#include "angio/evaluation/statistics.hpp"
#include "outcome_figures.hpp"

namespace angio::evaluation {
namespace {

using Json = nlohmann::ordered_json;

// Thresholds of the trade: method names them in the keys.
constexpr double kGrossFailurePx = 5, kPoseOk_deg = 0.1, kPoseOk_mm = 1;

bool converged(const CaseOutcome& o) { return o.result.status == RegistrationStatus::kConverged; }

Json timesOf(const CaseOutcome& o) {
  const auto& t = o.result.times;
  return {{"image", 1e3 * o.image_s},
          {"prepare", 1e3 * t.prepare_s},
          {"rigid", 1e3 * t.rigid_s},
          {"nonrigid", 1e3 * t.nonrigid_s},
          {"total", 1e3 * (o.image_s + t.total_s)}};
}

Json errorAsJson(const PoseError& e) {
  return {{"mtre_mm", 1e3 * e.mtre_m},
          {"depth_mm", 1e3 * e.depth_m},
          {"in_plane_mm", 1e3 * e.in_plane_m},
          {"mpd_px", e.mpd_px ? Json(*e.mpd_px) : Json(nullptr)},
          {"mpd_isocentre_mm", e.mpd_isocenter_m ? Json(1e3 * *e.mpd_isocenter_m) : Json(nullptr)},
          {"rotation_deg", radToDeg(e.rotation_rad)},
          {"centroid_mm", 1e3 * e.centroid_m}};
}

}  // namespace

Json caseAsJson(const CaseOutcome& outcome) {
  const RegistrationResult& r = outcome.result;
  Json json;
  json["status"] = statusName(r.status);
  json["reason"] = r.reason;
  if (outcome.followed) json["followed"] = *outcome.followed;
  if (outcome.rejection) json["rejection"] = *outcome.rejection;
  for (int i = 0; i < 9; ++i) json["rotation"].push_back(r.T_camera_model.linear()(i / 3, i % 3));
  for (int i = 0; i < 3; ++i) json["translation_mm"].push_back(1e3 * r.T_camera_model.translation()[i]);
  json["covariance"] = nullptr;
  if (r.covariance) {
    json["covariance"] = Json::array();
    for (int i = 0; i < 36; ++i) json["covariance"].push_back((*r.covariance)(i / 6, i % 6));
  }
  json["ambiguity"] = r.ambiguity ? Json(*r.ambiguity) : Json(nullptr);
  json["mean_projection_residual_px"] = r.agreement.model_residual_px;
  json["rms_projection_residual_px"] = r.agreement.model_rms_px;
  json["mean_image_residual_px"] = r.agreement.image_residual_px;
  json["model_explained"] = r.agreement.model_explained;
  json["image_explained"] = r.agreement.image_explained;
  if (r.displacements_m.cols() > 0) {
    for (Eigen::Index i = 0; i < r.displacements_m.cols(); ++i) {
      const Eigen::Vector3d d = 1e3 * r.displacements_m.col(i);
      json["displacements_mm"].push_back({d.x(), d.y(), d.z()});
    }
  }
  json["points_3d"] = r.points_3d;
  json["points_2d"] = r.points_2d;
  json["iterations"] = {{"rigid", r.rigid_iterations}, {"nonrigid", r.nonrigid_iterations}};
  json["time_ms"] = timesOf(outcome);
  if (outcome.start_error) json["start_error"] = errorAsJson(*outcome.start_error);
  if (outcome.error) json["error"] = errorAsJson(*outcome.error);
  return json;
}

Json summaryOf(const std::vector<CaseOutcome>& all) {
  Json summary;
  summary["cases"] = all.size();
  for (const auto status : {RegistrationStatus::kConverged, RegistrationStatus::kAmbiguous,
                            RegistrationStatus::kDiverged, RegistrationStatus::kTooFewPoints}) {
    int count = 0;
    for (const auto& o : all) count += o.result.status == status;
    summary["status"][statusName(status)] = count;
  }
  // A case with too few points has no residual.
  std::vector<CaseOutcome> outcomes;
  for (const auto& o : all) {
    if (o.result.status != RegistrationStatus::kTooFewPoints) outcomes.push_back(o);
  }
  summary["mean_projection_residual_px"] =
      spreadOf(outcomes, [](const CaseOutcome& o) { return o.result.agreement.model_residual_px; });
  summary["mean_image_residual_px"] =
      spreadOf(outcomes, [](const CaseOutcome& o) { return o.result.agreement.image_residual_px; });
  summary["rms_projection_residual_isocentre_mm"] = spreadOf(
      outcomes, [](const CaseOutcome& o) { return 1e3 * o.pixel_at_isocenter_m * o.result.agreement.model_rms_px; });
  summary["gfr_nearest_5px_percent"] =
      percentOf(outcomes, [](const CaseOutcome& o) { return o.result.agreement.model_residual_px > kGrossFailurePx; });
  summary["time_ms"]["rigid"] = spreadOf(outcomes, [](const CaseOutcome& o) { return 1e3 * o.result.times.rigid_s; });
  summary["time_ms"]["nonrigid"] =
      spreadOf(outcomes, [](const CaseOutcome& o) { return 1e3 * o.result.times.nonrigid_s; });
  const auto totals =
      figuresOf(outcomes, [](const CaseOutcome& o) { return 1e3 * (o.image_s + o.result.times.total_s); });
  summary["time_ms"]["total"] = {
      {"p50", percentile(totals, 0.5)}, {"p99", percentile(totals, 0.99)}, {"max", percentile(totals, 1)}};

  // Against the truth every case counts: one without an answer has failed, and stands where it began.
  std::vector<CaseOutcome> known;
  std::vector<double> mpd_px;
  for (const auto& o : all) {
    if (!o.error) continue;
    known.push_back(o);
    if (o.error->mpd_px) mpd_px.push_back(*o.error->mpd_px);
  }
  if (known.empty()) return summary;
  summary["cases_with_truth"] = known.size();
  summary["mtre_mm"] = spreadOf(known, [](const CaseOutcome& o) { return 1e3 * o.error->mtre_m; });
  summary["mpd_px"] = spreadOf(mpd_px);
  summary["rotation_deg"] = spreadOf(known, [](const CaseOutcome& o) { return radToDeg(o.error->rotation_rad); });
  summary["centroid_mm"] = spreadOf(known, [](const CaseOutcome& o) { return 1e3 * o.error->centroid_m; });
  summary["gfr_true_5px_percent"] =
      percentOf(known, [](const CaseOutcome& o) { return !(o.error->mpd_px && *o.error->mpd_px <= kGrossFailurePx); });
  summary["success_mtre_2mm_percent"] =
      percentOf(known, [](const CaseOutcome& o) { return o.error->mtre_m < kSuccessMtre_m; });
  summary["pose_ok_percent"] = percentOf(known, [](const CaseOutcome& o) {
    return radToDeg(o.error->rotation_rad) < kPoseOk_deg && 1e3 * o.error->centroid_m < kPoseOk_mm;
  });
  summary["failed_and_noticed_percent"] =
      percentOf(known, [](const CaseOutcome& o) { return !(o.error->mtre_m < kSuccessMtre_m) && !converged(o); });
  summary["failed_and_trusted_percent"] =
      percentOf(known, [](const CaseOutcome& o) { return !(o.error->mtre_m < kSuccessMtre_m) && converged(o); });
  return summary;
}

std::string summaryTable(const Json& summary_by_method) {
  std::vector<std::vector<std::string>> rows{{"method", "converged", "nearest residual: model [px]", "image [px]",
                                              "true projection [px]", "pose error", "pose ok", "GFR > 5 px (true)",
                                              "failed unnoticed", "ms"}};
  for (const auto& [method, s] : summary_by_method.items()) {
    rows.push_back(
        {method, figureOf(s, "status/converged", "%.0f") + " of " + figureOf(s, "cases", "%.0f"),
         figureOf(s, "mean_projection_residual_px/median", "%.2f"),
         figureOf(s, "mean_image_residual_px/median", "%.2f"), figureOf(s, "mpd_px/median", "%.3f"),
         figureOf(s, "rotation_deg/median", "%.3f deg") + ", " + figureOf(s, "centroid_mm/median", "%.3f mm"),
         figureOf(s, "pose_ok_percent", "%.0f %%"), figureOf(s, "gfr_true_5px_percent", "%.0f %%"),
         figureOf(s, "failed_and_trusted_percent", "%.0f %%"), figureOf(s, "time_ms/total/p50", "%.1f")});
  }
  return markdownTable(rows) +
         "Medians over the cases; \"pose ok\" is within 0.1 deg and 1 mm of the truth at the tree's centroid.\n";
}

Json machineAsJson() {
  Json machine;
  std::ifstream cpuinfo("/proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);) {
    if (line.rfind("model name", 0) == 0) {
      machine["processor"] = line.substr(line.find(':') + 2);
      break;
    }
  }
  machine["cores"] = std::thread::hardware_concurrency();
  machine["compiler"] = __VERSION__;
  return machine;
}

}  // namespace angio::evaluation
