// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "anatomy_estimate.hpp"
#include "angio/base/errors.hpp"
#include "angio/calibration_records/pose_fields.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/io/xa_files.hpp"
#include "angio/io/yaml.hpp"

namespace angio::calibration {
namespace {

constexpr int kIterations = 30;
constexpr double kViewScale = 3;  // Sigma of a six-dimensional residual at which views lose weight.

using Choice = std::vector<bool>;

// What is between a registered pose and its prediction: [dt at the model's centre; dw], camera axes. A turn about the
// model's far origin would show as a translation.
Vector6d residualOf(const Pose& seen, const Pose& predicted, const Eigen::Vector3d& center) {
  Vector6d r;
  r << seen * center - predicted * center, logSO3(seen.linear() * predicted.linear().transpose());
  return r;
}

class AnatomyProblem {
 public:
  AnatomyProblem(const std::vector<AnatomyView>& views, const Eigen::Vector3d& center,
                 const AnatomyRegistrationSettings& settings)
      : views_(views), runs_(views), center_(center), settings_(settings) {}

  const AnatomyRuns& runs() const { return runs_; }

  AnatomyEstimate from(std::size_t view) const {
    AnatomyEstimate state;
    state.T_dsa_cb = views_[view].T_camera_patient.inverse() * views_[view].T_camera_model;
    state.shifts_m.assign(runs_.names.size(), Eigen::Vector3d::Zero());
    return state;
  }

  Vector6d residual(std::size_t i, const AnatomyEstimate& state) const {
    return residualOf(views_[i].T_camera_model, state.predicted(views_[i], runs_.of_view[i]), center_);
  }

  // The registration's, moved to the model's centre, and that of the angles, which turn about the isocentre.
  Matrix6d covariance(std::size_t i, const AnatomyEstimate& state) const {
    const AnatomyView& view = views_[i];
    Matrix6d to_center = Matrix6d::Identity();
    to_center.topRightCorner<3, 3>() = -skew(view.T_camera_model.linear() * center_);
    const Eigen::Vector3d from_isocenter = state.predicted(view, runs_.of_view[i]) * center_ - view.isocenter_camera_m;
    Eigen::Matrix<double, 6, 3> turn;
    turn << -skew(from_isocenter), Eigen::Matrix3d::Identity();
    const double angle = degToRad(settings_.angle_std_deg);
    return to_center * view.covariance * to_center.transpose() + angle * angle * turn * turn.transpose();
  }

  double sigmas(std::size_t i, const AnatomyEstimate& state) const {
    const Vector6d r = residual(i, state);
    return std::sqrt(r.dot(solveSymmetric(covariance(i, state), r)));
  }

  // Gauss-Newton over [dt; dw] of T_dsa_cb and the shifts, the weights anew in each step.
  Eigen::MatrixXd solve(AnatomyEstimate& state, const Choice& chosen, bool robust) const {
    const auto size = static_cast<Eigen::Index>(6 + 3 * runs_.names.size());
    Eigen::MatrixXd A(size, size);
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      A.setZero();
      Eigen::VectorXd b = Eigen::VectorXd::Zero(size);
      for (std::size_t i = 0; i < views_.size(); ++i) {
        if (chosen[i]) addView(i, state, robust, A, b);
      }
      state.addShiftPriors(settings_, A, b);
      const Eigen::VectorXd step = solveSymmetric(A, b);
      state.move(step);
      if (step.norm() < 1e-12) break;
    }
    return inverseOfSymmetric(A);
  }

  // The views that agree best, whatever the others are: half of them, by what is between their rotations.
  double disagreement(const AnatomyEstimate& state) const {
    std::vector<double> angles;
    for (std::size_t i = 0; i < views_.size(); ++i) angles.push_back(residual(i, state).tail<3>().norm());
    std::sort(angles.begin(), angles.end());
    double sum = 0;
    for (std::size_t i = 0; i < angles.size() / 2 + 1; ++i) sum += angles[i];
    return sum;
  }

  AnatomyEstimate start(const Choice& chosen) const {
    AnatomyEstimate best;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < views_.size(); ++i) {
      if (!chosen[i]) continue;
      const AnatomyEstimate candidate = from(i);
      const double here = disagreement(candidate);
      if (!(here < least)) continue;
      least = here;
      best = candidate;
    }
    return best;
  }

 private:
  const std::vector<AnatomyView>& views_;
  AnatomyRuns runs_;
  Eigen::Vector3d center_;
  const AnatomyRegistrationSettings& settings_;

  void addView(std::size_t i, const AnatomyEstimate& state, bool robust, Eigen::MatrixXd& A, Eigen::VectorXd& b) const {
    const Eigen::Matrix3d R = views_[i].T_camera_patient.linear();
    const Eigen::Index at = shiftAt(runs_.of_view[i]);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6, A.cols());
    J.block<3, 3>(0, 0) = R;
    J.block<3, 3>(0, 3) = -R * skew(state.T_dsa_cb.linear() * center_);
    J.block<3, 3>(0, at) = R;
    J.block<3, 3>(3, 3) = R;
    const Vector6d r = residual(i, state);
    const Matrix6d information = inverseOfSymmetric(covariance(i, state));
    const double squares = r.dot(information * r);
    const double weight = robust ? 1 / (1 + squares / (kViewScale * kViewScale)) : 1;
    A += weight * J.transpose() * information * J;
    b += weight * J.transpose() * information * r;
  }
};

void requireViews(const std::vector<AnatomyView>& views) {
  if (views.empty()) throw InputError("registration", "views", "", "must be at least one");
  for (std::size_t i = 0; i < views.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      if (views[i].name == views[k].name)
        throw InputError("registration", "views", views[i].name, "must be given once");
      if (views[i].T_camera_model.isApprox(views[k].T_camera_model, 1e-12)) {
        throw InputError("registration", "views", views[i].name, "is a copy of " + views[k].name);
      }
    }
    if (!(eigenvaluesOfSymmetric(views[i].covariance).minCoeff() > 0)) {
      throw InputError("registration", "covariance", views[i].name, "must be positive definite");
    }
  }
}

std::size_t countOfViews(const Choice& chosen) {
  return static_cast<std::size_t>(std::count(chosen.begin(), chosen.end(), true));
}

// The other views' prediction of each view's rotation.
void predictEach(const AnatomyProblem& problem, const AnatomyEstimate& state, const Choice& used,
                 AnatomyResult& result) {
  if (countOfViews(used) < 3) return;
  double squares = 0;
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (!used[i]) continue;
    Choice others = used;
    others[i] = false;
    AnatomyEstimate without = state;
    problem.solve(without, others, false);
    const double angle = problem.residual(i, without).tail<3>().norm();
    result.views[i].held_out_rotation_rad = angle;
    squares += angle * angle;
  }
  result.held_out_rotation_rms_rad = std::sqrt(squares / static_cast<double>(countOfViews(used)));
}

}  // namespace

AnatomyResult registerAnatomy(const std::vector<AnatomyView>& views, const Eigen::Vector3d& center_model,
                              const AnatomyRegistrationSettings& settings) {
  checkSettings("registration", settings);
  requireViews(views);
  const AnatomyProblem problem(views, center_model, settings);
  const Choice all(views.size(), true);
  AnatomyEstimate state = problem.start(all);
  problem.solve(state, all, true);
  Choice used = all;
  Eigen::MatrixXd covariance;
  for (int round = 0; round < kIterations; ++round) {
    const Choice before = used;
    for (std::size_t i = 0; i < views.size(); ++i) used[i] = problem.sigmas(i, state) < settings.outlier_gate;
    if (2 * countOfViews(used) <= views.size() && views.size() > 1) {
      throw InputError(
          "registration", "views",
          std::to_string(countOfViews(used)) + " of " + std::to_string(views.size()) + " agree on one T_dsa_cb",
          "more than half must: are the angles those of the views, and the registrations right?");
    }
    if (round > 0 && before == used) break;
    covariance = problem.solve(state, used, false);
  }
  AnatomyResult result = state.result(problem.runs(), covariance);
  double chi2 = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Vector6d r = problem.residual(i, state);
    const double sigmas = problem.sigmas(i, state);
    result.views.push_back({views[i].name, r.tail<3>().norm(), r.head<3>().norm(), sigmas, !used[i], std::nullopt});
    if (used[i]) chi2 += sigmas * sigmas;
  }
  // A shift that is free takes up its run's translations.
  const auto free = 6.0 * static_cast<double>(countOfViews(used)) - 6 -
                    (settings.shift_std_mm > 0 ? 3.0 * (static_cast<double>(problem.runs().names.size()) - 1) : 0);
  result.chi2_per_freedom = chi2 / std::max(1.0, free);
  predictEach(problem, state, used, result);
  return result;
}

AnatomyAngleSet readAnatomyAngles(const std::string& path) {
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "angles");
  AnatomyAngleSet set;
  if (const auto machine = map.find("machine")) set.machine = machine->text();
  std::optional<double> common_m;
  if (const auto distance = map.find("source_isocentre_distance_mm")) common_m = 1e-3 * distance->positive();
  std::set<std::string> names;
  for (const YamlField& item : map.need("views").items("must be a list of views", 1)) {
    YamlMap view(path, *item.node, item.key);
    AnatomyAngles angles;
    const YamlField name = view.need("name");
    angles.name = name.text();
    if (!names.insert(angles.name).second) name.refuse("must be given once");
    angles.joints = readJoints(view);
    const auto run = view.find("run");
    angles.run = run ? run->text() : angles.name;
    angles.source_isocenter_distance_m = common_m;
    if (const auto own = view.find("source_isocentre_distance_mm"))
      angles.source_isocenter_distance_m = 1e-3 * own->positive();
    view.refuseOthers();
    set.views.push_back(std::move(angles));
  }
  map.refuseOthers();
  return set;
}

AnatomyAngles dicomAngles(const std::string& name, const std::string& path, int frame) {
  const XaGeometry geometry = XaRun(path).geometry(frame);
  if (!geometry.patient_angles) throw InputError(path, "(0018,1510) Positioner Primary Angle", "", "is missing");
  AnatomyAngles angles;
  angles.name = angles.run = name;
  angles.joints << geometry.patient_angles->primary_rad, geometry.patient_angles->secondary_rad, geometry.table_shift_m;
  angles.source_isocenter_distance_m = geometry.source_isocenter_distance_m;
  return angles;
}

}  // namespace angio::calibration
