// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/case_row.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "angio/campaign/shard_file.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

// Each field with a value of its own.
CaseOutcome drawnOutcome(int seed) {
  Random random(static_cast<unsigned>(seed));
  const auto number = [&] { return random.normal(); };
  CaseOutcome o;
  o.name = "im\u00e9 \"5\"\n";
  RegistrationResult& r = o.result;
  r.status = RegistrationStatus::kDiverged;
  r.reason = "neither side";
  r.T_camera_model = expSE3(random.twist(1, 1));
  r.displacements_m = Eigen::Matrix3Xd::Random(3, 5);
  r.covariance = Matrix6d::Random();
  r.deformation_std_m = number();
  r.spread = PlaceSpread{number(), number(), number()};
  r.ambiguity = number();
  r.prior = PriorInForce::kNone;
  r.alignment = {number(), number(), number(), number(), number(), 7};
  r.last_step_px = number();
  r.rigid_iterations = 3;
  r.nonrigid_iterations = 4;
  r.points_3d = 5;
  r.points_2d = 6;
  r.times = {number(), number(), number(), number()};
  o.image_s = number();
  o.pixel_at_isocenter_m = number();
  o.followed = true;
  o.rejection = "jump";
  o.claim = CaseOutcome::Claim{number(), number(), number()};
  o.usable_for = {"centre", "view"};
  o.point_covariances_m2 = {Eigen::Matrix3d::Random(), Eigen::Matrix3d::Random()};
  o.point_central_covariances_m2 = {Eigen::Matrix3d::Random()};
  o.interval_90 = CaseOutcome::Interval{number(), number()};
  o.certificate = PoseCertificate{true, number(), number(), {}, number(), 123456789012, "open", 3};
  o.certificate->alternative = PoseCertificate::Alternative{expSE3(random.twist(1, 1)), number(), number()};
  o.certificate_false = true;
  o.projection_residual_px = number();
  o.start_error = PoseError{number(), number(), number(), number(), {}, number(), number(), number(), number()};
  o.error = PoseError{number(), number(), number(), number(), number(), {}, number(), number(), std::nan("")};
  return o;
}

// What reports are made of is the same, to the last bit.
TEST(CaseRow, KeepsAllThatReportsAreMadeOf) {
  const CaseOutcome o = drawnOutcome(3);
  CaseOutcome read;
  fromRow(campaign::rowOfText(campaign::rowAsText(toRow(o)), "here"), {"here", ""}, read);
  EXPECT_EQ(campaign::rowAsText(toRow(read)), campaign::rowAsText(toRow(o)));
  EXPECT_EQ(caseAsJson(read).dump(), caseAsJson(o).dump());
  EXPECT_EQ(summaryOf({read, read}).dump(), summaryOf({o, o}).dump());
  EXPECT_EQ(read.result.T_camera_model.matrix(), o.result.T_camera_model.matrix());
  EXPECT_EQ(certificateAsJson(*read.certificate, {}).dump(), certificateAsJson(*o.certificate, {}).dump());
  EXPECT_EQ(read.certificate_false, o.certificate_false);
  EXPECT_EQ(read.projection_residual_px, o.projection_residual_px);
}

TEST(CaseRow, IsRefusedByItsField) {
  const auto refusalWith = [](const char* path, const Json& value) {
    Json row = toRow(drawnOutcome(3));
    row[Json::json_pointer(path)] = value;
    CaseOutcome read;
    return refusalOf([&] { fromRow(row, {"shard.json:2", ""}, read); });
  };
  EXPECT_EQ(refusalWith("/result/status", 4), "shard.json:2: result/status = 4: must be one of its choices, by number");
  EXPECT_EQ(refusalWith("/result/covariance", {1, 2}),
            "shard.json:2: result/covariance = (list of 2): must be the numbers of a matrix of 6 rows");
  EXPECT_EQ(refusalWith("/result/displacements_m", {1, 2}),
            "shard.json:2: result/displacements_m = (list of 2): must be the numbers of a matrix of 3 rows");
  EXPECT_EQ(refusalWith("/result/T_camera_model", Json(std::vector<double>(12, 1))),
            "shard.json:2: result/T_camera_model = (list of 12): must be a rotation and a translation");
  EXPECT_EQ(refusalWith("/error/mtre_m", true), "shard.json:2: error/mtre_m = true: must be a number");
  EXPECT_EQ(refusalWith("/claim", 1), "shard.json:2: claim = 1: must be a map");
}

}  // namespace
}  // namespace angio::test
