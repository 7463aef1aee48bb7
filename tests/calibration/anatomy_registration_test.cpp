// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/anatomy_registration.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "angio/geometry/decompositions.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/results/case_run.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/random.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

const Eigen::Vector3d kCenter(0.5, -0.1, 0.3);  // Models are often far from their origin.

struct Anatomy {
  Pose T_dsa_cb;
  std::vector<AnatomyView> views;
};

// Views at random angles, a run each, with the errors that the settings speak of.
Anatomy simulated(test::Random& random, int views, const AnatomyRegistrationSettings& settings, double noise) {
  Anatomy anatomy;
  anatomy.T_dsa_cb = expSE3(random.twist(0, 1));
  anatomy.T_dsa_cb.translation() = random.vector(0.02) - anatomy.T_dsa_cb.linear() * kCenter;
  const CArmGeometry carm;
  for (int i = 0; i < views; ++i) {
    AnatomyView view;
    view.name = view.run = std::to_string(i);
    CArmJoints joints = CArmJoints::Zero();
    joints.head<2>() << random.uniform(-0.8, 0.8), random.uniform(-0.5, 0.5);
    view.T_camera_patient = carm.T_camera_patient(joints);
    view.isocenter_camera_m = view.T_camera_patient.translation();
    Pose turn = Pose::Identity();
    turn.linear() = expSO3(random.vector(noise * degToRad(settings.angle_std_deg)));
    turn.translation() = view.isocenter_camera_m - turn.linear() * view.isocenter_camera_m;
    const Eigen::Vector3d shift = random.vector(noise * 1e-3 * settings.shift_std_mm);
    view.T_camera_model = turn * view.T_camera_patient * Eigen::Translation3d(shift) * anatomy.T_dsa_cb;
    // A registration is right across the beam and weak along it, about the model's centre.
    Vector6d sigmas;
    sigmas << 0.1e-3, 0.1e-3, 3e-3, degToRad(0.2), degToRad(0.2), degToRad(0.1);
    const Eigen::Vector3d center = view.T_camera_model * kCenter;
    Vector6d error = sigmas;
    const Eigen::Vector3d of_rotation = random.vector(noise), of_translation = random.vector(noise);
    error.head<3>() = error.head<3>().cwiseProduct(of_translation);
    error.tail<3>() = error.tail<3>().cwiseProduct(of_rotation);
    view.T_camera_model.linear() = expSO3(error.tail<3>()) * view.T_camera_model.linear();
    view.T_camera_model.translation() = center + error.head<3>() - view.T_camera_model.linear() * kCenter;
    Matrix6d from_center = Matrix6d::Identity();
    from_center.topRightCorner<3, 3>() = skew(view.T_camera_model.linear() * kCenter);
    view.covariance = from_center * sigmas.cwiseAbs2().asDiagonal() * from_center.transpose();
    anatomy.views.push_back(view);
  }
  return anatomy;
}

int outliersOf(const AnatomyResult& result) {
  return static_cast<int>(
      std::count_if(result.views.begin(), result.views.end(), [](const auto& view) { return view.outlier; }));
}

Vector6d poseErrorOf(const Pose& found, const Pose& truth) {
  Vector6d error;
  error << truth.translation() - found.translation(), logSO3(truth.linear() * found.linear().transpose());
  return error;
}

TEST(AnatomyRegistration, IsExactWithoutErrors) {
  test::Random random(1);
  const AnatomyRegistrationSettings settings;
  for (const int views : {1, 2, 5}) {
    const Anatomy anatomy = simulated(random, views, settings, 0);
    const AnatomyResult result = registerAnatomy(anatomy.views, kCenter, settings);
    EXPECT_LT(poseErrorOf(result.T_dsa_cb, anatomy.T_dsa_cb).norm(), 1e-9);
    for (const RunShift& run : result.runs) EXPECT_LT(run.shift_m.norm(), 1e-9);
  }
}

TEST(AnatomyRegistration, CovarianceIsRight) {
  const AnatomyRegistrationSettings settings;
  test::Random random(2);
  const int trials = 200;
  double nees = 0;
  for (int i = 0; i < trials; ++i) {
    const Anatomy anatomy = simulated(random, 6, settings, 1);
    const AnatomyResult result = registerAnatomy(anatomy.views, kCenter, settings);
    const Vector6d error = poseErrorOf(result.T_dsa_cb, anatomy.T_dsa_cb);
    nees += squaredMahalanobis(error, result.covariance) / trials;
  }
  // 3.3 standard deviations of the mean of 200 chi^2 (6).
  EXPECT_NEAR(nees, 6, 3.3 * std::sqrt(12.0 / trials));
}

TEST(AnatomyRegistration, AViewReversedInDepthIsNamedAndLeftOut) {
  const AnatomyRegistrationSettings settings;
  test::Random random(3);
  Anatomy anatomy = simulated(random, 5, settings, 1);
  Pose& wrong = anatomy.views[2].T_camera_model;
  wrong.linear() = expSO3({degToRad(6), degToRad(4), 0}) * wrong.linear();
  wrong.translation() += Eigen::Vector3d(0, 0, 0.01);
  const AnatomyResult result = registerAnatomy(anatomy.views, kCenter, settings);
  EXPECT_EQ(outliersOf(result), 1);
  EXPECT_TRUE(result.views[2].outlier);
  EXPECT_LT(poseErrorOf(result.T_dsa_cb, anatomy.T_dsa_cb).tail<3>().norm(), degToRad(1));
}

TEST(AnatomyRegistration, WhatCannotBeIsRefused) {
  const AnatomyRegistrationSettings settings;
  test::Random random(4);
  Anatomy anatomy = simulated(random, 4, settings, 1);
  const auto refusal = [&](const std::vector<AnatomyView>& views) {
    return test::refusalOf([&] { registerAnatomy(views, kCenter, settings); });
  };
  EXPECT_NE(refusal({}).find("at least one"), std::string::npos);
  auto views = anatomy.views;
  views[1].name = views[0].name;
  EXPECT_NE(refusal(views).find("must be given once"), std::string::npos);
  views = anatomy.views;
  views[1].T_camera_model = views[0].T_camera_model;
  EXPECT_NE(refusal(views).find("views = 1: is a copy of 0"), std::string::npos);
  views = anatomy.views;
  for (AnatomyView& view : views)
    view.T_camera_model.linear() = expSO3(random.vector(1)) * view.T_camera_model.linear();
  EXPECT_NE(refusal(views).find("agree on one T_dsa_cb"), std::string::npos);
}

TEST(AnatomyAngles, HostileFilesAreNamed) {
  test::TemporaryFolder folder;
  const auto refusal = [&](const std::string& content) {
    return test::refusalOf([&] { readAnatomyAngles(folder.write("angles.yaml", content)); });
  };
  EXPECT_NE(refusal("").find("views: is missing"), std::string::npos);
  EXPECT_NE(refusal("views: []\n").find("must be a list"), std::string::npos);
  EXPECT_NE(refusal("views:\n  - name: a\n    primary_deg: 3\n").find("secondary_deg: is missing"), std::string::npos);
  EXPECT_NE(refusal("views:\n  - name: a\n    primary_deg: 300\n    secondary_deg: 1\n").find("primary_deg = 300"),
            std::string::npos);
  const std::string one = "  - name: a\n    primary_deg: 3\n    secondary_deg: 1\n";
  EXPECT_NE(refusal("views:\n" + one + one).find("must be given once"), std::string::npos);
  EXPECT_NE(refusal("source_isocentre_distance_mm: -1\nviews:\n" + one).find("source_isocentre_distance_mm"),
            std::string::npos);
}

// The four real runs of the static phantom: one T_dsa_cb and a shift a run explain all, and three predict the fourth.
class StaticPhantom : public testing::Test {
 protected:
  void SetUp() override {
    const CaseSet set = readCaseSet(test::exampleData("static-phantom/cases.yaml"));
    const AnatomyAngleSet angles = readAnatomyAngles(test::exampleData("static-phantom/angles.yaml"));
    tree_ = std::make_unique<VesselTree>(readVesselTree(set.cases[0].tree_path));
    CaseRunSettings how;
    how.registration = registrationSettingsNamed(OrientedKernelSettings::kName);
    how.starts.box_rotation_deg = 10;
    how.starts.box_translation_mm = 30;
    const auto outcomes = runCases(set, how);
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      CArmGeometry carm;
      carm.source_isocenter_distance_m = *angles.views[i].source_isocenter_distance_m;
      AnatomyView view;
      view.name = view.run = angles.views[i].name;
      view.T_camera_patient = carm.T_camera_patient(angles.views[i].joints);
      view.isocenter_camera_m = view.T_camera_patient.translation();
      view.T_camera_model = outcomes[i].result.T_camera_model;
      view.covariance = *outcomes[i].result.covariance;
      views_.push_back(view);
      seen_.push_back({readCenterline(*set.cases[i].views[0].centerline_path), set.cases[i].views[0].camera});
    }
  }
  template <typename T>
  static std::vector<T> without(std::vector<T> all, std::size_t i) {
    all.erase(all.begin() + static_cast<std::ptrdiff_t>(i));
    return all;
  }

  std::unique_ptr<VesselTree> tree_;
  std::vector<AnatomyView> views_;
  std::vector<SeenAnatomy> seen_;
};

TEST_F(StaticPhantom, ThreeRunsPredictTheFourthsRotation) {
  const AnatomyResult all = registerAnatomy(views_, tree_->centroid());
  EXPECT_EQ(outliersOf(all), 0);
  for (std::size_t i = 0; i < views_.size(); ++i) {
    const auto views = without(views_, i);
    const AnatomyResult apart = registerAnatomy(views, tree_->centroid());
    for (const AnatomyResult& result : {apart, refineAnatomy(apart, views, without(seen_, i), *tree_)}) {
      const Eigen::Matrix3d predicted = views_[i].T_camera_patient.linear() * result.T_dsa_cb.linear();
      EXPECT_LT(radToDeg(rotationAngle(views_[i].T_camera_model.linear() * predicted.transpose())), 2)
          << views_[i].name;
    }
    // The held-out error in the result is the same thing.
    const Eigen::Matrix3d predicted = views_[i].T_camera_patient.linear() * apart.T_dsa_cb.linear();
    EXPECT_NEAR(*all.views[i].held_out_rotation_rad,
                rotationAngle(views_[i].T_camera_model.linear() * predicted.transpose()), 1e-6);
  }
}

TEST_F(StaticPhantom, JointPointsAndPosesAgree) {
  const AnatomyResult poses = registerAnatomy(views_, tree_->centroid());
  const AnatomyResult points = refineAnatomy(poses, views_, seen_, *tree_);
  // Both weigh the same angles; what differs is how each registration's information enters: what a deformation leaves
  // open counts in the poses' covariances alone.
  EXPECT_LT(radToDeg(rotationAngle(points.T_dsa_cb.linear() * poses.T_dsa_cb.linear().transpose())), 0.5);
  for (std::size_t r = 0; r < points.runs.size(); ++r) {
    EXPECT_LT((points.runs[r].shift_m - poses.runs[r].shift_m).norm(), 3e-3);
  }
}

}  // namespace
}  // namespace angio::test
