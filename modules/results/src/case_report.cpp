// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <nlohmann/json.hpp>

#include "angio/results/case_run.hpp"
#include "angio/results/columns.hpp"
#include "angio/results/experiment.hpp"

namespace angio::results {
namespace {

using O = const CaseOutcome&;

// Thresholds of the trade: method names them in the keys.
constexpr double kGrossFailurePx = 5, kPoseOk_deg = 0.1, kPoseOk_mm = 1;

double total_ms(O o) { return 1e3 * (o.image_s + o.result.times.total_s); }

bool converged(O o) { return o.result.status == RegistrationStatus::kConverged; }
bool caseSucceeded(O o) { return o.error->mtre_m < kSuccessMtre_m; }

// What there is to say of an error, of one case and as a spread.
struct ErrorColumn {
  const char* key;
  Json (*value)(const PoseError&);
};
constexpr ErrorColumn kErrors[] = {
    {"mtre_mm", [](const PoseError& e) { return Json(1e3 * e.mtre_m); }},
    {"depth_mm", [](const PoseError& e) { return Json(1e3 * e.depth_m); }},
    {"in_plane_mm", [](const PoseError& e) { return Json(1e3 * e.in_plane_m); }},
    {"across_beam_mm", [](const PoseError& e) { return Json(1e3 * e.across_beam_m); }},
    {"mpd_px", [](const PoseError& e) { return orNull(e.mpd_px); }},
    {"mpd_isocentre_mm",
     [](const PoseError& e) { return e.mpd_isocenter_m ? Json(1e3 * *e.mpd_isocenter_m) : Json(nullptr); }},
    {"rotation_deg", [](const PoseError& e) { return Json(radToDeg(e.rotation_rad)); }},
    {"centroid_mm", [](const PoseError& e) { return Json(1e3 * e.centroid_m); }},
    {"source_mm", [](const PoseError& e) { return Json(1e3 * e.source_m); }}};

// The numbers of a matrix, row by row.
template <typename Matrix>
Json numbersOf(const Matrix& matrix) {
  Json numbers = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) numbers.push_back(matrix(i, j));
  }
  return numbers;
}

Json errorAsJson(const PoseError& error) {
  Json json;
  for (const auto& [key, value] : kErrors) json[key] = value(error);
  return json;
}

// Of cases with an answer: one with too few points has no residual.
std::vector<Column<CaseOutcome>> answerColumns() {
  return {{"", "mean_projection_residual_px", kSpread, [](O o) { return o.result.alignment.model_residual_px; }},
          {"", "mean_image_residual_px", kSpread, [](O o) { return o.result.alignment.image_residual_px; }},
          {"", "rms_projection_residual_isocentre_mm", kSpread,
           [](O o) { return 1e3 * o.pixel_at_isocenter_m * o.result.alignment.model_rms_px; }},
          {"", "gfr_nearest_5px_percent", "percent",
           [](O o) { return o.result.alignment.model_residual_px > kGrossFailurePx; }},
          {"", "time_ms/rigid", kSpread, [](O o) { return 1e3 * o.result.times.rigid_s; }},
          {"", "time_ms/nonrigid", kSpread, [](O o) { return 1e3 * o.result.times.nonrigid_s; }},
          {"", "time_ms/total", "p50 p99 max", total_ms}};
}

// Against the truth every case counts: one without an answer has failed, and stands where it began.
std::vector<Column<CaseOutcome>> truthColumns() {
  std::vector<Column<CaseOutcome>> columns;
  for (const auto& [key, value] : kErrors) {
    columns.push_back({"", key, kSpread, [value = value](O o) { return value(*o.error); }});
  }
  const auto percent = [&](const char* key, bool (*holds)(O)) { columns.push_back({"", key, "percent", holds}); };
  percent("gfr_true_5px_percent", [](O o) { return !(o.error->mpd_px && *o.error->mpd_px <= kGrossFailurePx); });
  percent("success_mtre_2mm_percent", caseSucceeded);
  percent("pose_ok_percent",
          [](O o) { return radToDeg(o.error->rotation_rad) < kPoseOk_deg && 1e3 * o.error->centroid_m < kPoseOk_mm; });
  percent("failed_and_noticed_percent", [](O o) { return !caseSucceeded(o) && !converged(o); });
  percent("failed_and_trusted_percent", [](O o) { return !caseSucceeded(o) && converged(o); });
  return columns;
}

}  // namespace

Json caseAsJson(const CaseOutcome& outcome) {
  const RegistrationResult& r = outcome.result;
  Json json;
  json["status"] = statusName(r.status);
  json["reason"] = r.reason;
  if (outcome.followed) json["followed"] = *outcome.followed;
  if (outcome.rejection) json["rejection"] = *outcome.rejection;
  if (outcome.by_catheter) json["by_catheter"] = true;
  json["rotation"] = numbersOf(r.T_camera_model.linear());
  json["translation_mm"] = numbersOf(1e3 * r.T_camera_model.translation());
  json["covariance"] = r.covariance ? numbersOf(*r.covariance) : Json(nullptr);
  json["ambiguity"] = orNull(r.ambiguity);
  json["deformation_std_mm"] = 1e3 * r.deformation_std_m;
  json["spread_mm"] = r.spread ? Json(1e3 * r.spread->all_m) : Json(nullptr);
  json["spread_across_mm"] = r.spread ? Json(1e3 * r.spread->across_m) : Json(nullptr);
  json["interval_90_mm"] = nullptr;
  if (const auto& half = outcome.interval_90) {
    json["interval_90_mm"] = {{"across_beam", 1e3 * half->across_beam_m}, {"depth", 1e3 * half->depth_m}};
  }
  json["usable_for"] = outcome.usable_for;
  for (const auto& [key, covariances] :
       {std::pair("point_covariance_mm2", &outcome.point_covariances_m2),
        std::pair("point_central_covariance_mm2", &outcome.point_central_covariances_m2)}) {
    for (const Eigen::Matrix3d& C_m2 : *covariances) {
      const Eigen::Matrix3d C = 1e6 * C_m2;
      json[key].push_back({C(0, 0), C(0, 1), C(0, 2), C(1, 1), C(1, 2), C(2, 2)});
    }
  }
  if (outcome.claim) {
    json["claim"] = {{"beyond", outcome.claim->beyond},
                     {"depth_in_90", outcome.claim->depth_in},
                     {"plane_in_90", outcome.claim->plane_in}};
  }
  json["prior"] = priorName(r.prior);
  if (outcome.projection_residual_px) json["rms_of_all_points_px"] = *outcome.projection_residual_px;
  json["mean_projection_residual_px"] = r.alignment.model_residual_px;
  json["rms_projection_residual_px"] = r.alignment.model_rms_px;
  json["mean_image_residual_px"] = r.alignment.image_residual_px;
  json["model_explained"] = r.alignment.model_explained;
  json["image_explained"] = r.alignment.image_explained;
  for (Eigen::Index i = 0; i < r.displacements_m.cols(); ++i) {
    json["displacements_mm"].push_back(numbersOf(1e3 * r.displacements_m.col(i)));
  }
  json["points_3d"] = r.points_3d;
  json["points_2d"] = r.points_2d;
  json["iterations"] = {{"rigid", r.rigid_iterations}, {"nonrigid", r.nonrigid_iterations}};
  json["time_ms"] = {{"image", 1e3 * outcome.image_s},
                     {"prepare", 1e3 * r.times.prepare_s},
                     {"rigid", 1e3 * r.times.rigid_s},
                     {"nonrigid", 1e3 * r.times.nonrigid_s},
                     {"total", total_ms(outcome)}};
  if (outcome.start_error) json["start_error"] = errorAsJson(*outcome.start_error);
  if (outcome.error) json["error"] = errorAsJson(*outcome.error);
  return json;
}

Json certificateAsJson(const PoseCertificate& c, const CertificateSettings& settings) {
  Json json = {{"proved", c.proven},
               {"reason", c.reason},
               {"best_score", c.score},
               {"upper_bound", c.bound},
               {"unexplained_cost", c.unexplained_cost}};
  json["rival"] = nullptr;
  if (c.alternative) {
    json["rival"] = {{"rotation", numbersOf(c.alternative->T_camera_model.linear())},
                     {"translation_mm", numbersOf(1e3 * c.alternative->T_camera_model.translation())},
                     {"share_of_score", c.alternative->share},
                     {"distance_mm", 1e3 * c.alternative->distance_m}};
  }
  json["time_ms"] = 1e3 * c.seconds;
  json["cells"] = c.cells;
  json["box_rotation_deg"] = settings.box_rotation_deg;
  json["box_translation_mm"] = settings.box_translation_mm;
  json["distance_mm"] = settings.distance_mm;
  json["rival_share"] = settings.alternative_share;
  return json;
}

Json summaryOf(const std::vector<CaseOutcome>& all) {
  Json summary;
  summary["cases"] = all.size();
  for (const auto status : {RegistrationStatus::kConverged, RegistrationStatus::kAmbiguous,
                            RegistrationStatus::kDiverged, RegistrationStatus::kTooFewPoints}) {
    summary["status"][statusName(status)] =
        std::count_if(all.begin(), all.end(), [&](O o) { return o.result.status == status; });
  }
  std::vector<CaseOutcome> answered, known;
  for (const auto& o : all) {
    if (o.result.status != RegistrationStatus::kTooFewPoints) answered.push_back(o);
    if (o.error) known.push_back(o);
  }
  summarise(answered, answerColumns(), summary);
  if (known.empty()) return summary;
  summary["cases_with_truth"] = known.size();
  summarise(known, truthColumns(), summary);
  return summary;
}

std::string summaryTable(const Json& summary_by_method) {
  return figureTable(summary_by_method, {{"method", ""},
                                         {"converged", "{status/converged:%d} of {cases:%d}"},
                                         {"nearest residual: model [px]", "{mean_projection_residual_px/median:%.2f}"},
                                         {"image [px]", "{mean_image_residual_px/median:%.2f}"},
                                         {"true projection [px]", "{mpd_px/median:%.3f}"},
                                         {"pose error", "{rotation_deg/median:%.3f deg}, {centroid_mm/median:%.3f mm}"},
                                         {"pose ok", "{pose_ok_percent:%.0f %%}"},
                                         {"mPD > 5 px", "{gfr_true_5px_percent:%.0f %%}"},
                                         {"failed unnoticed", "{failed_and_trusted_percent:%.0f %%}"},
                                         {"ms", "{time_ms/total/p50:%.1f}"}}) +
         "Medians over the cases; \"pose ok\" is within 0.1 deg and 1 mm of the truth at the tree's centroid.\n";
}

}  // namespace angio::results
