// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "angio/results/case_run.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {
namespace {

CaseOutcome outcomeOf(RegistrationStatus status, std::optional<double> mtre_m = {}, std::optional<double> mpd_px = {}) {
  CaseOutcome o;
  o.result.status = status;
  if (mtre_m) {
    o.error = PoseError{};
    o.error->mtre_m = o.error->centroid_m = *mtre_m;
    o.error->mpd_px = mpd_px;
  }
  return o;
}

TEST(CaseReport, ACaseHasWhatOutsideToolsRead) {
  CaseOutcome o = outcomeOf(RegistrationStatus::kConverged);
  RegistrationResult& r = o.result;
  r.T_camera_model.linear() << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  r.T_camera_model.translation() << 0.001, -0.002, 0.75;
  Matrix6d covariance;
  for (int i = 0; i < 36; ++i) covariance(i / 6, i % 6) = i;
  r.covariance = covariance;
  r.ambiguity = 0.25;
  r.alignment.model_residual_px = 0.5;
  r.displacements_m = Eigen::Matrix3Xd::Zero(3, 2);
  r.displacements_m.col(1) << 0.001, 0.002, 0.003;
  r.points_3d = 7;
  r.points_2d = 8;
  r.times = {0.001, 0.002, 0.003, 0.006};
  o.image_s = 0.004;

  const auto json = nlohmann::json::parse(caseAsJson(o).dump());
  EXPECT_EQ(json["status"], "converged");
  EXPECT_EQ(json["rotation"], nlohmann::json({0, -1, 0, 1, 0, 0, 0, 0, 1})) << "row by row";
  for (int i = 0; i < 3; ++i) EXPECT_DOUBLE_EQ(json["translation_mm"][i], (Eigen::Vector3d(1, -2, 750))[i]);
  ASSERT_EQ(json["covariance"].size(), 36u);
  EXPECT_EQ(json["covariance"][1], 1) << "row by row";
  EXPECT_EQ(json["ambiguity"], 0.25);
  EXPECT_EQ(json["mean_projection_residual_px"], 0.5);
  ASSERT_EQ(json["displacements_mm"].size(), 2u);
  for (int i = 0; i < 3; ++i) EXPECT_DOUBLE_EQ(json["displacements_mm"][1][i], i + 1);
  EXPECT_EQ(json["points_3d"], 7);
  EXPECT_EQ(json["points_2d"], 8);
  EXPECT_DOUBLE_EQ(json["time_ms"]["image"], 4);
  EXPECT_DOUBLE_EQ(json["time_ms"]["prepare"], 1);
  EXPECT_DOUBLE_EQ(json["time_ms"]["rigid"], 2);
  EXPECT_DOUBLE_EQ(json["time_ms"]["nonrigid"], 3);
  EXPECT_DOUBLE_EQ(json["time_ms"]["total"], 10) << "from image to pose";
}

TEST(CaseReport, WhatIsUnknownIsNullOrNotThere) {
  CaseOutcome o = outcomeOf(RegistrationStatus::kDiverged, 1.0);
  o.result.T_camera_model.translation().setConstant(std::numeric_limits<double>::quiet_NaN());
  const auto json = nlohmann::json::parse(caseAsJson(o).dump());
  EXPECT_TRUE(json["covariance"].is_null());
  EXPECT_TRUE(json["ambiguity"].is_null());
  EXPECT_TRUE(json["translation_mm"][0].is_null());
  EXPECT_TRUE(json["error"]["mpd_px"].is_null());
  EXPECT_FALSE(json.contains("displacements_mm"));
  EXPECT_FALSE(json.contains("start_error"));
}

TEST(CaseReport, TheSummaryCountsEveryFailure) {
  using Status = RegistrationStatus;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto s = summaryOf({outcomeOf(Status::kConverged, 0.0001, 0.2),       // Right.
                            outcomeOf(Status::kConverged, 0.050, 40.0),       // Wrong, and nobody noticed.
                            outcomeOf(Status::kDiverged, nan),                // Wrong without a number.
                            outcomeOf(Status::kTooFewPoints, 0.050, 40.0)});  // No answer.
  EXPECT_EQ(s["cases"], 4);
  EXPECT_EQ(s["status"]["converged"], 2);
  EXPECT_EQ(s["status"]["ambiguous"], 0);
  EXPECT_EQ(s["status"]["diverged"], 1);
  EXPECT_EQ(s["status"]["too_few_points"], 1);
  EXPECT_EQ(s["cases_with_truth"], 4);
  EXPECT_EQ(s["success_mtre_2mm_percent"], 25);
  EXPECT_EQ(s["pose_ok_percent"], 25);
  EXPECT_EQ(s["failed_and_trusted_percent"], 25);
  EXPECT_EQ(s["failed_and_noticed_percent"], 50);
  EXPECT_EQ(s["gfr_true_5px_percent"], 75);
}

TEST(CaseReport, NoCasesAndNoTruthAreNoFailure) {
  const auto none = summaryOf({});
  EXPECT_EQ(none["cases"], 0);
  EXPECT_FALSE(none.contains("mtre_mm"));
  const auto unknown = summaryOf({outcomeOf(RegistrationStatus::kConverged)});
  EXPECT_FALSE(unknown.contains("cases_with_truth"));
  EXPECT_NE(summaryTable({{"m", unknown}}).find("| m | 1 of 1 |"), std::string::npos);
}

}  // namespace
}  // namespace angio::test
