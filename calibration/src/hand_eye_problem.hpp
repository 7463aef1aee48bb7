// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/calibration/hand_eye.hpp"

namespace angio::calibration {

/// (t + dt, exp(dw) R) of a pose.
inline Pose movedBy(const Pose& T, const Vector6d& twist) {
  Pose moved = T;
  moved.translation() += twist.head<3>();
  moved.linear() = expSO3(twist.tail<3>()) * T.linear();
  return moved;
}

/// Which poses take part.
using PoseChoice = std::vector<bool>;

/// Hands X cameras = Z as least squares over camera residuals [dt; dw]: T_camera_object = (t + dt, exp(dw) R) of its
/// prediction, in metres and radians, camera axes.
class HandEyeProblem {
 public:
  HandEyeProblem(const PoseSet& set, HandEyeMount mount);

  std::size_t size() const { return equations_.size(); }
  const HandEyeEquations& equations() const { return equations_; }
  HandEyeMount mount() const { return mount_; }

  /// Whether set says all noise there is.
  bool noiseGiven() const { return noise_given_; }

  Vector6d residual(std::size_t i, const HandEyeTransforms& t) const;

  /// Covariance of each residual: the camera's, the hand's as it shows there, and `more` on top. Without the camera's:
  /// of what is between the hands' true places and what the machine says.
  std::vector<Matrix6d> covariances(const HandEyeTransforms& t, const PoseSigma& more, bool with_camera = true) const;

  enum class Loss { kSquares, kRobust };
  HandEyeTransforms solved(const HandEyeTransforms& start, const PoseChoice& chosen,
                           const std::vector<Matrix6d>& covariances, Loss loss) const;

  /// Inverse of J^T J: 12 x 12 of [X; Z], or 6 x 6 of Z when X is known.
  Eigen::MatrixXd covarianceOf(const HandEyeTransforms& t, const PoseChoice& chosen,
                               const std::vector<Matrix6d>& covariances) const;

 private:
  Matrix6d handCovariance(std::size_t i, const HandEyeTransforms& t) const;

  HandEyeEquations equations_;
  HandEyeMount mount_;
  HandEyeSetup setup_;
  bool noise_given_;
  bool about_isocenter_;  // A C-arm's encoders turn about the base's origin, not about the hand's.
  std::optional<PoseSigma> hand_std_;
  std::vector<Matrix6d> camera_covariances_;  // Zero where nothing is known.
};

/// The start that most poses agree with: see calibrateHandEye.
HandEyeTransforms robustStart(const HandEyeEquations& equations, HandEyeMount mount, const HandEyeSettings& settings);

/// Root mean square over the points of one pose, hands taken as exact [px].
double reprojectionError(const PoseSet& set, const HandEyeEquations& equations, const HandEyeTransforms& t,
                         std::size_t i);

/// X and Z by the object's points in the images, with each hand's error as an unknown of given covariance; in squares.
/// The image noise is measured from the points. Throws InputError for a pose without points.
struct ReprojectionFit {
  HandEyeTransforms transforms;
  Eigen::MatrixXd covariance;  ///< As HandEyeProblem::covarianceOf.
};
ReprojectionFit solvedByReprojection(const PoseSet& set, const HandEyeProblem& problem, const HandEyeTransforms& start,
                                     const PoseChoice& chosen, const std::vector<Matrix6d>& hand_covariances);

/// Squared distance of a residual by its covariance.
double squaredDistance(const Vector6d& residual, const Matrix6d& covariance);

}  // namespace angio::calibration
