// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/bead_detection.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "angio/calibration/direct_linear.hpp"
#include "angio/geometry/distortion.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/shared_data.hpp"
#include "bead_scenes.hpp"

namespace angio::test {
namespace {

const XrayCamera kCamera = XrayCamera::centered(1024, 1024, 0.25e-3, 1.1);

struct Errors {
  int found = 0, of = 0, false_ones = 0;
  double rms_px = 0, worst_px = 0, normalised = 0;
};

Errors errorsOf(const BeadPhantom& phantom, const Pose& T, const std::vector<BeadDetection>& seen) {
  Errors errors;
  std::vector<bool> used(seen.size(), false);
  for (const Bead& bead : phantom.beads) {
    const Eigen::Vector2d px = *kCamera.project(T * bead.position_m);
    if (px.minCoeff() < 5 || px.maxCoeff() > 1018) {
      // Cut by the edge: nobody wants it, but who finds it is right.
      for (std::size_t i = 0; i < seen.size(); ++i) used[i] = used[i] || (seen[i].center_px - px).norm() < 2;
      continue;
    }
    ++errors.of;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const double error = (seen[i].center_px - px).norm();
      if (error > 2 || used[i]) continue;
      used[i] = true;
      ++errors.found;
      errors.rms_px += error * error;
      errors.worst_px = std::max(errors.worst_px, error);
      errors.normalised += error * error / (2 * seen[i].std_px * seen[i].std_px);
      break;
    }
  }
  errors.false_ones = static_cast<int>(std::count(used.begin(), used.end(), false));
  errors.rms_px = std::sqrt(errors.rms_px / std::max(1, errors.found));
  errors.normalised /= std::max(1, errors.found);
  return errors;
}

TEST(BeadDetection, FindsBeadsToATenthOfAPixelAndTellsThemApart) {
  const BeadPhantom phantom = helixPhantom();
  test::Random random(1);
  std::vector<Eigen::Matrix3d> likely;
  for (int view = 0; view < 3; ++view) {
    const Eigen::Matrix3d R = test::anyRotation(random);
    const Pose T = test::phantomView(phantom, R, Eigen::Vector3d(random.uniform(-0.01, 0.01), 0.005, 0.78));
    const auto seen = detectBeads(test::beadImage(phantom, kCamera, T, {}, random));
    const Errors errors = errorsOf(phantom, T, seen);
    EXPECT_GT(errors.found, 0.8 * errors.of);  // Of a helix seen along its axis a fifth is hidden.
    EXPECT_EQ(errors.false_ones, 0);
    EXPECT_LT(errors.rms_px, 0.1 * std::sqrt(2.0)) << view;
    // The fit's own uncertainty: its square is right on average to a factor of two, noise that is blurred included.
    EXPECT_GT(errors.normalised, 0.5) << view;
    EXPECT_LT(errors.normalised, 2.0) << view;
    const BeadMatch match = matchBeads("view", phantom, seen, likely);
    likely.push_back(match.R_camera_phantom);
    EXPECT_GT(match.matched, 0.95 * errors.found);
    for (std::size_t i = 0; i < seen.size(); ++i) {
      if (!match.bead[i]) continue;
      const Bead& bead = phantom.beads[static_cast<std::size_t>(*match.bead[i])];
      EXPECT_LT((seen[i].center_px - *kCamera.project(T * bead.position_m)).norm(), 2);
    }
  }
}

TEST(BeadDetection, SeparatesShadowsThatOverlapAndThoseThatAreCut) {
  BeadPhantom phantom;
  const double pixel_m = 0.78 * 0.25e-3 / 1.1;  // At the phantom's depth.
  const auto place = [&](double x_px, double y_px, double depth_m, double radius_m) {
    const double stretch = (0.78 + depth_m) / 0.78;
    phantom.beads.push_back(
        {{(x_px - 511.5) * pixel_m * stretch, (y_px - 511.5) * pixel_m * stretch, depth_m}, radius_m});
  };
  place(300, 300, 0, 1.6e-3);  // Large under small, large under large, and two small ones.
  place(307, 302, 0.04, 0.8e-3);
  place(500, 400, 0, 1.6e-3);
  place(512, 404, 0.05, 1.6e-3);
  place(700, 700, 0, 0.8e-3);
  place(704, 706, 0.05, 0.8e-3);
  place(2.5, 600, 0, 1.6e-3);  // Cut by the border.
  Pose T = Pose::Identity();
  T.translation().z() = 0.78;
  test::Random random(5);
  const auto seen = detectBeads(test::beadImage(phantom, kCamera, T, {}, random));
  for (const Bead& bead : phantom.beads) {
    const Eigen::Vector2d px = *kCamera.project(T * bead.position_m);
    double nearest = 1e9, sigma = 1;
    for (const BeadDetection& one : seen) {
      const double distance = (one.center_px - px).norm();
      if (distance < nearest) sigma = one.std_px;
      nearest = std::min(nearest, distance);
    }
    EXPECT_LT(nearest, std::max(0.15, 5 * sigma)) << px.transpose();
  }
  EXPECT_EQ(seen.size(), phantom.beads.size());
}

TEST(BeadDetection, AnEmptyFieldHasNone) {
  test::Random random(6);
  EXPECT_TRUE(detectBeads(test::beadImage({}, kCamera, Pose::Identity(), {}, random)).empty());
}

class BeadMatching : public testing::Test {
 protected:
  // What a detector would give, with missing beads and false ones.
  std::vector<BeadDetection> detections(const Eigen::Matrix3d& R, double missing, int false_ones) {
    const Pose T = test::phantomView(phantom_, R, {0.004, -0.006, 0.76});
    std::vector<BeadDetection> seen;
    truth_.clear();
    for (int i = 0; i < static_cast<int>(phantom_.beads.size()); ++i) {
      const Bead& bead = phantom_.beads[static_cast<std::size_t>(i)];
      const double y = random_.normal(), x = random_.normal(), size = random_.normal();
      if (random_.uniform(0, 1) < missing) continue;
      const double radius_px = bead.radius_m / 0.76 * 4400 * (1 + 0.04 * size);
      seen.push_back({*kCamera.project(T * bead.position_m) + 0.1 * Eigen::Vector2d(x, y), 0.1, radius_px, {}, {}});
      truth_.push_back(i);
    }
    for (int i = 0; i < false_ones; ++i) {
      const double x = random_.uniform(200, 800), y = random_.uniform(200, 800), r = random_.uniform(4, 10);
      seen.push_back({{x, y}, 0.1, r, {}, {}});
      truth_.push_back(-1);
    }
    return seen;
  }

  BeadPhantom phantom_ = helixPhantom();
  test::Random random_{7};
  std::vector<int> truth_;
};

TEST_F(BeadMatching, StandsMissingAndFalseBeadsOfEitherPhantom) {
  for (const auto& phantom : {helixPhantom(), platePhantom()}) {
    phantom_ = phantom;
    for (int i = 0; i < 3; ++i) {
      const auto seen = detections(test::anyRotation(random_), 0.2, 8);
      const BeadMatch match = matchBeads("view", phantom_, seen);
      int right = 0, wrong = 0;
      for (std::size_t k = 0; k < seen.size(); ++k) {
        if (match.bead[k]) (*match.bead[k] == truth_[k] ? right : wrong) += 1;
      }
      EXPECT_EQ(wrong, 0) << phantom.name;
      EXPECT_GT(right, 0.95 * (static_cast<double>(seen.size()) - 8)) << phantom.name;
    }
  }
}

TEST_F(BeadMatching, StandsAnIntensifiersPincushion) {
  // Its bend and the perspective of a deep phantom look alike until both are found together.
  const auto distortion = DetectorDistortion::intensifier(kCamera, {0.04, 0, degToRad(2.5), 0});
  for (int i = 0; i < 4; ++i) {
    auto seen = detections(test::anyRotation(random_), 0.05, 0);
    for (BeadDetection& one : seen) one.center_px = distortion.distorted(one.center_px);
    const BeadMatch match = matchBeads("view", phantom_, seen);
    int right = 0;
    for (std::size_t k = 0; k < seen.size(); ++k) right += match.bead[k] == truth_[k];
    EXPECT_GT(right, 0.9 * static_cast<double>(seen.size())) << i;
  }
}

TEST_F(BeadMatching, RefusesWhatIsNoViewOfThePhantom) {
  std::vector<BeadDetection> seen = detections(test::anyRotation(random_), 0, 0);
  for (BeadDetection& one : seen) one.center_px = {random_.uniform(200, 800), random_.uniform(200, 800)};
  EXPECT_NE(test::refusalOf([&] { matchBeads("v.png", phantom_, seen); }).find("v.png: beads"), std::string::npos);
  seen[4].radius_px.reset();
  EXPECT_NE(test::refusalOf([&] { matchBeads("v.csv", phantom_, seen); }).find("radius_px"), std::string::npos);
  seen.resize(4);
  EXPECT_NE(test::refusalOf([&] { matchBeads("v.csv", phantom_, seen); }).find("must be at least 12"),
            std::string::npos);
}

// Real shadows have soft, stretched rims, and wires touch some: each is one ball. 29 and 38 beads are seen whole, two
// of them on thick wire in each picture.
TEST(BeadDetection, ARealBeadIsOneDetection) {
  NEED_SHARED_DATA("guide3d-calibration/cube_16709.jpg");
  for (const auto& [name, whole] : {std::pair("16709", 27), std::pair("16710", 36)}) {
    const cv::Mat picture = cv::imread(sharedData(std::string("guide3d-calibration/cube_") + name + ".jpg"), 0);
    std::vector<Eigen::Vector2d> beads;
    for (const BeadDetection& seen : detectBeads(picture, BeadDetectionSettings().throughIntensifier())) {
      if (seen.contrast.value() > 0.8 && seen.radius_px.value() > 4) beads.push_back(seen.center_px);
    }
    EXPECT_GE(static_cast<int>(beads.size()), whole) << name;
    for (std::size_t i = 0; i < beads.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) EXPECT_GT((beads[i] - beads[j]).norm(), 8) << name << ": " << beads[i];
    }
  }
}

}  // namespace
}  // namespace angio::test
