// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/results/case_run.hpp"
#include "angio/results/record_row.hpp"

// What becomes of a case as a row: all that reports are made of. Single points' uncertainty and what was matched, which
// live as long as the registration, are not in it.
namespace angio::registration {

constexpr int choicesOf(RegistrationStatus) { return 4; }
constexpr int choicesOf(PriorInForce) { return 4; }

template <typename Fields>
void visitRow(Fields& f, results::RecordOf<Fields, AlignmentScore>& score) {
  f("model_explained", score.model_explained);
  f("image_explained", score.image_explained);
  f("model_residual_px", score.model_residual_px);
  f("image_residual_px", score.image_residual_px);
  f("model_rms_px", score.model_rms_px);
  f("model_points", score.model_points);
}

template <typename Fields>
void visitRow(Fields& f, results::RecordOf<Fields, RegistrationTimes>& times) {
  f("prepare_s", times.prepare_s);
  f("rigid_s", times.rigid_s);
  f("nonrigid_s", times.nonrigid_s);
  f("total_s", times.total_s);
}

template <typename Fields>
void visitRow(Fields& f, results::RecordOf<Fields, PlaceSpread>& spread) {
  f("noise_m", spread.noise_m);
  f("all_m", spread.all_m);
  f("across_m", spread.across_m);
}

template <typename Fields>
void visitRow(Fields& f, results::RecordOf<Fields, RegistrationResult>& result) {
  f("status", result.status);
  f("reason", result.reason);
  f("T_camera_model", result.T_camera_model);
  f("displacements_m", result.displacements_m);
  f("covariance", result.covariance);
  f("noise_covariance", result.noise_covariance);
  f("deformation_std_m", result.deformation_std_m);
  f("spread", result.spread);
  f("ambiguity", result.ambiguity);
  f("prior", result.prior);
  f("alignment", result.alignment);
  f("last_step_px", result.last_step_px);
  f("rigid_iterations", result.rigid_iterations);
  f("nonrigid_iterations", result.nonrigid_iterations);
  f("points_3d", result.points_3d);
  f("points_2d", result.points_2d);
  f("times", result.times);
}

template <typename Fields>
void visitRow(Fields& f, results::RecordOf<Fields, PoseCertificate::Alternative>& alternative) {
  f("T_camera_model", alternative.T_camera_model);
  f("share", alternative.share);
  f("distance_m", alternative.distance_m);
}

template <typename Fields>
void visitRow(Fields& f, results::RecordOf<Fields, PoseCertificate>& certificate) {
  f("proven", certificate.proven);
  f("unexplained_cost", certificate.unexplained_cost);
  f("score", certificate.score);
  f("bound", certificate.bound);
  f("alternative", certificate.alternative);
  f("seconds", certificate.seconds);
  f("cells", certificate.cells);
  f("reason", certificate.reason);
}

}  // namespace angio::registration

namespace angio::results {

template <typename Fields>
void visitRow(Fields& f, RecordOf<Fields, PoseError>& error) {
  f("mtre_m", error.mtre_m);
  f("depth_m", error.depth_m);
  f("in_plane_m", error.in_plane_m);
  f("across_beam_m", error.across_beam_m);
  f("mpd_px", error.mpd_px);
  f("mpd_isocenter_m", error.mpd_isocenter_m);
  f("rotation_rad", error.rotation_rad);
  f("centroid_m", error.centroid_m);
  f("source_m", error.source_m);
}

template <typename Fields>
void visitRow(Fields& f, RecordOf<Fields, CaseOutcome::Claim>& claim) {
  f("beyond", claim.beyond);
  f("depth_in", claim.depth_in);
  f("plane_in", claim.plane_in);
}

template <typename Fields>
void visitRow(Fields& f, RecordOf<Fields, CaseOutcome::Interval>& interval) {
  f("across_beam_m", interval.across_beam_m);
  f("depth_m", interval.depth_m);
}

template <typename Fields>
void visitRow(Fields& f, RecordOf<Fields, CaseOutcome>& outcome) {
  f("name", outcome.name);
  f("result", outcome.result);
  f("image_s", outcome.image_s);
  f("pixel_at_isocenter_m", outcome.pixel_at_isocenter_m);
  f("followed", outcome.followed);
  f("rejection", outcome.rejection);
  f("by_catheter", outcome.by_catheter);
  f("claim", outcome.claim);
  f("usable_for", outcome.usable_for);
  f("point_covariances_m2", outcome.point_covariances_m2);
  f("point_central_covariances_m2", outcome.point_central_covariances_m2);
  f("interval_90", outcome.interval_90);
  f("certificate", outcome.certificate);
  f("certificate_false", outcome.certificate_false);
  f("projection_residual_px", outcome.projection_residual_px);
  f("start_error", outcome.start_error);
  f("error", outcome.error);
}

}  // namespace angio::results
