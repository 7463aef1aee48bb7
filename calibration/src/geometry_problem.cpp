// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry_problem.hpp"
#include "angio/geometry/decompositions.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <utility>

#include "least_squares.hpp"

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

// A change of all numbers from one of those that are free.
Eigen::VectorXd wholeChange(const std::vector<int>& places, const double* values) {
  Eigen::VectorXd change = Eigen::VectorXd::Zero(kModelNumbers);
  change(places) = Eigen::Map<const Eigen::VectorXd>(values, places.size());
  return change;
}

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
    const Eigen::VectorXd change = wholeChange(places_, parameters[0]);
    Eigen::MatrixXd J;
    const bool wants = jacobians && jacobians[0];
    const Eigen::VectorXd r = residual_(changed(start_, change), wants ? &J : nullptr);
    Eigen::Map<Eigen::VectorXd>(residuals, r.size()) = r;
    if (wants) {
      // All changes add up, but those of the phantom's place, which follow each other.
      const Matrix6d turn = inverseOf(rightJacobianInverseSE3(change.head<kPhantomNumbers>()));
      J.leftCols<kPhantomNumbers>() = (J.leftCols<kPhantomNumbers>() * turn).eval();
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      Eigen::Map<RowMajor>(jacobians[0], J.rows(), places_.size()) = J(Eigen::all, places_);
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
    const Eigen::MatrixXd lower = factorOfVariance(views_[i], scatter);
    const auto in_stds = [this, lower, &view = views_[i]](const GeometryModel& model, Eigen::MatrixXd* J) {
      ViewJacobian by_numbers;
      const ViewChange r = residual(view, model, J ? &by_numbers : nullptr);
      if (J) *J = whitened(lower, by_numbers);
      return Eigen::VectorXd(whitened(lower, r));
    };
    problem.AddResidualBlock(new ChangeCost(kViewChanges, start, places, in_stds),
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
  return changed(start, wholeChange(places, values.data()));
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
    *J = (view.upper * *J).eval();
  }
  return view.upper * change + view.offset;
}

Eigen::VectorXd GeometryProblem::priorResidual(const GeometryModel& model, Eigen::MatrixXd* J) const {
  Eigen::VectorXd r = Eigen::VectorXd::Zero(kPriorRows);
  J->setZero(kPriorRows, kModelNumbers);
  if (camera_.covariance) {
    const Eigen::MatrixXd lower = lowerFactorOf(Eigen::MatrixXd(*camera_.covariance));
    CameraJacobian by_camera;
    const Eigen::Vector4d expected(camera_.fx_px, camera_.fy_px, camera_.cx_px, camera_.cy_px);
    r.head<4>() = whitened(lower, cameraAt(model.carm, *camera_.source_detector_distance_m, &by_camera) - expected);
    J->block<4, kCameraNumbers>(0, kFirstCameraNumber) = whitened(lower, by_camera);
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

namespace {

double logDeterminant(const Eigen::MatrixXd& lower_factor) { return 2 * lower_factor.diagonal().array().log().sum(); }

}  // namespace

// The used views' residuals at a model and their derivatives by the free numbers, not whitened.
struct GeometryProblem::Linear {
  std::vector<const ViewObservation*> views;
  std::vector<ViewChange> residual;
  std::vector<Eigen::Matrix<double, kViewChanges, Eigen::Dynamic>> J;
  Eigen::VectorXd prior_residual;
  Eigen::MatrixXd prior_J;
  Eigen::Index flex_terms = 0;
};

GeometryProblem::Linear GeometryProblem::linear(const GeometryModel& model) const {
  const std::vector<int> places = freePlaces();
  Linear l;
  for (std::size_t i = 0; i < views_.size(); ++i) {
    if (!used[i]) continue;
    Eigen::Matrix<double, kViewChanges, kModelNumbers> J;
    l.views.push_back(&views_[i]);
    l.residual.push_back(residual(views_[i], model, &J));
    l.J.push_back(J(Eigen::all, places));
  }
  Eigen::MatrixXd J;
  l.prior_residual = priorResidual(model, &J);
  l.prior_J = J(Eigen::all, places);
  return l;
}

ViewMatrix GeometryProblem::variance(const ViewObservation& view, const PoseScatter& s) const {
  // About the phantom's middle: encoders and bending turn the arm about the isocentre, not about the source.
  const Eigen::Translation3d to_middle(view.T_camera_phantom * phantom_center_m_);
  const Matrix6d by_scatter = view.upper.topLeftCorner<6, 6>() * adjointSE3(Pose(to_middle));
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(s.translation_m * s.translation_m),
      Eigen::Vector3d::Constant(s.rotation_rad * s.rotation_rad);
  ViewMatrix V = ViewMatrix::Identity() * std::pow(bead_std_px_.value_or(1), 2);
  V.topLeftCorner<6, 6>() += by_scatter * variances.asDiagonal() * by_scatter.transpose();
  return V;
}

Eigen::MatrixXd GeometryProblem::factorOfVariance(const ViewObservation& view, const PoseScatter& s) const {
  return lowerFactorOf(Eigen::MatrixXd(variance(view, s)));
}

double GeometryProblem::surprise(const ViewObservation& view, const GeometryModel& model) const {
  const ViewChange r = residual(view, model);
  // The first six rows are the pose's.
  const Matrix6d V = variance(view, scatter).topLeftCorner<6, 6>();
  return std::sqrt(squaredMahalanobis(Vector6d(r.head<6>()), V) / 6);
}

Twist GeometryProblem::miss(const ViewObservation& view, const GeometryModel& model) const {
  const Pose predicted = model.carm.T_camera_patient(view.joints) * model.T_patient_phantom;
  Twist miss;
  miss << predicted * phantom_center_m_ - view.T_camera_phantom * phantom_center_m_,
      logSO3(predicted.linear() * view.T_camera_phantom.linear().transpose());
  return miss;
}

double GeometryProblem::residualRms(const GeometryModel& model, const std::vector<bool>& chosen) const {
  double sum = 0;
  int counted = 0;
  for (std::size_t i = 0; i < views_.size(); ++i) {
    if (!chosen[i]) continue;
    sum += registered() ? 1e6 * miss(views_[i], model).head<3>().squaredNorm()
                        : residual(views_[i], model).squaredNorm() + views_[i].unexplained_px2;
    counted += registered() ? 1 : views_[i].beads;
  }
  return counted == 0 ? 0 : std::sqrt(sum / counted);
}

Eigen::MatrixXd GeometryProblem::information(const GeometryModel& model) const {
  const Linear l = linear(model);
  Eigen::MatrixXd H = l.prior_J.transpose() * l.prior_J;
  for (std::size_t i = 0; i < l.views.size(); ++i) {
    const Eigen::MatrixXd J = whitened(factorOfVariance(*l.views[i], scatter), l.J[i]);
    H += J.transpose() * J;
  }
  return H;
}

// Twice the negative logarithm of the restricted likelihood, but for a constant.
double GeometryProblem::unlikelihood(const Linear& l, const Eigen::VectorXd& scale, const PoseScatter& s) const {
  // The bending's rows follow their standard deviations.
  const Eigen::Index rows = std::max<Eigen::Index>(l.flex_terms * 6, 0);
  Eigen::VectorXd weight = Eigen::VectorXd::Ones(l.prior_residual.size());
  for (Eigen::Index k = 0; k < rows; ++k) {
    weight[4 + k] = k % 6 < 3 ? scatter.flex_m / s.flex_m : scatter.flex_rad / s.flex_rad;
  }
  const Eigen::MatrixXd prior_J = weight.asDiagonal() * l.prior_J;
  const Eigen::VectorXd prior_residual = weight.cwiseProduct(l.prior_residual);
  Eigen::MatrixXd H = prior_J.transpose() * prior_J;
  Eigen::VectorXd g = prior_J.transpose() * prior_residual;
  double sum = prior_residual.squaredNorm(), determinant = -2 * weight.array().log().sum();
  for (std::size_t i = 0; i < l.views.size(); ++i) {
    const Eigen::MatrixXd lower = factorOfVariance(*l.views[i], s);
    const Eigen::MatrixXd J = whitened(lower, l.J[i]);
    const Eigen::VectorXd r = whitened(lower, l.residual[i]);
    H.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose());
    g += J.transpose() * r;
    sum += r.squaredNorm();
    determinant += logDeterminant(lower);
  }
  H = scale.asDiagonal() * Eigen::MatrixXd(H.selfadjointView<Eigen::Lower>()) * scale.asDiagonal();
  g = scale.asDiagonal() * g;
  const Eigen::MatrixXd lower = lowerFactorOf(H);
  return determinant + logDeterminant(lower) + sum - whitened(lower, g).squaredNorm();
}

PoseScatter GeometryProblem::likeliestScatter(const GeometryModel& model, double reach) const {
  Linear l = linear(model);
  l.flex_terms = model.carm.deviations.flex.count;
  // Units in which the free numbers are of one size, for the determinant's sake.
  const Eigen::VectorXd scale = information(model).diagonal().cwiseSqrt().cwiseInverse();
  std::vector<double PoseScatter::*> fields{&PoseScatter::translation_m, &PoseScatter::rotation_rad};
  if (l.flex_terms > 0) fields.insert(fields.end(), {&PoseScatter::flex_m, &PoseScatter::flex_rad});
  PoseScatter best = scatter;
  double lowest = unlikelihood(l, scale, best);
  // Factors that shrink: the likelihood has one smooth top, and a tenth of a standard deviation is enough.
  for (double factor = reach; factor > 1.08; factor = std::sqrt(factor)) {
    for (double PoseScatter::*field : fields) {
      for (const double change : {factor, 1 / factor}) {
        bool moved = false;
        for (;;) {
          PoseScatter next = best;
          next.*field *= change;
          if (next.*field < 1e-7 || next.*field > 1) break;
          const double there = unlikelihood(l, scale, next);
          if (there >= lowest - 1e-9) break;
          best = next;
          lowest = there;
          moved = true;
        }
        if (moved) break;
      }
    }
  }
  return best;
}

}  // namespace angio::calibration
