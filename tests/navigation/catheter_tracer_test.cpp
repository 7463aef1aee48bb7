// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/catheter_tracer.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

#include "angio/geometry/se3.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/simulation/simulated_catheter.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/random.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::test {
namespace {

// A catheter in a made-up tree without contrast agent, in an X-ray image with anatomy and noise.
struct CatheterTracerTest : testing::Test {
  VesselTree tree = withPlausibleRadii(test::branchingTree(4), 0.6e-3);
  TreeTopology map{tree};
  SeenPose pose{XrayCamera::centered(512, 512, 0.315 / 512, 1.2), Pose::Identity(), Matrix6d::Zero()};
  CatheterTracer tracer{tree, {}};

  void SetUp() override { pose.T_camera_model.translation() = Eigen::Vector3d(0, 0, 0.75) - tree.centroid(); }

  cv::Mat shown(const std::vector<Device>& devices) const {
    XrayScene scene;
    scene.T_camera_model = pose.T_camera_model;
    scene.densities = Eigen::VectorXd::Zero(tree.size());
    scene.devices = devices;
    return FluoroscopyRenderer(tree, {}).render(pose.camera, scene, 1);
  }

  TipBelief beliefAt(const TreeLocation& place) const {
    TipBelief belief;
    belief.tip.branch = place.branch;
    belief.tip.arc_m = place.arc_m;
    belief.tip.tip_model = map.point(place);
    return belief;
  }
};

// In every branch, though it is believed 8 mm further back, most often in another branch.
TEST_F(CatheterTracerTest, FindsTheTipInTheBranchThatItIsIn) {
  int tried = 0;
  for (int branch = 1; branch < map.branchCount(); ++branch) {
    const TreeLocation tip{branch, 0.6 * map.length_m(branch)};
    const SimulatedCatheter catheter(tree, {}, tip, 0);
    const Eigen::Vector3d end = catheter.truth().tip_model;
    const auto pixel = pose.camera.project(pose.T_camera_model * end);
    if (!pixel || !pose.camera.sees(*pixel)) continue;
    ++tried;
    const TreeFrame frame = map.frame(tip);
    const Eigen::Vector3d beside = end - map.point(tip);
    const TipOffset offset{{beside.dot(frame.normal), beside.dot(frame.binormal)}, Eigen::Matrix2d::Identity() * 1e-6};
    const auto trace = CatheterTracer(tree, {}).trace(shown({catheter.device(tree.points())}), pose,
                                                      beliefAt(map.before(tip, 8e-3)), offset);
    ASSERT_TRUE(trace) << branch;
    // A pixel is 0.4 mm at the tip; its band is 1.5 mm long.
    EXPECT_LT((trace->seen.points_px.rightCols<1>() - *pixel).norm(), 2) << branch;
    // Where the vessel runs along the beam, other places may do as well; its own must always do.
    double own = -100;
    for (const PlaceEvidence& one : trace->evidence.places) {
      if (one.branch == branch && std::abs(one.arc_m - tip.arc_m) < 1.5e-3) own = std::max(own, one.log_evidence);
    }
    EXPECT_GT(own, -1) << branch;
    TipPlace place;
    place.branch = branch;
    place.arc_m = tip.arc_m;
    const auto found = tipEnd(trace->evidence, place);
    ASSERT_TRUE(found) << branch;
    EXPECT_LT((*found - end).norm(), 1.5e-3) << branch;
  }
  EXPECT_GE(tried, 3);
}

// In a vessel as wide as an aorta a bent tip stands 5 mm beside the axis.
TEST_F(CatheterTracerTest, FindsATipFarBesideTheAxisOfAWideVessel) {
  Eigen::Matrix3Xd points(3, 31);
  std::vector<int> parents;
  for (int i = 0; i < points.cols(); ++i) {
    points.col(i) << 4e-3 * i - 0.06, 0, 0;
    parents.push_back(i - 1);
  }
  const VesselTree aorta(points, parents, std::vector<std::optional<double>>(points.cols(), 12e-3));
  tree = aorta;
  map = TreeTopology(tree);
  pose.T_camera_model.translation() = Eigen::Vector3d(0, 0, 0.75) - tree.centroid();
  CatheterSettings bent;
  bent.tip_angle_deg = 65;
  const TreeLocation tip{0, 0.07};
  for (const double roll_deg : {0.0, 90.0, 180.0, 270.0}) {
    bent.roll_zero_deg = roll_deg;
    const SimulatedCatheter catheter(tree, bent, tip, 0);
    const Eigen::Vector3d end = catheter.truth().tip_model;
    ASSERT_GT((end - map.point(tip)).norm(), 5e-3);
    const auto trace =
        CatheterTracer(tree, {}).trace(shown({catheter.device(tree.points())}), pose, beliefAt(map.before(tip, 8e-3)));
    ASSERT_TRUE(trace) << roll_deg;
    const Eigen::Vector2d pixel = *pose.camera.project(pose.T_camera_model * end);
    EXPECT_LT((trace->seen.points_px.rightCols<1>() - pixel).norm(), 2) << roll_deg;

    // Half of the deflection is believed, and that vaguely. How long it is where no wall holds it tells the rest of it,
    // also along the beam, of which the image says nothing.
    const TreeFrame frame = map.frame(tip);
    const Eigen::Vector3d beside = end - map.point(tip);
    TipOffset offset{{0.5 * beside.dot(frame.normal), 0.5 * beside.dot(frame.binormal)},
                     Eigen::Matrix2d::Identity() * 9e-6};
    TipPlace place;
    place.branch = tip.branch;
    place.arc_m = tip.arc_m;
    const auto off_mm = [&] {
      const auto found = CatheterTracer(tree, {}).trace(shown({catheter.device(tree.points())}), pose,
                                                        beliefAt(map.before(tip, 8e-3)), offset);
      return 1e3 * (tipEnd(found->evidence, place).value() - end).norm();
    };
    const bool along_beam = std::abs((pose.T_camera_model.linear() * beside).z()) > 4e-3;
    EXPECT_EQ(off_mm() > 2, along_beam) << roll_deg;
    offset.free_m = beside.norm();
    EXPECT_LT(off_mm(), 1) << roll_deg;
  }
}

// A diagnostic catheter's tip of 15 mm lies across an aorta: at 60 deg to its axis it goes on more beside it than
// along.
TEST_F(CatheterTracerTest, FollowsATipThatLiesAcrossAWideVessel) {
  Eigen::Matrix3Xd points(3, 31);
  std::vector<int> parents;
  for (int i = 0; i < points.cols(); ++i) {
    points.col(i) << 4e-3 * i - 0.06, 0, 0;
    parents.push_back(i - 1);
  }
  tree = VesselTree(points, parents, std::vector<std::optional<double>>(points.cols(), 14e-3));
  map = TreeTopology(tree);
  pose.T_camera_model.translation() = Eigen::Vector3d(0, 0, 0.75) - tree.centroid();
  CatheterTracerSettings settings;
  settings.diameter_mm = 1.67;
  Device device;
  device.diameter_m = 1.67e-3;
  device.attenuation_per_m = 300;
  device.marker_length_m = 1.5e-3;
  device.marker_attenuation_per_m = 4000;
  for (const double side : {-1.0, 1.0}) {
    const double angle = degToRad(60);
    device.points.resize(3, 40);
    for (int i = 0; i < 25; ++i) device.points.col(i) << 2e-3 * i - 0.06, -side * 2e-3, 0;
    for (int i = 25; i < 40; ++i) {
      device.points.col(i) =
          device.points.col(24) + 1e-3 * (i - 24) * Eigen::Vector3d(std::cos(angle), side * std::sin(angle), 0);
    }
    const auto trace = CatheterTracer(tree, settings).trace(shown({device}), pose, beliefAt({0, 0.05}));
    ASSERT_TRUE(trace) << side;
    const Eigen::Vector2d pixel = *pose.camera.project(pose.T_camera_model * device.points.rightCols<1>());
    EXPECT_LT((trace->seen.points_px.rightCols<1>() - pixel).norm(), 3) << side;  // 1.2 mm.
    // The line to it is the catheter.
    for (const auto& seen : trace->seen.points_px.colwise()) {
      double off_px = 1e9;
      for (int i = 0; i < 10 * (device.points.cols() - 1); ++i) {
        const Eigen::Vector3d between =
            device.points.col(i / 10) + 0.1 * (i % 10) * (device.points.col(i / 10 + 1) - device.points.col(i / 10));
        off_px = std::min(off_px, (*pose.camera.project(pose.T_camera_model * between) - seen).norm());
      }
      EXPECT_LT(off_px, 5) << side;  // 2 mm.
    }
  }
}

// A tip that springs on from an ostium leaves a line behind it that is as dark as a band where it runs along the beam.
TEST_F(CatheterTracerTest, FollowsALineThatGoesOnBeyondWhereItsTipIsLookedFor) {
  const double spacing_m = 2e-3;
  Eigen::Matrix3Xd points(3, 66);
  std::vector<int> parents;
  Eigen::Vector3d at(-0.06, 0, 0);
  for (int i = 0; i < points.cols(); ++i) {
    points.col(i) = at;
    parents.push_back(i - 1);
    at += spacing_m * (i < 30   ? Eigen::Vector3d::UnitX()
                       : i < 36 ? Eigen::Vector3d::UnitZ()
                                : Eigen::Vector3d::UnitY());
  }
  tree = VesselTree(points, parents, std::vector<std::optional<double>>(points.cols(), 2.5e-3));
  map = TreeTopology(tree);
  pose.T_camera_model.translation() = Eigen::Vector3d(0, 0, 0.75) - tree.centroid();
  Device device;
  device.diameter_m = 1.35e-3;
  device.attenuation_per_m = 300;
  device.marker_length_m = 1.5e-3;
  device.marker_attenuation_per_m = 4000;
  CatheterTracerSettings settings;
  settings.diameter_mm = 1.35;
  // Believed in front of the bend into the beam: no further behind the tip than it is looked for, and further.
  for (const int tip : {40, 55}) {
    device.points = points.leftCols(tip);
    const auto trace = CatheterTracer(tree, settings).trace(shown({device}), pose, beliefAt({0, 0.056}));
    ASSERT_TRUE(trace) << tip;
    const Eigen::Vector2d pixel = *pose.camera.project(pose.T_camera_model * device.points.rightCols<1>());
    EXPECT_LT((trace->seen.points_px.rightCols<1>() - pixel).norm(), 2) << tip;
  }
}

// Against samples: of directions and lengths as they are known, each worth what the Gaussian gives it.
TEST(TipOffset, OfKnownLengthIsWhatSamplesSay) {
  test::Random random(3);
  Eigen::Matrix2d covariance;
  covariance << 4e-6, 1e-6, 1e-6, 2e-6;
  const TipOffset offset{{0.4e-3, -1.1e-3}, covariance, 0};
  const double length_m = 2.5e-3;
  const TipOffset known = ofLength(offset, length_m);
  double sum = 0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
  for (int i = 0; i < 200000; ++i) {
    const double angle = random.uniform(-kPi, kPi), length = length_m * (1 + random.normal() / 6);
    const Eigen::Vector2d x = length * Eigen::Vector2d(std::cos(angle), std::sin(angle)), from = x - offset.mean_m;
    const double weight = length * std::exp(-0.5 * from.dot(covariance.inverse() * from));
    sum += weight, mean += weight * x, second += weight * x * x.transpose();
  }
  mean /= sum;
  // Sums stop at two standard deviations of the length.
  EXPECT_LT((known.mean_m - mean).norm(), 0.05e-3);
  EXPECT_LT((known.covariance - (second / sum - mean * mean.transpose())).norm(), 0.2e-6);
  // Unknown, or contradicted: as it was.
  for (const double none : {0.0, 1.0}) {
    EXPECT_EQ(ofLength(offset, none).mean_m, offset.mean_m) << none;
    EXPECT_EQ(ofLength(offset, none).covariance, offset.covariance) << none;
  }
}

TEST_F(CatheterTracerTest, FindsNoneWhereNoneIs) {
  const TipBelief belief = beliefAt({map.branchCount() - 1, 5e-3});
  EXPECT_FALSE(tracer.trace(shown({}), pose, belief));
  EXPECT_FALSE(tracer.trace(cv::Mat(512, 512, CV_16UC1, cv::Scalar(20000)), pose, belief));
  SeenPose behind = pose;
  behind.T_camera_model.translation().z() = -1;
  EXPECT_FALSE(tracer.trace(shown({}), behind, belief));
}

TEST_F(CatheterTracerTest, RefusesWhatIsNoXray) {
  const TipBelief belief = beliefAt({1, 5e-3});
  EXPECT_NE(test::refusalOf([&] { (void)tracer.trace(cv::Mat(512, 512, CV_32FC1), pose, belief); }).find("image"),
            std::string::npos);
  CatheterTracerSettings settings;
  settings.ahead_mm = -1;
  EXPECT_NE(test::refusalOf([&] { CatheterTracer(tree, settings); }).find("ahead_mm"), std::string::npos);
}

// Evidence that is no number, or of a branch that is not there, changes nothing but time.
TEST_F(CatheterTracerTest, NoNumbersAreNoEvidence) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const PlaceEvidence& bad :
       {PlaceEvidence{1, nan, 0, {}}, PlaceEvidence{1, 1e-3, nan, {}}, PlaceEvidence{999, 0, 0, {}}}) {
    CatheterLocaliser told({}, tree), untold({}, tree);
    TipEvidence evidence;
    evidence.places = {bad};
    const TipBelief belief = told.update(evidence, {});
    EXPECT_NE(belief.status, BeliefStatus::kSeen);
    EXPECT_FALSE(belief.why.empty());
    EXPECT_EQ(belief.tip.arc_m, untold.predict({}).tip.arc_m);
  }
}

}  // namespace
}  // namespace angio::test
