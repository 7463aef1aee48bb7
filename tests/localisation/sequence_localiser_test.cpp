// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/localisation/sequence_localiser.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>

#include "angio/io/case_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/test/errors.hpp"
#include "drawn_catheter.hpp"

namespace angio::test {
namespace {

const std::string kLiver = std::string(ANGIO_EXAMPLE_DATA) + "/hepatic-tace/";

// The clinical sequence: the table's shift of some 35 mm is not known, nor which vessel the catheter is in.
TEST(SequenceLocaliser, FollowsTheClinicalCatheter) {
  const CaseSet set = readCaseSet(kLiver + "cases.yaml");
  const VesselTree tree = readVesselTree(kLiver + "tree.csv");
  std::vector<SequenceFrame> frames;
  for (std::size_t t = 0; t < set.cases.size(); t += 3) {
    const View& view = set.cases[t].views.front();
    SeenCatheter seen{readCenterline(*view.centerline_path).points_px, 1, TipEnd::kUnknown};
    frames.push_back({seen, {view.camera, set.cases[t].initial_pose, Matrix6d::Zero()}, {1.5, std::nullopt}});
  }
  const SequenceResult result = localiseSequence(frames, tree);
  ASSERT_EQ(result.beliefs.size(), frames.size());
  EXPECT_LT(result.residual_px, 2.5);
  // Where the sequence's authors start their tracker: "m_TipPositionId 294" of dataset1/dataList.txt in
  // pambros/HMM-3D-Catheter-Tip-Tracking. What they set by hand is a point of the centreline some millimetres apart.
  EXPECT_LT((result.beliefs[0].tip.tip_model - tree.points().col(294)).norm(), 4e-3);
  const TreeTopology map(tree);
  for (std::size_t t = 0; t < frames.size(); ++t) {
    EXPECT_EQ(result.beliefs[t].status, BeliefStatus::kSeen) << result.beliefs[t].why;
    EXPECT_LT(*result.beliefs[t].residual_px, 3.5);
    // The tip goes on into the liver, by what breathing and hands do at most (three frames are taken as one).
    const double before_m = result.path[t == 0 ? 0 : t - 1].path_m;
    EXPECT_LT(std::abs(result.path[t].path_m - before_m), 0.016);
  }
  EXPECT_GT(result.path.back().path_m, result.path.front().path_m + 0.05);
  EXPECT_TRUE(map.passes(result.path.back().branch, result.path[frames.size() / 2].branch));
}

// A known route under a known shift, and vessels that are deformed as by a catheter.
TEST(SequenceLocaliser, FindsAKnownShiftAndDisplacement) {
  const VesselTree tree = readVesselTree(kLiver + "tree.csv");
  const TreeTopology map(tree);
  int leaf = 0;
  for (int branch = 0; branch < map.branchCount(); ++branch) {
    if (map.start_m(branch) + map.length_m(branch) > map.start_m(leaf) + map.length_m(leaf)) leaf = branch;
  }
  Pose T = Pose::Identity();
  T.linear() = expSO3({0.3, -0.4, 0.1});
  T.translation() = Eigen::Vector3d(0, 0, 0.81) - T.linear() * tree.centroid();
  const Pose shift(Eigen::Translation3d(T.linear().transpose() * Eigen::Vector3d(0.02, -0.015, 0.004)));
  // In the camera's plane, 3 mm over 60 mm of height: what a stiff catheter does to an artery.
  Eigen::Matrix3Xd bent = tree.points();
  for (int i = 0; i < tree.size(); ++i) {
    bent.col(i) += T.linear().transpose() * Eigen::Vector3d(3e-3 * std::sin(tree.points()(1, i) / 0.02), 0, 0);
  }
  const TreeTopology bent_map{VesselTree(bent, tree.parents())};
  std::mt19937 random(3);
  const SeenPose true_pose{XrayCamera::centered(1024, 1024, 0.00025355859375, 1.113), T * shift, Matrix6d::Zero()};
  std::vector<SequenceFrame> frames;
  std::vector<TreeLocation> tips;
  for (int frame = 0; frame < 8; ++frame) {
    tips.push_back({leaf, map.length_m(leaf) * (0.2 + 0.1 * frame)});
    SeenPose estimated = true_pose;
    estimated.T_camera_model = T;
    const TreeLocation in_bent{leaf, tips.back().arc_m * bent_map.length_m(leaf) / map.length_m(leaf)};
    frames.push_back({test::noisy(test::drawnCatheter(bent_map, in_bent, true_pose), 1, 0.5, random),
                      estimated,
                      {0.5, std::nullopt}});
  }
  const SequenceResult result = localiseSequence(frames, tree);
  EXPECT_LT(result.residual_px, 2);
  for (std::size_t t = 0; t < frames.size(); ++t) {
    EXPECT_EQ(result.beliefs[t].tip.branch, leaf);
    // What is along the vessel, one view takes for the tip's motion as well as for the vessel's displacement.
    EXPECT_NEAR(result.beliefs[t].tip.arc_m, tips[t].arc_m, 4e-3);
  }
  EXPECT_EQ(result.displacements_m.cols(), tree.size());
}

TEST(SequenceLocaliser, RefusesWhatIsNoSequence) {
  const VesselTree tree = readVesselTree(kLiver + "tree.csv");
  EXPECT_THROW(localiseSequence({}, tree), InputError);
  SequenceFrame empty{
      {Eigen::Matrix2Xd(2, 0), 1, TipEnd::kLast},
      {XrayCamera::centered(1024, 1024, 0.00025, 1.0), Pose(Eigen::Translation3d(0, 0, 0.8)), Matrix6d::Zero()},
      {}};
  const SequenceResult result = localiseSequence({empty, empty}, tree);
  EXPECT_EQ(result.beliefs[1].status, BeliefStatus::kUnknown);
  EXPECT_FALSE(result.beliefs[1].why.empty());
  SequenceSettings settings;
  settings.deformation_length_mm = 0;
  EXPECT_EQ(refusalOf([&] {
              localiseSequence({empty, empty}, tree, settings);
            }),
            "sequence localiser: deformation_length_mm = 0: must lie between 1 and 10000");
}

}  // namespace
}  // namespace angio::test
