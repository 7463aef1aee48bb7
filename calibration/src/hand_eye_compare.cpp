// SPDX-License-Identifier: GPL-2.0-or-later
#include <visp3/vision/vpHandEyeCalibration.h>

#include <Eigen/Core>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "angio/calibration/hand_eye_solvers.hpp"
#include "angio/geometry/visp.hpp"
#include "silence.hpp"

namespace angio::calibration {
namespace {

struct CvPoses {
  std::vector<cv::Mat> R, t;

  explicit CvPoses(const std::vector<Pose>& poses) {
    for (const Pose& T : poses) {
      cv::eigen2cv(Eigen::Matrix3d(T.linear()), R.emplace_back());
      cv::eigen2cv(Eigen::Vector3d(T.translation()), t.emplace_back());
    }
  }
};

// What a solver left in its outputs; it may be anything.
std::optional<Pose> poseOfOpenCv(const cv::Mat& R, const cv::Mat& t) {
  if (R.total() != 9 || t.total() != 3) return std::nullopt;
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  cv::cv2eigen(R.reshape(1, 3), rotation);
  cv::cv2eigen(t.reshape(1, 3), translation);
  Pose T = Pose::Identity();
  T.linear() = rotation;
  T.translation() = translation;
  if (!T.matrix().allFinite() || rotationDefect(T.linear()) > 1e-3) return std::nullopt;
  return T;
}

Pose meanZ(const HandEyeEquations& e, const Pose& X) {
  Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < e.size(); ++i) {
    const Pose Z = e.hands[i] * X * e.cameras[i];
    R += Z.linear();
    t += Z.translation() / static_cast<double>(e.size());
  }
  Pose mean = Pose::Identity();
  mean.linear() = nearestRotation(R);
  mean.translation() = t;
  return mean;
}

// Runs a solver that gives X and perhaps Z; what it throws is its failure.
template <typename Solver>
ComparedSolver tried(const std::string& name, const HandEyeEquations& e, const Solver& solver) {
  ComparedSolver compared;
  compared.name = name;
  try {
    std::optional<Pose> X, Z;
    solver(X, Z);
    if (X) {
      compared.transforms = HandEyeTransforms{*X, Z ? *Z : meanZ(e, *X)};
    } else {
      compared.failure = "gives no rotation";
    }
  } catch (const std::exception&) {
    compared.failure = "throws";
  }
  return compared;
}

void compareOpenCv(const HandEyeEquations& e, std::vector<ComparedSolver>& all) {
  const CvPoses hands(e.hands), cameras(e.cameras);
  const std::pair<const char*, cv::HandEyeCalibrationMethod> methods[] = {
      {"OpenCV Tsai", cv::CALIB_HAND_EYE_TSAI},
      {"OpenCV Park", cv::CALIB_HAND_EYE_PARK},
      {"OpenCV Horaud", cv::CALIB_HAND_EYE_HORAUD},
      {"OpenCV Andreff", cv::CALIB_HAND_EYE_ANDREFF},
      {"OpenCV Daniilidis", cv::CALIB_HAND_EYE_DANIILIDIS}};
  for (const auto& [name, method] : methods) {
    all.push_back(tried(name, e, [&, chosen = method](std::optional<Pose>& X, std::optional<Pose>&) {
      cv::Mat R, t;
      cv::calibrateHandEye(hands.R, hands.t, cameras.R, cameras.t, R, t, chosen);
      X = poseOfOpenCv(R, t);
    }));
  }
  // Its world is our object and its base ours: it takes T_camera_world and T_gripper_base.
  std::vector<Pose> inverse;
  for (const Pose& hand : e.hands) inverse.push_back(hand.inverse());
  const CvPoses gripper_base(inverse);
  const std::pair<const char*, cv::RobotWorldHandEyeCalibrationMethod> world_methods[] = {
      {"OpenCV Shah", cv::CALIB_ROBOT_WORLD_HAND_EYE_SHAH}, {"OpenCV Li", cv::CALIB_ROBOT_WORLD_HAND_EYE_LI}};
  for (const auto& [name, method] : world_methods) {
    all.push_back(tried(name, e, [&, chosen = method](std::optional<Pose>& X, std::optional<Pose>& Z) {
      cv::Mat R_base_world, t_base_world, R_gripper_cam, t_gripper_cam;
      cv::calibrateRobotWorldHandEye(cameras.R, cameras.t, gripper_base.R, gripper_base.t, R_base_world, t_base_world,
                                     R_gripper_cam, t_gripper_cam, chosen);
      const auto world = poseOfOpenCv(R_base_world, t_base_world), camera = poseOfOpenCv(R_gripper_cam, t_gripper_cam);
      if (!world || !camera) return;
      Z = world->inverse();
      X = camera->inverse();
    }));
  }
}

constexpr std::size_t kMaxForViSP = 40;

void compareViSP(const HandEyeEquations& e, std::vector<ComparedSolver>& all) {
  if (e.size() > kMaxForViSP) {
    all.push_back({"ViSP", std::nullopt, "was not asked: more than 40 poses"});
    return;
  }
  all.push_back(tried("ViSP", e, [&](std::optional<Pose>& X, std::optional<Pose>&) {
    std::vector<vpHomogeneousMatrix> cMo, rMe;
    for (std::size_t i = 0; i < e.size(); ++i) {
      cMo.push_back(toVisp(e.cameras[i]));
      rMe.push_back(toVisp(e.hands[i]));
    }
    vpHomogeneousMatrix eMc;
    const Silence silence;
    if (vpHandEyeCalibration::calibrate(cMo, rMe, eMc) != 0) return;
    X = fromVisp(eMc);
  }));
}

}  // namespace

std::vector<ComparedSolver> compareSolvers(const HandEyeEquations& equations) {
  std::vector<ComparedSolver> all;
  compareOpenCv(equations, all);
  compareViSP(equations, all);
  return all;
}

}  // namespace angio::calibration
