// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/perception.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "stage.hpp"

namespace angio::test {
namespace {

class DeformedPatients : public testing::Test {
 protected:
  // The tree as a deep breath has it: one end has gone by so much, the other hardly at all.
  VesselTree deformed(double by_m) const {
    Eigen::Matrix3Xd points = stage_.tree.points();
    for (Eigen::Index i = 0; i < points.cols(); ++i) points.col(i) += displacement(points.col(i), by_m);
    return VesselTree(points, stage_.tree.parents(), stage_.tree.radii());
  }
  static Eigen::Vector3d displacement(const Eigen::Vector3d& p, double by_m) {
    constexpr double kReach_m = 0.06;
    const double off = (p.y() - 0.06) / kReach_m;
    return by_m * std::exp(-0.5 * off * off) * Eigen::Vector3d(0.8, 0.6, 0);
  }
  Perception perception(double max_deformation_mm, const std::optional<PointOfInterest>& place = std::nullopt) const {
    PerceptionSettings settings = stage_.settings.perception;
    settings.tracker.follow_motion = true;
    settings.tracker.max_deformation_mm = max_deformation_mm;
    return Perception(settings, stage_.settings.carm, stage_.settings.T_dsa_cb, stage_.tree, place);
  }
  // What a perception that has seen the patient before makes of the tree as it is now.
  Observation look(Perception perception, const VesselTree& now) const {
    const Observation before = perception.observe(stage_.frame(1), stage_.state(1));
    EXPECT_EQ(before.registration.status, RegistrationStatus::kConverged);
    perception.accept(before, stage_.state(1));
    return perception.observe(stage_.frameOf(now, 2), stage_.state(2));
  }
  Eigen::Vector2d pixel(const Pose& T_camera_model, const Eigen::Vector3d& p) const {
    return *stage_.settings.carm.camera().project(T_camera_model * p);
  }
  test::Stage stage_;
};

// A rigid tree explains a breath in part, and is rightly not believed; a deformed one says where each vessel is, to
// less than the third of a millimetre that is a pixel here.
TEST_F(DeformedPatients, AreSeenWhereTheyAre) {
  constexpr double kBreath_m = 0.02;
  const VesselTree now = deformed(kBreath_m);
  EXPECT_EQ(look(perception(0), now).registration.status, RegistrationStatus::kAmbiguous);
  const RegistrationResult seen = look(perception(10), now).registration;
  ASSERT_EQ(seen.status, RegistrationStatus::kConverged) << seen.reason;
  ASSERT_EQ(seen.displacements_m.cols(), stage_.tree.size());
  const Pose truth = stage_.settings.carm.T_camera_patient(stage_.joints);
  double rigid_px = 0, deformed_px = 0;
  for (int i = 0; i < now.size(); ++i) {
    const Eigen::Vector2d at = pixel(truth, now.points().col(i));
    const Eigen::Vector3d p = stage_.tree.points().col(i);
    rigid_px += (pixel(seen.T_camera_model, p) - at).norm() / now.size();
    deformed_px += (pixel(seen.T_camera_model, p + seen.displacements_m.col(i)) - at).norm() / now.size();
  }
  RecordProperty("rigid_px", std::to_string(rigid_px));
  RecordProperty("bent_px", std::to_string(deformed_px));
  EXPECT_LT(deformed_px, 1);
  EXPECT_GT(rigid_px, 2 * deformed_px);
  // One view of a deformed tree does not determine depth, and the covariance says so: millimetres, not the rigid fit's
  // tenths.
  const double depth_mm = 1e3 * (truth * stage_.tree.centroid() - seen.T_camera_model * stage_.tree.centroid()).z();
  const double depth_std_mm = 1e3 * std::sqrt((*seen.covariance)(2, 2));
  EXPECT_GT(depth_std_mm, 1);
  EXPECT_LT(std::abs(depth_mm), 3 * depth_std_mm);
}

// A watched place is seen where it is, by what deforms the tree and by the image around it.
TEST_F(DeformedPatients, AreSeenWhereTheyAreWatched) {
  const VesselTree now = deformed(0.02);
  const Pose truth = stage_.settings.carm.T_camera_patient(stage_.joints);
  int places = 0;
  for (int i = 20; i < now.size(); i += now.size() / 8) {
    const Eigen::Vector3d p = stage_.tree.points().col(i);
    const Observation observation = look(perception(10, PointOfInterest{p, 15e-3, 2e-3}), now);
    ASSERT_TRUE(observation.place);
    const Eigen::Vector2d at = pixel(truth, now.points().col(i));
    const Eigen::Vector2d nearby_px =
        observation.place->image_shift ? observation.place->image_shift->shift_px : Eigen::Vector2d::Zero();
    const double rigid_px = (pixel(observation.registration.T_camera_model, p) - at).norm();
    if (rigid_px < 3) continue;
    EXPECT_LT((pixel(observation.place->T_camera_model, p) + nearby_px - at).norm(), 0.5 * rigid_px) << i;
    ++places;
  }
  EXPECT_GE(places, 2);
  EXPECT_FALSE(look(perception(10), now).place);
  EXPECT_FALSE(look(perception(0, PointOfInterest{now.points().col(0), 15e-3, 2e-3}), now).place) << "ambiguous";
}

// What a breath does not do is not a breath.
TEST_F(DeformedPatients, AreNotBelievedBeyondABreath) {
  EXPECT_NE(look(perception(PatientTrackerSettings().max_deformation_mm), deformed(0.02)).registration.status,
            RegistrationStatus::kConverged);
}

TEST_F(DeformedPatients, AreNotTakenForOthers) {
  const Eigen::Vector3d c = stage_.tree.centroid();
  for (unsigned seed = 1; seed <= 4; ++seed) {
    test::Random random(seed);
    const Eigen::Matrix3d turn = expSO3(0.8 * random.direction());
    const Eigen::Matrix3Xd points = (turn * (stage_.tree.points().colwise() - c)).colwise() + c;
    const VesselTree turned(points, stage_.tree.parents(), stage_.tree.radii());
    const VesselTree another = test::branchingTree(60 + seed);
    for (const VesselTree& other : {turned, another}) {
      EXPECT_NE(look(perception(10), other).registration.status, RegistrationStatus::kConverged) << seed;
    }
  }
}

// A wide vessel with arteries that leave it for the image's border, even and without branches, as those of the neck
// leave an aortic arch: the wide one's first `points` of 49, with an artery at every twelfth.
VesselTree archWithNeck(int points) {
  std::vector<Eigen::Vector3d> places;
  std::vector<int> parents;
  std::vector<std::optional<double>> radii;
  const auto add = [&](const Eigen::Vector3d& p, int parent, double radius_m) {
    places.push_back(p);
    parents.push_back(parent);
    radii.emplace_back(radius_m);
    return static_cast<int>(places.size()) - 1;
  };
  int trunk = -1;
  for (int i = 0; i < points; ++i) {
    const double x = -0.06 + 0.0025 * i;
    const Eigen::Vector3d at(x, 0.03 + 4 * x * x, 0.02 * std::cos(25 * x));
    trunk = add(at, trunk, 0.008);
    if (i % 12 != 6) continue;
    int artery = trunk;
    const double lean = 0.15 * (i / 12 - 1.5);
    for (int k = 1; k <= 60; ++k) {
      const double up = 0.0025 * k;
      artery = add(at + Eigen::Vector3d(lean * up + 0.004 * std::sin(30 * up + i), -up, 0.1 * up), artery, 0.0021);
    }
  }
  const Eigen::Map<const Eigen::Matrix3Xd> matrix(places.front().data(), 3, static_cast<Eigen::Index>(places.size()));
  return VesselTree(matrix, parents, radii);
}

// Draws a catheter from the lower border to beside the tree.
void drawCatheter(cv::Mat& image) {
  cv::Mat absorbed = cv::Mat::zeros(image.size(), CV_32FC1), transmitted, bright;
  const std::vector<std::vector<cv::Point>> line{{{40, 447}, {50, 400}, {70, 350}, {100, 300}, {110, 280}}};
  cv::polylines(absorbed, line, false, cv::Scalar(0.5), 5, cv::LINE_AA);
  cv::exp(-absorbed, transmitted);
  image.convertTo(bright, CV_32F);
  cv::Mat(bright.mul(transmitted)).convertTo(image, image.type());
}

// One artery of four is not filled, and the image calls another one a catheter: what is left does not suffice. The real
// catheter, which is in view before it comes to the tree, is no vessel.
TEST(ArteriesThatLookLikeCatheters, AreTakenBackAlongATrackedTree) {
  test::Stage stage;
  stage.tree = archWithNeck(49);
  stage.joints = stage.settings.carm.jointsFor({0, 0}, stage.tree.centroid());
  const VesselTree filled = archWithNeck(40);
  for (const int number : {1, 2, 3, 4, 6}) {
    Perception perception(stage.settings.perception, stage.settings.carm, stage.settings.T_dsa_cb, stage.tree);
    const CArmState state = stage.state(number);
    perception.accept(stage.settings.carm.T_camera_patient(stage.joints), Matrix6d(1e-8 * Matrix6d::Identity()),
                      perception.placeOf(state));
    XrayFrame frame = stage.frameOf(filled, number);
    drawCatheter(frame.image);
    const Observation seen = perception.observe(frame, state);
    EXPECT_EQ(seen.registration.status, RegistrationStatus::kConverged) << number << ": " << seen.registration.reason;
    EXPECT_GT(seen.centerline.size(), ofKind(seen.curves, CurveKind::kVessel).size() + 20) << number;
    const auto low = [](const Centerline2d& line) { return (line.points_px.row(1).array() > 330).count(); };
    EXPECT_GT(low(seen.curves), 20) << number;
    EXPECT_EQ(low(seen.centerline), 0) << number;
  }
}

}  // namespace
}  // namespace angio::test
