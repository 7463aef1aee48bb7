// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "angio/geometry/se3.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// How far a result can be believed. Only kConverged may move a machine.
enum class RegistrationStatus {
  kConverged,     ///< The solver came to rest, and image and model explain each other.
  kAmbiguous,     ///< A fit, but one side is mostly unexplained, or a different pose fits nearly as well.
  kDiverged,      ///< Neither side is explained, or the solver left its bounds.
  kTooFewPoints,  ///< Too little in the image, or in view, to fit six unknowns.
};

/// "converged", "ambiguous", "diverged", "too_few_points".
std::string statusName(RegistrationStatus status);

/// What held the pose at its start: E_init of the paper's eq. 4.
enum class PriorInForce {
  kLambda,              ///< One lambda for radians and lengths together, as the paper has it.
  kSettingsCovariance,  ///< The standard deviations of the settings.
  kGivenCovariance,     ///< A covariance that came with the start, from calibration or tracking; before the settings.
  kNone,                ///< Nothing: the start is where the solver begins, and no more.
};

/// "lambda", "covariance of the settings", "covariance given with the start", "none".
std::string priorName(PriorInForce prior);

/// How well model and image explain each other under a pose. A point is explained when the other side has a vessel
/// within the gate that runs the same way.
struct AlignmentScore {
  double model_explained = 0;  ///< Share of the projected model points on the detector that the image explains.
  double image_explained = 0;  ///< Share of the image points that the projected model explains.
  double model_residual_px =
      0;  ///< Mean distance from projected model points on the detector to the nearest image point.
  double image_residual_px = 0;  ///< Mean distance from image points to the nearest projected model edge.
  double model_rms_px = 0;  ///< Root mean square of the distances behind model_residual_px: the paper's PR, in pixels.
  int model_points = 0;     ///< Projected model points on the detector.

  /// One figure to compare poses by: the product of both shares, in [0, 1].
  double score() const { return model_explained * image_explained; }
};

/// Wall time spent [s].
struct RegistrationTimes {
  double prepare_s = 0;  ///< 2D side: densifying, search tree.
  double rigid_s = 0;
  double nonrigid_s = 0;
  double total_s = 0;  ///< Everything, judging the result included.

  RegistrationTimes& operator+=(const RegistrationTimes& more) {
    prepare_s += more.prepare_s;
    rigid_s += more.rigid_s;
    nonrigid_s += more.nonrigid_s;
    total_s += more.total_s;
    return *this;
  }
};

/// So many standard deviations to either side hold 90 % of a normal error.
inline constexpr double kInterval90 = 1.6449;

/// How uncertain the place of each point of a registered tree is.
class PointUncertainty {
 public:
  virtual ~PointUncertainty() = default;
  /// Returns the covariance of the error of a point of the tree where the result's pose and displacements put it,
  /// camera axes [m^2]: noise of the image, and a deformation of the tree that the residuals allow. `p_model` is the
  /// point as the tree was given, in the model frame [m].
  ///
  /// It is as large as the tails of the error need: three of its standard deviations hold. Errors of a deformed tree
  /// have heavier tails than a normal distribution, as deformations differ in kind and some vessels are taken for their
  /// neighbours.
  virtual Eigen::Matrix3d covarianceAt(const Eigen::Vector3d& p_model) const = 0;

  /// Returns the covariance of the normal distribution that has the error's 90 % intervals: kInterval90 of its
  /// standard deviations, on any axis. Nowhere larger than covarianceAt(), and the same where errors are normal.
  virtual Eigen::Matrix3d centralCovarianceAt(const Eigen::Vector3d& p_model) const { return covarianceAt(p_model); }
};

struct FrameEvidence;  // What a fit has matched in one view, for depthFromMotion().

/// Standard deviation of the distance of the tree's points from where they are claimed, rms over the tree [m].
struct PlaceSpread {
  double noise_m = 0;   ///< By the image's noise alone.
  double all_m = 0;     ///< By noise and deformation.
  double across_m = 0;  ///< The same across the rays to the points: depth left out.
};

/// What a registration says. `T_camera_model` is always a rigid transform; whether it means anything is in `status`.
struct [[nodiscard]] RegistrationResult {
  RegistrationStatus status = RegistrationStatus::kTooFewPoints;
  std::string reason;  ///< Why the status is not kConverged, in words; empty when it is.
  Pose T_camera_model = Pose::Identity();

  /// Displacement of each point of the tree as it was given, 3 x N [m], model axes; empty after a rigid registration,
  /// zero when there was nothing to fit.
  Eigen::Matrix3Xd displacements_m;

  /// Covariance of (translation of T_camera_model [m], rotation in camera axes [rad]): a true pose would be
  /// R_true = exp(dw) R, t_true = t + dt. From the last Gauss-Newton Hessian and the residual scale, image points taken
  /// as independent; absent when the solver had no full-rank system.
  ///
  /// `oriented_kernel` also counts what the tree may be deformed by: see deformation_std_m.
  std::optional<Matrix6d> covariance;

  /// The part of the covariance that the image's noise alone leaves: what holds where the deformation is known. Absent
  /// where the covariance says all.
  std::optional<Matrix6d> noise_covariance;
  /// Standard deviation, per axis, of the deformation of the tree that the residuals of the rigid tree speak for [m],
  /// its linear part left out. 0 where none was looked for.
  double deformation_std_m = 0;
  /// Whether a lower alignment score is enough: the fit ended near its start, and standard deviations count what model
  /// and image do not explain of each other.
  bool low_score_suffices = false;
  /// How uncertain the places of the tree's points are; absent where the covariance says all.
  std::optional<PlaceSpread> spread;
  /// What is known of single points; null where the covariance says all.
  std::shared_ptr<const PointUncertainty> points;
  /// What has been matched, of a fit to one view; null where the method keeps nothing.
  std::shared_ptr<const FrameEvidence> evidence;

  /// Score of the best different pose over the best score, in [0, 1]; absent when only one start was tried.
  std::optional<double> ambiguity;

  PriorInForce prior = PriorInForce::kSettingsCovariance;
  AlignmentScore alignment;
  /// How far the last step moved the projection: a rigid one roughly and at most, a nonrigid one rms over the points.
  double last_step_px = 0;
  int rigid_iterations = 0;
  int nonrigid_iterations = 0;
  int points_3d = 0;  ///< Model points used.
  int points_2d = 0;  ///< Image points used.
  RegistrationTimes times;
};

/// Returns whether a rigid fit speaks for a deformation of the tree by more than 0.3 mm: it does not say well, then,
/// where the points of the tree are.
bool seemsDeformed(const RegistrationResult& result);

/// Returns whether model and image explain each other as well as a converged result requires, whatever the covariance
/// leaves open.
///
/// True for every converged result that was not accepted for want of alternatives alone. A result that is explained and
/// not converged may be used by a caller that gates on the covariance itself: one view of a deformed tree determines
/// where the tree is across the beam, and leaves its depth open.
bool explained(const RegistrationResult& result);

}  // namespace angio::registration
