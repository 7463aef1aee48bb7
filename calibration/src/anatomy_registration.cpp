// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/anatomy_registration.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/vessel/resample.hpp"

namespace angio::calibration {
namespace {

constexpr int kIterations = 30;
constexpr double kMinShift_m = 1e-6;  // What a shift that is none may be.
constexpr double kRobustScale = 3;    // Sigma of a six-dimensional residual at which views lose weight.

using Choice = std::vector<bool>;

// Names of the runs in the order of their first views, and each view's run by its number.
struct Runs {
  std::vector<std::string> names;
  std::vector<std::size_t> of_view;

  explicit Runs(const std::vector<AnatomyView>& views) {
    for (const AnatomyView& view : views) {
      const auto at = std::find(names.begin(), names.end(), view.run);
      of_view.push_back(static_cast<std::size_t>(at - names.begin()));
      if (at == names.end()) names.push_back(view.run);
    }
  }
};

// Where the shift of a run stands among an estimate's numbers, behind [dt; dw] of T_dsa_cb.
Eigen::Index shiftAt(std::size_t run) { return static_cast<Eigen::Index>(6 + 3 * run); }

// T_dsa_cb and the shift of each run [m].
struct State {
  Pose T_dsa_cb = Pose::Identity();
  std::vector<Eigen::Vector3d> shifts_m;

  Pose predicted(const AnatomyView& view, std::size_t run) const {
    return view.T_camera_patient * Eigen::Translation3d(shifts_m[run]) * T_dsa_cb;
  }

  void move(const Eigen::VectorXd& step) {
    T_dsa_cb.translation() += step.head<3>();
    T_dsa_cb.linear() = expSO3(step.segment<3>(3)) * T_dsa_cb.linear();
    for (std::size_t r = 0; r < shifts_m.size(); ++r) shifts_m[r] += step.segment<3>(shiftAt(r));
  }

  void addShiftPriors(const AnatomyRegistrationSettings& settings, Eigen::MatrixXd& A, Eigen::VectorXd& b) const {
    const double std_m = std::max(kMinShift_m, 1e-3 * settings.shift_std_mm);
    for (std::size_t r = 0; r < shifts_m.size(); ++r) {
      A.diagonal().segment<3>(shiftAt(r)).array() += 1 / (std_m * std_m);
      b.segment<3>(shiftAt(r)) -= shifts_m[r] / (std_m * std_m);
    }
  }

  // `covariance` is of all numbers, those of the shifts behind the first six.
  AnatomyResult result(const Runs& runs, const Eigen::MatrixXd& covariance) const {
    AnatomyResult result;
    result.T_dsa_cb = T_dsa_cb;
    result.covariance = covariance.topLeftCorner<6, 6>();
    for (std::size_t r = 0; r < runs.names.size(); ++r) {
      result.runs.push_back({runs.names[r], shifts_m[r], covariance.block<3, 3>(shiftAt(r), shiftAt(r))});
    }
    return result;
  }
};

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

  const Runs& runs() const { return runs_; }

  State from(std::size_t view) const {
    State state;
    state.T_dsa_cb = views_[view].T_camera_patient.inverse() * views_[view].T_camera_model;
    state.shifts_m.assign(runs_.names.size(), Eigen::Vector3d::Zero());
    return state;
  }

  Vector6d residual(std::size_t i, const State& state) const {
    return residualOf(views_[i].T_camera_model, state.predicted(views_[i], runs_.of_view[i]), center_);
  }

  // The registration's, moved to the model's centre, and that of the angles, which turn about the isocentre.
  Matrix6d covariance(std::size_t i, const State& state) const {
    const AnatomyView& view = views_[i];
    Matrix6d to_center = Matrix6d::Identity();
    to_center.topRightCorner<3, 3>() = -skew(view.T_camera_model.linear() * center_);
    const Eigen::Vector3d from_isocenter = state.predicted(view, runs_.of_view[i]) * center_ - view.isocenter_camera_m;
    Eigen::Matrix<double, 6, 3> turn;
    turn << -skew(from_isocenter), Eigen::Matrix3d::Identity();
    const double angle = degToRad(settings_.angle_std_deg);
    return to_center * view.covariance * to_center.transpose() + angle * angle * turn * turn.transpose();
  }

  double sigmas(std::size_t i, const State& state) const {
    const Vector6d r = residual(i, state);
    return std::sqrt(r.dot(covariance(i, state).ldlt().solve(r)));
  }

  // Gauss-Newton over [dt; dw] of T_dsa_cb and the shifts, the weights anew in each step.
  Eigen::MatrixXd solve(State& state, const Choice& chosen, bool robust) const {
    const auto size = static_cast<Eigen::Index>(6 + 3 * runs_.names.size());
    Eigen::MatrixXd A(size, size);
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      A.setZero();
      Eigen::VectorXd b = Eigen::VectorXd::Zero(size);
      for (std::size_t i = 0; i < views_.size(); ++i) {
        if (chosen[i]) addView(i, state, robust, A, b);
      }
      state.addShiftPriors(settings_, A, b);
      const Eigen::VectorXd step = A.ldlt().solve(b);
      state.move(step);
      if (step.norm() < 1e-12) break;
    }
    return A.ldlt().solve(Eigen::MatrixXd::Identity(size, size));
  }

  // The views that agree best, whatever the others are: half of them, by what is between their rotations.
  double disagreement(const State& state) const {
    std::vector<double> angles;
    for (std::size_t i = 0; i < views_.size(); ++i) angles.push_back(residual(i, state).tail<3>().norm());
    std::sort(angles.begin(), angles.end());
    double sum = 0;
    for (std::size_t i = 0; i < angles.size() / 2 + 1; ++i) sum += angles[i];
    return sum;
  }

  State start(const Choice& chosen) const {
    State best;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < views_.size(); ++i) {
      if (!chosen[i]) continue;
      const State candidate = from(i);
      const double here = disagreement(candidate);
      if (!(here < least)) continue;
      least = here;
      best = candidate;
    }
    return best;
  }

 private:
  const std::vector<AnatomyView>& views_;
  Runs runs_;
  Eigen::Vector3d center_;
  const AnatomyRegistrationSettings& settings_;

  void addView(std::size_t i, const State& state, bool robust, Eigen::MatrixXd& A, Eigen::VectorXd& b) const {
    const Eigen::Matrix3d R = views_[i].T_camera_patient.linear();
    const Eigen::Index at = shiftAt(runs_.of_view[i]);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6, A.cols());
    J.block<3, 3>(0, 0) = R;
    J.block<3, 3>(0, 3) = -R * skew(state.T_dsa_cb.linear() * center_);
    J.block<3, 3>(0, at) = R;
    J.block<3, 3>(3, 3) = R;
    const Vector6d r = residual(i, state);
    const Matrix6d information = covariance(i, state).ldlt().solve(Matrix6d::Identity());
    const double squares = r.dot(information * r);
    const double weight = robust ? 1 / (1 + squares / (kRobustScale * kRobustScale)) : 1;
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
    const Eigen::LLT<Matrix6d> llt(views[i].covariance);
    if (llt.info() != Eigen::Success) {
      throw InputError("registration", "covariance", views[i].name, "must be positive definite");
    }
  }
}

std::size_t count(const Choice& chosen) {
  return static_cast<std::size_t>(std::count(chosen.begin(), chosen.end(), true));
}

// The other views' prediction of each view's rotation.
void predictEach(const AnatomyProblem& problem, const State& state, const Choice& used, AnatomyResult& result) {
  if (count(used) < 3) return;
  double squares = 0;
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (!used[i]) continue;
    Choice others = used;
    others[i] = false;
    State without = state;
    problem.solve(without, others, false);
    const double angle = problem.residual(i, without).tail<3>().norm();
    result.views[i].held_out_rotation_rad = angle;
    squares += angle * angle;
  }
  result.held_out_rotation_rms_rad = std::sqrt(squares / static_cast<double>(count(used)));
}

}  // namespace

AnatomyResult registerAnatomy(const std::vector<AnatomyView>& views, const Eigen::Vector3d& center_model,
                              const AnatomyRegistrationSettings& settings) {
  checkSettings("registration", settings);
  requireViews(views);
  const AnatomyProblem problem(views, center_model, settings);
  const Choice all(views.size(), true);
  State state = problem.start(all);
  problem.solve(state, all, true);
  Choice used = all;
  Eigen::MatrixXd covariance;
  for (int round = 0; round < kIterations; ++round) {
    const Choice before = used;
    for (std::size_t i = 0; i < views.size(); ++i) used[i] = problem.sigmas(i, state) < settings.outlier_gate;
    if (2 * count(used) <= views.size() && views.size() > 1) {
      throw InputError("registration", "views",
                       std::to_string(count(used)) + " of " + std::to_string(views.size()) + " agree on one T_dsa_cb",
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
  const auto free = 6.0 * static_cast<double>(count(used)) - 6 -
                    (settings.shift_std_mm > 0 ? 3.0 * (static_cast<double>(problem.runs().names.size()) - 1) : 0);
  result.chi2_per_freedom = chi2 / std::max(1.0, free);
  predictEach(problem, state, used, result);
  return result;
}

namespace {

constexpr double kSpacing_m = 0.5e-3;   // Of model points: a pixel or two apart in the image.
constexpr double kFarthest_px = 8;      // Of a match; what is further off belongs to no vessel of the model,
constexpr double kOtherWay = 0.88;      // and so does what runs more than 28 deg differently (its cosine).
constexpr double kCorrelation_px = 10;  // Neighbours on a curve err together: so much of it is one observation.
constexpr double kMinNoise_px = 0.05;
constexpr double kMadToSigma = 1.4826;
constexpr int kRefinements = 20;

struct Match {
  Eigen::Vector3d p_model;
  Eigen::Vector2d normal, seen_px;
};

struct ModelPoints {
  Eigen::Matrix3Xd points, tangents;

  explicit ModelPoints(const VesselTree& tree) : points(tree.points()), tangents(tree.tangents()) {}
};

// Each image point with the nearest projected vessel that runs the same way.
std::vector<Match> matches(const ModelPoints& model, const SeenAnatomy& seen, const Pose& T) {
  std::vector<Eigen::Index> in_front;
  Eigen::Matrix2Xd pixels(2, model.points.cols()), directions(2, model.points.cols());
  for (Eigen::Index i = 0; i < model.points.cols(); ++i) {
    Eigen::Matrix<double, 2, 3> J;
    const auto pixel = seen.camera.project(T * model.points.col(i), &J);
    const Eigen::Vector2d direction = J * (T.linear() * model.tangents.col(i));
    if (!pixel || !(direction.norm() > 0)) continue;
    const auto at = static_cast<Eigen::Index>(in_front.size());
    pixels.col(at) = *pixel;
    directions.col(at) = direction.normalized();
    in_front.push_back(i);
  }
  std::vector<Match> found;
  for (int k = 0; k < seen.centerline.size(); ++k) {
    const Eigen::Vector2d q = seen.centerline.points_px.col(k);
    const double angle = seen.centerline.tangent_rad[k];
    const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
    double least = kFarthest_px * kFarthest_px;
    Eigen::Index nearest = -1;
    for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(in_front.size()); ++i) {
      const double squares = (pixels.col(i) - q).squaredNorm();
      if (squares >= least || std::abs(directions.col(i).dot(along)) < kOtherWay) continue;
      least = squares;
      nearest = i;
    }
    if (nearest < 0) continue;
    found.push_back({model.points.col(in_front[static_cast<std::size_t>(nearest)]),
                     {-directions(1, nearest), directions(0, nearest)},
                     q});
  }
  return found;
}

class Refinement {
 public:
  Refinement(const AnatomyResult& from, const std::vector<AnatomyView>& views, const std::vector<SeenAnatomy>& seen,
             const VesselTree& tree, const AnatomyRegistrationSettings& settings)
      : runs_(views),
        model_(resampled(tree, kSpacing_m, 20000).tree),
        views_(views),
        seen_(seen),
        from_(from),
        settings_(settings),
        turns_(views.size(), Eigen::Matrix3d::Identity()) {
    state_.T_dsa_cb = from.T_dsa_cb;
    for (const RunShift& run : from.runs) state_.shifts_m.push_back(run.shift_m);
  }

  AnatomyResult solve() {
    const auto size = static_cast<Eigen::Index>(6 + 3 * runs_.names.size() + 3 * views_.size());
    Eigen::MatrixXd A(size, size);
    for (int iteration = 0; iteration < kRefinements; ++iteration) {
      A.setZero();
      Eigen::VectorXd b = Eigen::VectorXd::Zero(size);
      addPriors(A, b);
      for (std::size_t v = 0; v < views_.size(); ++v) {
        if (!from_.views[v].outlier) addView(v, A, b);
      }
      move(A.ldlt().solve(b));
    }
    AnatomyResult result = state_.result(runs_, A.ldlt().solve(Eigen::MatrixXd::Identity(size, size)));
    result.views = from_.views;
    result.chi2_per_freedom = from_.chi2_per_freedom;
    result.held_out_rotation_rms_rad = from_.held_out_rotation_rms_rad;
    for (std::size_t v = 0; v < views_.size(); ++v) {
      if (!result.views[v].outlier) result.views[v].rotation_rad = rotationAngle(turns_[v]);
    }
    return result;
  }

 private:
  Runs runs_;
  ModelPoints model_;
  const std::vector<AnatomyView>& views_;
  const std::vector<SeenAnatomy>& seen_;
  const AnatomyResult& from_;
  const AnatomyRegistrationSettings& settings_;
  State state_;
  std::vector<Eigen::Matrix3d> turns_;  // The angles' errors: turns about the isocentre, camera axes.

  Eigen::Index turnAt(std::size_t view) const { return shiftAt(runs_.names.size() + view); }

  Pose poseOf(std::size_t v) const {
    Pose turn = Pose::Identity();
    turn.linear() = turns_[v];
    turn.translation() = views_[v].isocenter_camera_m - turns_[v] * views_[v].isocenter_camera_m;
    return turn * state_.predicted(views_[v], runs_.of_view[v]);
  }

  void addPriors(Eigen::MatrixXd& A, Eigen::VectorXd& b) const {
    state_.addShiftPriors(settings_, A, b);
    const double angle = degToRad(settings_.angle_std_deg);
    for (std::size_t v = 0; v < views_.size(); ++v) {
      A.diagonal().segment<3>(turnAt(v)).array() += 1 / (angle * angle);
      b.segment<3>(turnAt(v)) -= logSO3(turns_[v]) / (angle * angle);
    }
  }

  void addView(std::size_t v, Eigen::MatrixXd& A, Eigen::VectorXd& b) const {
    const Pose T = poseOf(v);
    const std::vector<Match> found = matches(model_, seen_[v], T);
    if (found.empty()) return;
    std::vector<double> errors, sizes;
    for (const Match& match : found) {
      errors.push_back(match.normal.dot(match.seen_px - *seen_[v].camera.project(T * match.p_model)));
      sizes.push_back(std::abs(errors.back()));
    }
    const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
    std::nth_element(sizes.begin(), middle, sizes.end());
    const double std_px = std::max(kMinNoise_px, kMadToSigma * *middle);
    const double share = 1 / std::max(1.0, kCorrelation_px / meanSpacing(seen_[v].centerline));
    const Eigen::Matrix3d R = turns_[v] * views_[v].T_camera_patient.linear();
    const Eigen::Index shift = shiftAt(runs_.of_view[v]), turn = turnAt(v);
    Eigen::VectorXd row = Eigen::VectorXd::Zero(A.cols());
    for (std::size_t k = 0; k < found.size(); ++k) {
      const Eigen::Vector3d p = T * found[k].p_model;
      Eigen::Matrix<double, 2, 3> Jp;
      seen_[v].camera.project(p, &Jp);
      const Eigen::RowVector3d by_point = found[k].normal.transpose() * Jp;
      row.setZero();
      row.segment<3>(0) = (by_point * R).transpose();
      row.segment<3>(3) = (-by_point * R * skew(state_.T_dsa_cb.linear() * found[k].p_model)).transpose();
      row.segment<3>(shift) = row.segment<3>(0);
      row.segment<3>(turn) = (-by_point * skew(p - views_[v].isocenter_camera_m)).transpose();
      const double scaled = errors[k] / std_px;
      const double weight = share / (std_px * std_px * (1 + scaled * scaled / 4));
      A.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
      b += weight * errors[k] * row;
    }
    A.triangularView<Eigen::StrictlyUpper>() = A.transpose();
  }

  static double meanSpacing(const Centerline2d& centerline) {
    double sum = 0, steps = 0;
    for (int k = 1; k < centerline.size(); ++k) {
      const double step = (centerline.points_px.col(k) - centerline.points_px.col(k - 1)).norm();
      if (step > kCorrelation_px) continue;  // To the next branch.
      sum += step;
      ++steps;
    }
    return steps > 0 ? std::max(1e-3, sum / steps) : kCorrelation_px;
  }

  void move(const Eigen::VectorXd& step) {
    state_.move(step);
    for (std::size_t v = 0; v < views_.size(); ++v) turns_[v] = expSO3(step.segment<3>(turnAt(v))) * turns_[v];
  }
};

}  // namespace

AnatomyResult refineAnatomy(const AnatomyResult& result, const std::vector<AnatomyView>& views,
                            const std::vector<SeenAnatomy>& seen, const VesselTree& tree,
                            const AnatomyRegistrationSettings& settings) {
  if (views.size() != seen.size() || views.size() != result.views.size()) {
    throw InputError("registration", "views", std::to_string(seen.size()), "must each have a centreline");
  }
  return Refinement(result, views, seen, tree, settings).solve();
}

}  // namespace angio::calibration
