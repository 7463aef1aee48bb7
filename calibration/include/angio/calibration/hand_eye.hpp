// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/calibration/hand_eye_solvers.hpp"
#include "angio/calibration_records/record.hpp"

namespace angio::calibration {

/// What is known of X beforehand.
enum class HandEyeMount {
  kUnknown,   ///< X and Z are estimated.
  kIdentity,  ///< X is the identity, Z is estimated: the hand is the camera, as on a C-arm whose geometry is
              ///< calibrated.
};

/// What is made small.
enum class HandEyeResidual {
  kPose,          ///< Poses against their predictions, weighed by their covariances.
  kReprojection,  ///< The object's points in the images, and the hands' errors; wants points in every pose.
};

/// What a hand-eye calibration minimises, and when a pose counts or is an outlier.
struct HandEyeSettings {
  HandEyeMount mount = HandEyeMount::kUnknown;
  HandEyeResidual residual = HandEyeResidual::kPose;
  double min_turn_deg = 1;    ///< Turns about a second axis, root mean square over pairs, from which on a pose counts.
  double outlier_gate = 5.3;  ///< A pose further off than so many sigma (of six dimensions) is an outlier.
  static constexpr double min_share = 0.6;  ///< Of the poses, that must be explained by one transform.
  int starts = 100;
  int seed = 1;

  void visit(SettingsVisitor& v) {
    v.choice("mount", mount, {"unknown", "identity"}, "What is known of how the camera sits on the C-arm");
    v.choice("residual", residual, {"pose", "reprojection"}, "What is minimised");
    v.integer("starts", starts, 0, 10000, "Draws of few poses each, for a start that outliers do not pull");
    v.integer("seed", seed, 0, 2147483647, "Seed of the draws");
    v.fixed("min_turn_deg", min_turn_deg, 1e-6, 90);
    v.fixed("outlier_gate", outlier_gate, 2, 100);
  }
};

/// One pose against its prediction.
struct HandEyePoseFit {
  std::string name;
  double rotation_rad = 0;
  double translation_m = 0;
  double sigmas = 0;           ///< Distance by the noise, of six dimensions: about 2.3 for a good pose.
  bool outlier = false;        ///< Took no part in the estimate.
  double reprojection_px = 0;  ///< Root mean square over its points with hands taken as exact; 0 without points.
};

/// The transforms of a hand-eye calibration, how certain they are, and how each pose fits them.
struct HandEyeResult {
  HandEyeTransforms transforms;

  /// Of [X; Z] (12 x 12), or of Z alone (6 x 6) when X is known: translation [m] and rotation [rad] each, the rotation
  /// being a small turn about the parent frame's axes: R_true = exp(dw) R.
  Eigen::MatrixXd covariance;

  PoseSigma noise;                           ///< Scatter of the poses that were used, per axis.
  bool noise_given = true;                   ///< Otherwise the covariance rests on the measured scatter.
  std::optional<TranslationScale> scale;     ///< See translationScale.
  HandEyeResiduals residuals;                ///< Of the poses that were used.
  std::optional<HandEyeResiduals> held_out;  ///< Each pose predicted from the others; needs four.
  std::vector<HandEyePoseFit> poses;
  double chi2_per_freedom = 1;  ///< Near 1 when the given noise is the true one.
  std::vector<std::string> warnings;

  int outliers() const;
};

/// Finds X and Z from hands and cameras.
///
/// What cannot be known is refused before anything is solved (requireMotions, requireConventions). The start is the
/// best of Park-Martin's and Shah's answers over all poses and over draws of few; then Ceres with a robust loss,
/// outliers by the gate, and least squares over the others, whose covariance is J^T J's inverse. Where no noise is
/// given, rotation's and translation's are measured from the residuals.
///
/// Throws InputError that names the set's file and what is wrong: what the above refuse; no transform that explains
/// `min_share` of the poses; poses that fit two different transforms, with their names.
HandEyeResult calibrateHandEye(const PoseSet& set, const HandEyeSettings& settings = {});

/// The result as it goes into a file's section `calibration`; lengths in mm, angles in deg, turns about parent axes.
CalibrationRecord handEyeRecord(const PoseSet& set, const HandEyeSettings& settings, const HandEyeResult& result);

/// Names of both transforms in a setup: {"T_hand_camera", "T_base_object"} or {"T_base_camera", "T_hand_object"}.
std::pair<std::string, std::string> transformNames(HandEyeSetup setup);

}  // namespace angio::calibration
