// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/calibration/geometry_calibration.hpp"
#include "angio/calibration/namespace.hpp"
#include "angio/calibration/pose_set.hpp"
#include "angio/calibration_records/geometry_numbers.hpp"
#include "angio/geometry/carm.hpp"

namespace angio::calibration {

/// Changes of a view that its beads tell of: a twist of the phantom in the camera [m, rad], camera axes, from the left,
/// then fx, fy, cx, cy [px].
constexpr int kViewChanges = 10;
using ViewChange = Eigen::Matrix<double, kViewChanges, 1>;

/// A view condensed about its best pose: |residuals|^2 = |upper * change + offset|^2 + what no change explains.
/// Residuals are beads' [px], or a registered pose's by its covariance [standard deviations].
struct ViewObservation {
  std::string name;
  CArmJoints joints = CArmJoints::Zero();
  double source_detector_distance_m = 0;
  bool held_out = false;
  int beads = 0;                                        ///< Used; none in a registered view.
  std::vector<int> far_beads;                           ///< Not used: further off than the rest can explain.
  Eigen::Vector4d camera_px = Eigen::Vector4d::Zero();  ///< fx, fy, cx, cy that changes count from.
  Pose T_camera_phantom = Pose::Identity();             ///< The pose that they count from.
  Eigen::Matrix<double, kViewChanges, kViewChanges> upper = Eigen::Matrix<double, kViewChanges, kViewChanges>::Zero();
  ViewChange offset = ViewChange::Zero();
  double unexplained_px2 = 0;  ///< Sum of squares that no pose explains.
};

/// Finds a view's pose with the camera as it is at its distance, robustly. Throws InputError at `place` and the view's
/// name for fewer than 8 beads and for beads that no pose explains.
ViewObservation observeView(const std::string& place, const BeadPhantom& phantom, const XrayCamera& camera,
                            const BeadView& view, double outlier_std);

/// A registered pose as such a view: it says nothing of the camera. `usual` stands in for a covariance that is not
/// given; without either the pose is taken as exact to 1 um and 1e-6 rad, and its scatter is left to be measured.
ViewObservation observePose(const HandEyePose& pose, const std::optional<PoseSigma>& usual);

/// Throws InputError when beads lie elsewhere than the phantom says in half of the views or more: swapped labels.
void requireSoundBeads(const std::string& place, const BeadPhantom& phantom, const std::vector<BeadView>& views,
                       const std::vector<ViewObservation>& seen);

/// What the views shall explain.
struct GeometryModel {
  CArmGeometry carm;
  Pose T_patient_phantom = Pose::Identity();
};

/// The model with its numbers changed by `change`, kModelNumbers of them.
GeometryModel changed(const GeometryModel& model, const Eigen::VectorXd& change);

/// Standard deviations of what is random here.
struct PoseScatter {
  double translation_m = 0;  ///< What joints do not explain of a view's pose, about the phantom's middle, each axis.
  double rotation_rad = 0;
  double flex_m = 0;  ///< A term of the bending, each axis, for a wave of one turn; it falls with the waves' number.
  double flex_rad = 0;
};

/// Least squares over condensed views.
class GeometryProblem {
 public:
  /// @param prior  What is believed of the arm before.
  /// @param bead_std_px  None: the views are registered poses.
  GeometryProblem(std::vector<ViewObservation> views, const GeometryModel& prior, const GeometryCamera& camera,
                  const GeometrySettings& settings, const Eigen::Vector3d& phantom_center_m,
                  std::optional<double> bead_std_px);

  const std::vector<ViewObservation>& views() const { return views_; }

  /// The same views condensed about another camera.
  void replace(std::vector<ViewObservation> views) { views_ = std::move(views); }

  std::vector<bool> used;  ///< Of the views; held out ones are not.
  std::vector<bool> free;  ///< Of the kModelNumbers.
  PoseScatter scatter;

  /// The best model from a start, over all free numbers.
  enum class Loss { kSquared, kCauchy };
  GeometryModel solve(const GeometryModel& start, Loss loss) const;

  /// Places of the free numbers.
  std::vector<int> freePlaces() const;

  /// A view's change by this model, whitened by what was seen but not by scatter, and its derivatives by the model's
  /// numbers.
  ViewChange residual(const ViewObservation& view, const GeometryModel& model,
                      Eigen::Matrix<double, kViewChanges, kModelNumbers>* J = nullptr) const;

  /// Variance of that change: noise and scatter.
  Eigen::MatrixXd factorOfVariance(const ViewObservation& view, const PoseScatter& s) const;  // Lower.
  Eigen::Matrix<double, kViewChanges, kViewChanges> variance(const ViewObservation& view,
                                                             const PoseScatter& scatter) const;

  /// Square of a view's pose error over what is expected, per degree of freedom, as a standard deviation: about 1.
  double surprise(const ViewObservation& view, const GeometryModel& model) const;

  /// Whether views are registered poses, not beads.
  bool registered() const { return !bead_std_px_; }

  /// How far the model has the phantom from where a view saw it: its middle [m] and its turn [rad], camera axes.
  Twist miss(const ViewObservation& view, const GeometryModel& model) const;

  /// Root mean square over the chosen views: distance of used beads from where the model sees them [px], or of the
  /// object's middle when poses are registered [mm].
  double residualRms(const GeometryModel& model, const std::vector<bool>& chosen) const;

  /// The scatter of greatest restricted likelihood at this model, looked for from the present one by factors of `reach`
  /// and less. Source: Patterson and Thompson, Recovery of
  /// inter-block information when block sizes are unequal, Biometrika 58 (1971).
  PoseScatter likeliestScatter(const GeometryModel& model, double reach) const;

  /// Information about the free numbers [their units], of views and prior, in the order of freePlaces().
  Eigen::MatrixXd information(const GeometryModel& model) const;

  /// What is believed of camera (4 rows), bending (by `scatter`) and arm, whitened; derivatives by all numbers. Of the
  /// arm only that it is one: far wider than any data, so that few views give no nonsense.
  static constexpr int kPriorRows = 4 + kFlexNumbers + kCArmPoseParameters;
  Eigen::VectorXd priorResidual(const GeometryModel& model, Eigen::MatrixXd* J) const;

 private:
  struct Linear;
  Linear linear(const GeometryModel& model) const;
  double unlikelihood(const Linear& linear, const Eigen::VectorXd& scale, const PoseScatter& scatter) const;

  std::vector<ViewObservation> views_;
  GeometryModel prior_;
  GeometryCamera camera_;
  Eigen::Vector3d phantom_center_m_;
  std::optional<double> bead_std_px_;
  double view_loss_;
  Eigen::Matrix<double, kCArmPoseParameters, 1> arm_std_;
};

/// Throws InputError for positions from which a C-arm's geometry cannot be known, whatever the images show: fewer than
/// 6 different ones, or a primary angle that hardly moves.
void requirePositions(const std::string& place, const std::vector<CArmJoints>& positions);

/// Frees what the positions can tell at this start, and says in words what they cannot, and why.
std::vector<std::string> freeObservable(GeometryProblem& problem, const GeometryModel& start, bool refines_camera);

/// Throws InputError when the views do not agree on one C-arm as well as `wide` allows: some of them, named, are
/// explained by another one, or joints explain nothing.
void requireOneMachine(const std::string& place, const GeometryProblem& problem, const GeometryModel& start,
                       const PoseScatter& wide);

/// Values, covariance, residuals and weak directions of a solved geometry.
CalibrationRecord geometryRecord(const GeometryProblem& problem, const GeometryModel& model);

/// Each view against the model.
std::vector<GeometryViewFit> geometryFits(const GeometryProblem& problem, const GeometryModel& model);

/// Views that were left out and beads that lie elsewhere, a line each.
std::vector<std::string> geometryDoubts(const GeometryProblem& problem);

}  // namespace angio::calibration
