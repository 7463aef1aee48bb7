// SPDX-License-Identifier: GPL-2.0-or-later
#include "judgement.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace angio {
namespace {

constexpr int kFewestPoints = 12;

// Right poses of fully visible trees, from rendered X-ray images with the tangles and stubs an extractor misses,
// explain 73 % or more of the model and 85 % of the image (score 0.62); wrong poses, noise images and other patients'
// trees stay below 0.59 and 0.58, and below a score of 0.43 (tests/registration: none of them converges).
constexpr double kConvergedShare = 0.6;
constexpr double kConvergedScore = 0.5;
constexpr double kDivergedShare = 0.35;

// A fit whose best rival scores less than half stands alone: oriented fits with 70 % of the tree without contrast and ten stray
// curves score 0.16 or more and have rivals of at most 0.6; fits to other trees, in 300 trials, score 0.07 at most and have rivals
// of 0.89 or more.
constexpr double kAloneShare = 0.5, kAloneLeastShare = 0.25, kAloneScore = 0.15;
// A different pose with this share of the best score leaves the choice open.
constexpr double kAmbiguousShare = 0.9;

// A deformation larger than this (rms over the tree) is no breathing: nonrigid points can follow any line, also one
// that is no vessel of this tree. Livers move by up to 25 mm with breath, most of it as one.
constexpr double kMostDeformation_m = 10e-3;

// A solver that still moves the picture by more than this has run out of iterations, not come to rest [px].
constexpr double kAtRest_px = 0.5;

double rms(const Eigen::Matrix3Xd& displacements_m) {
  return displacements_m.cols() == 0
             ? 0.0
             : std::sqrt(displacements_m.squaredNorm() / static_cast<double>(displacements_m.cols()));
}

std::string percent(double share) { return std::to_string(static_cast<int>(100 * share + 0.5)) + " %"; }

}  // namespace

bool tooFewPoints(RegistrationResult& result) {
  if (result.points_3d >= kFewestPoints && result.points_2d >= kFewestPoints) return false;
  result.status = RegistrationStatus::kTooFewPoints;
  result.reason = std::to_string(result.points_3d) + " model and " + std::to_string(result.points_2d) +
                  " image points, at least " + std::to_string(kFewestPoints) + " of each are needed";
  return true;
}

namespace {

// What an agreement must reach.
struct Threshold {
  double share, score;
};

void judgeBy(const Threshold& threshold, RegistrationResult& result) {
  const Agreement& a = result.agreement;
  const double least = std::min(a.model_explained, a.image_explained), most = std::max(a.model_explained, a.image_explained);
  result.status = RegistrationStatus::kAmbiguous;
  result.reason = "image explains " + percent(a.model_explained) + " of the model in view, model explains " +
                  percent(a.image_explained) + " of the image";
  if (!result.T_camera_model.matrix().allFinite() || !result.covariance || a.model_points < kFewestPoints) {
    result.status = RegistrationStatus::kDiverged;
    result.reason = "no model in view, or no full-rank system at the solution";
  } else if (least < threshold.share || a.score() < threshold.score) {
    if (most < kDivergedShare) result.status = RegistrationStatus::kDiverged;
  } else if (result.last_step_px > kAtRest_px) {
    result.reason = "the solver had not come to rest";
  } else if (rms(result.displacements_m) > kMostDeformation_m) {
    result.reason = "the tree had to be deformed beyond what an organ does";
  } else {
    result.status = RegistrationStatus::kConverged;
    result.reason.clear();
  }
}

}  // namespace

void judge(RegistrationResult& result) { judgeBy({kConvergedShare, kConvergedScore}, result); }

void judgeAgainst(double rival_share, RegistrationResult& result) {
  result.ambiguity = rival_share;
  const bool alone = rival_share <= kAloneShare;
  judgeBy(alone ? Threshold{kAloneLeastShare, kAloneScore} : Threshold{kConvergedShare, kConvergedScore}, result);
  if (result.status == RegistrationStatus::kConverged && rival_share > kAmbiguousShare) {
    result.status = RegistrationStatus::kAmbiguous;
    result.reason = "a different pose fits nearly as well";
  }
}

std::optional<Matrix6d> covarianceOf(const NormalEquations& at_solution, const std::vector<Pull>& pulls,
                                     const Pose& T_camera_centred, const Eigen::Vector3d& centroid) {
  // Unit lengths of the tree's size make metres and radians comparable for the rank test.
  Vector6d scale;
  scale << Eigen::Vector3d::Constant(0.05), Eigen::Vector3d::Ones();
  const Matrix6d scaled = scale.asDiagonal() * at_solution.H * scale.asDiagonal();
  if (!scaled.allFinite()) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(scaled);
  if (!(eigen.eigenvalues()[0] > 1e-10 * eigen.eigenvalues()[5])) return std::nullopt;

  // Two residuals a point; a point of small weight counts for as much as it weighs.
  double weights = 0, largest_weight = 1e-12, squares_px2 = 0;
  for (const Pull& pull : pulls) {
    weights += pull.weight.sum();
    largest_weight = std::max(largest_weight, pull.weight.maxCoeff());
    squares_px2 += pull.weighted_squares_px2;
  }
  const double residuals = 2 * weights / largest_weight;
  const double variance_px2 = squares_px2 / std::max(1.0, residuals - 6);
  const Matrix6d about_centroid = variance_px2 * at_solution.H.inverse();

  // From the twist about the centroid, model axes, to (t, rotation in camera axes): t' = R (v + c x w), dw = R w.
  const Eigen::Matrix3d R = T_camera_centred.linear();
  Matrix6d J = Matrix6d::Zero();
  J.topLeftCorner<3, 3>() = R;
  J.topRightCorner<3, 3>() = R * skew(centroid);
  J.bottomRightCorner<3, 3>() = R;
  return Matrix6d(J * about_centroid * J.transpose());
}

}  // namespace angio
