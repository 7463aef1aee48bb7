// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/gated_perception.hpp"

#include <gtest/gtest.h>

#include "angio/io/case_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/shared_data.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

// A target that is not known well enough holds a machine until it is; what cannot be is a fault that a person resets.
TEST(GatedPerception, TakesDoubtAboutTheTargetForNoContradiction) {
  const Stage stage;
  GatedPerceptionSettings settings = stage.settings.gatedPerception();
  settings.gate.max_target_std_mm = 0.01;
  GatedPerception perception(settings, stage.tree);
  const GatedObservation seen = perception.observe(stage.frame(1), stage.state(1));
  ASSERT_EQ(seen.observation.registration.status, RegistrationStatus::kConverged);
  ASSERT_NE(seen.rejection.value_or("").find("uncertainty of the target"), std::string::npos);
  EXPECT_FALSE(seen.patient);
  EXPECT_FALSE(seen.contradicts());

  settings = stage.settings.gatedPerception();
  settings.gate.max_calibration_offset_mm = 0.01;
  settings.T_dsa_cb.translation().x() += 3e-3;
  GatedPerception misled(settings, stage.tree);
  const GatedObservation elsewhere = misled.observe(stage.frame(1), stage.state(1));
  ASSERT_EQ(elsewhere.observation.registration.status, RegistrationStatus::kConverged);
  EXPECT_TRUE(elsewhere.contradicts());
}

// A clinical run of a catheter alone, half a second between its frames.
class CatheterAlone : public testing::Test {
 protected:
  static constexpr std::int64_t kPeriod_us = 500000;

  GatedPerceptionSettings settings(TargetNeed need, const Eigen::Vector3d& target) const {
    GatedPerceptionSettings settings;
    settings.perception.by_catheter = true;
    settings.perception.catheter_rounds_at_once = 0;
    settings.target_model = target;
    settings.need = need;
    return settings;
  }
  GatedObservation observe(GatedPerception& perception, std::size_t frame, std::int64_t time_us) const {
    const io::Case& one = run_.cases[frame];
    const Centerline2d curve = readCenterline(*one.views.front().centerline_path);
    const GatedObservation seen = perception.observe({{curve, one.views.front().camera}}, {time_us, one.initial_pose});
    perception.learn();
    return seen;
  }
  // What the sixth frame says.
  GatedObservation sixth(TargetNeed need, const Eigen::Vector3d& target) const {
    GatedPerception perception(settings(need, target), tree_);
    for (std::size_t k = 0; k < 5; ++k) observe(perception, k, static_cast<std::int64_t>(k) * kPeriod_us);
    return observe(perception, 5, 5 * kPeriod_us);
  }

  const CaseSet run_ = readCaseSet(exampleData("hepatic-tace/cases.yaml"));
  const VesselTree tree_ = readVesselTree(exampleData("hepatic-tace/tree.csv"));
  // Of the vessels that the catheter lies in, and a branch that it is far from.
  const Eigen::Vector3d near_ = tree_.points().col(20), far_ = farthestFrom(near_);

  Eigen::Vector3d farthestFrom(const Eigen::Vector3d& place) const {
    Eigen::Index farthest;
    (tree_.points().colwise() - place).colwise().squaredNorm().maxCoeff(&farthest);
    return tree_.points().col(farthest);
  }
};

TEST_F(CatheterAlone, SaysWhereItsVesselsAreAcrossTheBeam) {
  const GatedObservation seen = sixth(TargetNeed::kAcrossBeam, near_);
  ASSERT_TRUE(seen.by_catheter);
  ASSERT_TRUE(seen.patient) << *seen.rejection;
  const Eigen::Matrix3d known = seen.by_catheter->result.points->covarianceAt(near_);
  EXPECT_TRUE(seen.patient->pointCovariance(near_).isApprox(known, 1e-9));
  // A task that goes by the pose alone is told the same of its target.
  const PatientObservation by_pose{seen.patient->T_camera_model, seen.patient->covariance};
  EXPECT_TRUE(by_pose.pointCovariance(near_).isApprox(known, 1e-9));
  const auto& displacements_m = seen.by_catheter->result.displacements_m;
  const Eigen::Vector3d bent = seen.by_catheter->result.T_camera_model * (near_ + displacements_m.col(20));
  EXPECT_LT((seen.patient->placeAt(near_) - bent).norm(), 1e-12);
  // Who is told the pose alone, and not of which place it is sure, must not go by it.
  PatientObservation told = PatientObservation::of(seen.observation.registration);
  told.points.reset();
  EXPECT_GT(told.worstStdAcross_m(near_), 5e-3);
}

TEST_F(CatheterAlone, DoesNotSayTheirDepth) {
  const GatedObservation seen = sixth(TargetNeed::kEverywhere, near_);
  ASSERT_TRUE(seen.by_catheter);
  EXPECT_FALSE(seen.patient);
  EXPECT_NE(seen.rejection.value().find("centre and navigate may go on"), std::string::npos) << *seen.rejection;
}

TEST_F(CatheterAlone, DoesNotSayWhereFarVesselsAre) {
  const GatedObservation seen = sixth(TargetNeed::kAcrossBeam, far_);
  ASSERT_TRUE(seen.by_catheter);
  EXPECT_FALSE(seen.patient);
  EXPECT_NE(seen.rejection.value().find("uncertainty of the target"), std::string::npos) << *seen.rejection;
  EXPECT_FALSE(seen.contradicts()) << "the catheter may come nearer: no fault that a person has to reset";
}

TEST_F(CatheterAlone, IsNotAskedUnlessTheSettingsSaySo) {
  GatedPerceptionSettings off = settings(TargetNeed::kAcrossBeam, near_);
  off.perception.by_catheter = false;
  GatedPerception perception(off, tree_);
  for (std::size_t k = 0; k < 6; ++k) {
    const GatedObservation seen = observe(perception, k, static_cast<std::int64_t>(k) * kPeriod_us);
    EXPECT_FALSE(seen.patient) << k;
    EXPECT_FALSE(seen.by_catheter) << k;
  }
}

// At fifteen frames a second the first four show a quarter of a second: no run that says which vessels they are.
TEST_F(CatheterAlone, IsLearntFromFramesThatAreApart) {
  GatedPerception perception(settings(TargetNeed::kAcrossBeam, near_), tree_);
  std::int64_t time_us = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    for (int again = 0; again < 6; ++again, time_us += 66667) {
      EXPECT_FALSE(observe(perception, k, time_us).by_catheter) << k << ", " << again;
      if (k == 3) break;  // The fourth of those that are apart.
    }
  }
  EXPECT_TRUE(observe(perception, 4, time_us + 66667).by_catheter);
}

TEST_F(CatheterAlone, BeginsAnewWhereTimeGoesBack) {
  GatedPerception perception(settings(TargetNeed::kAcrossBeam, near_), tree_);
  for (std::size_t k = 0; k < 5; ++k) observe(perception, k, static_cast<std::int64_t>(k) * kPeriod_us);
  EXPECT_FALSE(observe(perception, 5, 0).by_catheter);
}

TEST_F(CatheterAlone, NeedsAMethodThatBends) {
  GatedPerceptionSettings other = settings(TargetNeed::kAcrossBeam, near_);
  other.perception.useIterativePnp();
  const std::string line = refusalOf([&] { GatedPerception perception(other, tree_); });
  EXPECT_NE(line.find("method = iterative_pnp: must be oriented_kernel"), std::string::npos) << line;
}

}  // namespace
}  // namespace angio::test
