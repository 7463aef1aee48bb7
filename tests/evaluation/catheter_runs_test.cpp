// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/catheter_runs.hpp"

#include <gtest/gtest.h>

#include "angio/io/case_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/perception/catheter_registration.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/shared_data.hpp"
#include "angio/vessel/projection.hpp"

namespace angio::test {
namespace {

const VesselTree& hepaticTree() {
  static const VesselTree tree = readVesselTree(exampleData("hepatic-tace/tree.csv"));
  return tree;
}

// Poses are 20 mm and 1.5 deg off, per axis, and the vessels 3 mm.
TEST(CatheterRuns, PinTheVesselsThatTheyLieInAndClaimWhatTheyKnow) {
  CatheterRunSettings settings;
  settings.frames = 7;
  settings.deformation_rms_mm = 3;
  int registered = 0;
  for (int index = 0; index < 2; ++index) {
    const auto frames = catheterRun(hepaticTree(), settings, index);
    ASSERT_EQ(frames.size(), 7);
    for (int k = 0; k < 4; ++k) EXPECT_FALSE(frames[k].registered) << "nothing is known before four frames make a run";
    for (const CatheterRunFrame& frame : frames) {
      registered += frame.registered;
      if (!frame.converged) continue;
      EXPECT_LT(*frame.across_m, 3e-3);
      EXPECT_LE(frame.claim->beyond, 0.05);
      // The run says nothing of depth: 40 mm are claimed, 20 mm were drawn.
      EXPECT_GT(frame.claim->depth_in, 0.9);
      ASSERT_TRUE(frame.beside) << "branches go off the vessels that the catheter lies in";
      EXPECT_GT(frame.beside->plane_in, 0.8);
      EXPECT_LT(frame.beside->beyond, 0.05);
    }
  }
  EXPECT_GE(registered, 5);
}

TEST(CatheterRuns, AreTheSameForTheSameSeed) {
  CatheterRunSettings settings;
  settings.frames = 6;
  const auto once = catheterRun(hepaticTree(), settings, 1), again = catheterRun(hepaticTree(), settings, 1);
  ASSERT_TRUE(once.back().across_m);
  EXPECT_EQ(*once.back().across_m, *again.back().across_m);
  settings.seed = 2;
  EXPECT_NE(once.back().across_m, catheterRun(hepaticTree(), settings, 1).back().across_m);
}

TEST(CatheterRuns, HaveNoFramesInATreeWithoutALongRoute) {
  const Eigen::Matrix3Xd short_vessel = Eigen::Vector3d::UnitX() * Eigen::RowVectorXd::LinSpaced(20, 0, 0.05);
  std::vector<int> parents;
  for (int i = 0; i < 20; ++i) parents.push_back(i - 1);
  EXPECT_TRUE(catheterRun(VesselTree(short_vessel, parents), {}, 0).empty());
}

// The tree's own image: many curves, of which a catheter would be one at most.
TEST(CatheterRegistration, TakesNoFrameThatShowsMoreThanOneCurve) {
  test::Random random(1);
  const XrayCamera camera = test::clinicalCamera();
  const Pose T = test::viewOf(hepaticTree(), random);
  const Centerline2d vessels = projectedCenterline(hepaticTree(), camera, T);
  CatheterRegistration registration({}, hepaticTree());
  for (int k = 0; k < 5; ++k) {
    EXPECT_FALSE(registration.observe({vessels, camera}, T, 500000 * k));
    registration.learn();
  }
}

// A straight line across the image is in no vessel: it never pins one.
TEST(CatheterRegistration, IsNotPinnedByALineThatIsInNoVessel) {
  test::Random random(2);
  const XrayCamera camera = test::clinicalCamera();
  const Pose T = test::viewOf(hepaticTree(), random);
  Eigen::Matrix2Xd line(2, 100);
  line.row(0).setLinSpaced(50, 950);
  line.row(1).setLinSpaced(60, 80);
  const Centerline2d wire = makeCenterline(line, std::vector<int>(100, 0));
  CatheterRegistration registration({}, hepaticTree());
  for (int k = 0; k < 6; ++k) {
    const auto by = registration.observe({wire, camera}, T, 500000 * k);
    EXPECT_FALSE(by && by->result.status == RegistrationStatus::kConverged);
    registration.learn();
  }
}

// A tree like it, of the same size and in the same place, whose vessels do not run as the catheter does.
TEST(CatheterRegistration, DoesNotConvergeInAMirroredTree) {
  Eigen::Matrix3Xd mirrored = hepaticTree().points().colwise() - hepaticTree().centroid();
  mirrored.row(1) *= -1;
  mirrored.colwise() += hepaticTree().centroid();
  CatheterRegistration registration({}, VesselTree(mirrored, hepaticTree().parents(), hepaticTree().radii()));
  const CaseSet set = readCaseSet(exampleData("hepatic-tace/cases.yaml"));
  for (std::int64_t k = 0; k < 9; ++k) {
    const Case& one = set.cases[static_cast<std::size_t>(k)];
    const View& view = one.views.front();
    const Centerline2d curve = readCenterline(*view.centerline_path);
    const auto by = registration.observe({curve, view.camera}, one.initial_pose, 500000 * k);
    EXPECT_FALSE(by && by->result.status == RegistrationStatus::kConverged) << k;
    registration.learn();
  }
}

}  // namespace
}  // namespace angio::test
