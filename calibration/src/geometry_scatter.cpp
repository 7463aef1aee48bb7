// SPDX-License-Identifier: GPL-2.0-or-later
#include <Eigen/Cholesky>
#include <cmath>

#include "geometry_problem.hpp"

namespace angio::calibration {
namespace {

using ViewMatrix = Eigen::Matrix<double, kViewChanges, kViewChanges>;

double logDeterminant(const Eigen::MatrixXd& positive) {
  const Eigen::LLT<Eigen::MatrixXd> factor(positive);
  return 2 * Eigen::MatrixXd(factor.matrixL()).diagonal().array().log().sum();
}

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
  const Matrix6d by_scatter =
      view.upper.topLeftCorner<6, 6>().triangularView<Eigen::Upper>() * adjointSE3(Pose(to_middle));
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(s.translation_m * s.translation_m),
      Eigen::Vector3d::Constant(s.rotation_rad * s.rotation_rad);
  ViewMatrix V = ViewMatrix::Identity() * std::pow(bead_std_px_.value_or(1), 2);
  V.topLeftCorner<6, 6>() += by_scatter * variances.asDiagonal() * by_scatter.transpose();
  return V;
}

double GeometryProblem::surprise(const ViewObservation& view, const GeometryModel& model) const {
  const ViewChange r = residual(view, model);
  // The first six rows are the pose's.
  const Matrix6d V = variance(view, scatter).topLeftCorner<6, 6>();
  return std::sqrt(r.head<6>().dot(V.llt().solve(r.head<6>())) / 6);
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
    H += l.J[i].transpose() * variance(*l.views[i], scatter).llt().solve(l.J[i]);
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
    const Eigen::LLT<ViewMatrix> whiten(variance(*l.views[i], s));
    const Eigen::Matrix<double, kViewChanges, Eigen::Dynamic> J = whiten.matrixL().solve(l.J[i]);
    const ViewChange r = whiten.matrixL().solve(l.residual[i]);
    H.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose());
    g += J.transpose() * r;
    sum += r.squaredNorm();
    determinant += 2 * ViewMatrix(whiten.matrixL()).diagonal().array().log().sum();
  }
  H = scale.asDiagonal() * Eigen::MatrixXd(H.selfadjointView<Eigen::Lower>()) * scale.asDiagonal();
  g = scale.asDiagonal() * g;
  return determinant + logDeterminant(H) + sum - g.dot(H.llt().solve(g));
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
