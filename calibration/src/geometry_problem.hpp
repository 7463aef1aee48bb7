// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "geometry_numbers.hpp"
#include "geometry_observation.hpp"

namespace angio::calibration {

/// What the views shall explain.
struct GeometryModel {
  CArmGeometry carm;
  Pose T_patient_phantom = Pose::Identity();
};

/// The model with its numbers (geometry_numbers.hpp) changed by `change`, kModelNumbers of them.
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
