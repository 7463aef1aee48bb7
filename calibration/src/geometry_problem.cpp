// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry_problem.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <functional>
#include <stdexcept>

namespace angio::calibration {
namespace {

using ViewMatrix = Eigen::Matrix<double, kViewChanges, kViewChanges>;
using ViewJacobian = Eigen::Matrix<double, kViewChanges, kModelNumbers>;

// fx, fy, cx, cy at a distance, and their derivatives by the camera's numbers.
using CameraJacobian = Eigen::Matrix<double, 4, kCameraNumbers>;
Eigen::Vector4d cameraAt(const CArmGeometry& carm, double encoder_distance_m, CameraJacobian* J = nullptr) {
  const auto p = carm.camera(encoder_distance_m).parameters();
  if (J) {
    const double from_usual_m = encoder_distance_m - carm.source_detector_distance_m;
    const double by_offset = 1 / carm.pixel_spacing_m;
    *J << by_offset, 0, 0, 0, 0, 0,                                           //
        by_offset * (1 + carm.deviations.pixel_aspect), p.fx_px, 0, 0, 0, 0,  //
        0, 0, 1, 0, from_usual_m, 0,                                          //
        0, 0, 0, 1, 0, from_usual_m;
  }
  return {p.fx_px, p.fy_px, p.cx_px, p.cy_px};
}

constexpr double kTableStd = 0.1;               // Scale and direction of a table axis.
constexpr double kSourceIsocenterStd_m = 0.15;  // Its start is a guess.

struct FreeChange {
  const std::vector<int>& places;
  Eigen::VectorXd whole(const double* values) const {
    Eigen::VectorXd change = Eigen::VectorXd::Zero(kModelNumbers);
    for (std::size_t i = 0; i < places.size(); ++i) change[places[i]] = values[i];
    return change;
  }
};

// A residual by a change of the free numbers from the start.
class ChangeCost final : public ceres::CostFunction {
 public:
  // Of a model; with derivatives by all its numbers where they are wanted.
  using Residual = std::function<Eigen::VectorXd(const GeometryModel&, Eigen::MatrixXd* J)>;

  ChangeCost(int rows, const GeometryModel& start, const std::vector<int>& places, Residual residual)
      : start_(start), places_(places), residual_(std::move(residual)) {
    set_num_residuals(rows);
    mutable_parameter_block_sizes()->push_back(static_cast<int>(places.size()));
  }

  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::VectorXd change = FreeChange{places_}.whole(parameters[0]);
    Eigen::MatrixXd J;
    const bool wants = jacobians && jacobians[0];
    const Eigen::VectorXd r = residual_(changed(start_, change), wants ? &J : nullptr);
    Eigen::Map<Eigen::VectorXd>(residuals, r.size()) = r;
    if (wants) {
      // All changes add up, but those of the phantom's place, which follow each other.
      const Matrix6d turn = rightJacobianInverseSE3(change.head<kPhantomNumbers>()).inverse();
      J.leftCols<kPhantomNumbers>() = (J.leftCols<kPhantomNumbers>() * turn).eval();
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      Eigen::Map<RowMajor>(jacobians[0], J.rows(), static_cast<Eigen::Index>(places_.size())) = J(Eigen::all, places_);
    }
    return r.allFinite();
  }

 private:
  const GeometryModel& start_;
  const std::vector<int>& places_;
  Residual residual_;
};

}  // namespace

GeometryModel changed(const GeometryModel& model, const Eigen::VectorXd& change) {
  GeometryModel other = model;
  other.T_patient_phantom = model.T_patient_phantom * expSE3(change.head<kPhantomNumbers>());
  other.carm.setPoseParameters(model.carm.poseParameters() + change.segment<kCArmPoseParameters>(kFirstArmNumber));
  CArmDeviations& d = other.carm.deviations;
  const auto camera = change.segment<kCameraNumbers>(kFirstCameraNumber);
  d.source_detector_offset_m += camera[0];
  d.pixel_aspect += camera[1];
  d.principal_point_px += camera.segment<2>(2);
  d.principal_point_slope_px_per_m += camera.segment<2>(4);
  for (int i = 0; i < d.flex.count; ++i) {
    d.flex.terms[i].twist += change.segment<6>(kFirstFlexNumber + 6 * i);
  }
  return other;
}

GeometryProblem::GeometryProblem(std::vector<ViewObservation> views, const GeometryModel& prior,
                                 const GeometryCamera& camera, const GeometrySettings& settings,
                                 const Eigen::Vector3d& phantom_center_m, std::optional<double> bead_std_px)
    : used(views.size(), true),
      free(kModelNumbers, false),
      scatter{settings.pose_scatter_mm * 1e-3, degToRad(settings.pose_scatter_deg), settings.flex_std_mm * 1e-3,
              degToRad(settings.flex_std_deg)},
      views_(std::move(views)),
      prior_(prior),
      camera_(camera),
      phantom_center_m_(phantom_center_m),
      bead_std_px_(bead_std_px),
      view_loss_(settings.outlier_view_factor) {
  for (std::size_t i = 0; i < views_.size(); ++i) used[i] = !views_[i].held_out;
  for (std::size_t k = 0; k < kCArmPoseParameters; ++k) {
    const double unit = kCArmPoseParameterNames[k].unit;
    arm_std_[k] = unit == 1      ? kTableStd
                  : unit == 1e-3 ? settings.max_offset_mm * 1e-3
                                 : degToRad(settings.max_offset_deg);
  }
  arm_std_[kSourceIsocenterParameter] = kSourceIsocenterStd_m;
}

std::vector<int> GeometryProblem::freePlaces() const {
  std::vector<int> places;
  for (int i = 0; i < kModelNumbers; ++i) {
    if (free[i]) places.push_back(i);
  }
  return places;
}

GeometryModel GeometryProblem::solve(const GeometryModel& start, Loss loss) const {
  const std::vector<int> places = freePlaces();
  std::vector<double> values(places.size(), 0.0);
  ceres::Problem problem;
  for (std::size_t i = 0; i < views_.size(); ++i) {
    if (!used[i]) continue;
    const Eigen::LLT<ViewMatrix> whiten(variance(views_[i], scatter));
    const auto whitened = [this, whiten, &view = views_[i]](const GeometryModel& model, Eigen::MatrixXd* J) {
      ViewJacobian by_numbers;
      const ViewChange r = residual(view, model, J ? &by_numbers : nullptr);
      if (J) *J = whiten.matrixL().solve(by_numbers);
      return Eigen::VectorXd(whiten.matrixL().solve(r));
    };
    problem.AddResidualBlock(new ChangeCost(kViewChanges, start, places, whitened),
                             loss == Loss::kCauchy ? new ceres::CauchyLoss(view_loss_) : nullptr, values.data());
  }
  const auto prior = [this](const GeometryModel& model, Eigen::MatrixXd* J) {
    Eigen::MatrixXd unwanted;
    return priorResidual(model, J ? J : &unwanted);
  };
  problem.AddResidualBlock(new ChangeCost(kPriorRows, start, places, prior), nullptr, values.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 100;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.gradient_tolerance = 1e-14;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable())
    throw std::runtime_error("the geometry's least squares broke off: " + summary.message);
  return changed(start, FreeChange{places}.whole(values.data()));
}

ViewChange GeometryProblem::residual(const ViewObservation& view, const GeometryModel& model, ViewJacobian* J) const {
  const CArmGeometry& carm = model.carm;
  const Pose T = carm.T_camera_patient(view.joints) * model.T_patient_phantom;
  const Twist moved = logSE3(T * view.T_camera_phantom.inverse());
  CameraJacobian by_camera;
  ViewChange change;
  change << moved, cameraAt(carm, view.source_detector_distance_m, J ? &by_camera : nullptr) - view.camera_px;
  if (J) {
    // log(exp(d) exp(moved)) = moved + Jl^-1(moved) d; the camera's twist moves the phantom the other way.
    const Matrix6d from_left = rightJacobianInverseSE3(-moved);
    J->setZero();
    J->topRows<6>() = -from_left * cameraByNumbers(carm, view.joints);
    J->block<6, kPhantomNumbers>(0, 0) = from_left * adjointSE3(T);
    J->block<4, kCameraNumbers>(6, kFirstCameraNumber) = by_camera;
    *J = (view.upper.triangularView<Eigen::Upper>() * (*J)).eval();
  }
  return view.upper.triangularView<Eigen::Upper>() * change + view.offset;
}

Eigen::VectorXd GeometryProblem::priorResidual(const GeometryModel& model, Eigen::MatrixXd* J) const {
  Eigen::VectorXd r = Eigen::VectorXd::Zero(kPriorRows);
  J->setZero(kPriorRows, kModelNumbers);
  if (camera_.covariance) {
    const Eigen::LLT<Eigen::Matrix4d> whiten(*camera_.covariance);
    CameraJacobian by_camera;
    const Eigen::Vector4d believed(camera_.fx_px, camera_.fy_px, camera_.cx_px, camera_.cy_px);
    r.head<4>() =
        whiten.matrixL().solve(cameraAt(model.carm, *camera_.source_detector_distance_m, &by_camera) - believed);
    J->block<4, kCameraNumbers>(0, kFirstCameraNumber) = whiten.matrixL().solve(by_camera);
  }
  const CArmFlex& flex = model.carm.deviations.flex;
  for (int k = 0; k < 6 * flex.count; ++k) {
    const CArmFlexTerm& term = flex.terms[k / 6];
    // Arms bend smoothly: the quicker a wave, the smaller.
    const double waves = std::hypot(term.frequency_primary, term.frequency_secondary);
    const double information = waves / (k % 6 < 3 ? scatter.flex_m : scatter.flex_rad);
    r[4 + k] = information * term.twist[k % 6];
    (*J)(4 + k, kFirstFlexNumber + k) = information;
  }
  constexpr int kFirstArmRow = 4 + kFlexNumbers;
  const Eigen::Matrix<double, kCArmPoseParameters, 1> information = arm_std_.cwiseInverse();
  r.segment<kCArmPoseParameters>(kFirstArmRow) =
      information.cwiseProduct(model.carm.poseParameters() - prior_.carm.poseParameters());
  J->block<kCArmPoseParameters, kCArmPoseParameters>(kFirstArmRow, kFirstArmNumber) = information.asDiagonal();
  return r;
}

}  // namespace angio::calibration
