// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>

#include "anatomy_estimate.hpp"
#include "angio/base/errors.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/vessel/resample.hpp"

namespace angio::calibration {
namespace {

constexpr double kSpacing_m = 0.5e-3;   // Of model points: a pixel or two apart in the image.
constexpr double kFarthest_px = 8;      // Of a match; what is further off belongs to no vessel of the model,
constexpr double kOtherWay = 0.88;      // and so does what runs more than 28 deg differently (its cosine).
constexpr double kCorrelation_px = 10;  // Neighbours on a curve err together: so much of it is one observation.
constexpr double kMinAnatomyNoise_px = 0.05;
constexpr double kMadToSigma = 1.4826;
constexpr int kRefinementIterations = 20;

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
    found.push_back({model.points.col(in_front[nearest]), {-directions(1, nearest), directions(0, nearest)}, q});
  }
  return found;
}

class PoseRefinement {
 public:
  PoseRefinement(const AnatomyResult& from, const std::vector<AnatomyView>& views, const std::vector<SeenAnatomy>& seen,
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
    for (int iteration = 0; iteration < kRefinementIterations; ++iteration) {
      A.setZero();
      Eigen::VectorXd b = Eigen::VectorXd::Zero(size);
      addPriors(A, b);
      for (std::size_t v = 0; v < views_.size(); ++v) {
        if (!from_.views[v].outlier) addView(v, A, b);
      }
      move(solveSymmetric(A, b));
    }
    AnatomyResult result = state_.result(runs_, inverseOfSymmetric(A));
    result.views = from_.views;
    result.chi2_per_freedom = from_.chi2_per_freedom;
    result.held_out_rotation_rms_rad = from_.held_out_rotation_rms_rad;
    for (std::size_t v = 0; v < views_.size(); ++v) {
      if (!result.views[v].outlier) result.views[v].rotation_rad = rotationAngle(turns_[v]);
    }
    return result;
  }

 private:
  AnatomyRuns runs_;
  ModelPoints model_;
  const std::vector<AnatomyView>& views_;
  const std::vector<SeenAnatomy>& seen_;
  const AnatomyResult& from_;
  const AnatomyRegistrationSettings& settings_;
  AnatomyEstimate state_;
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
    const auto middle = sizes.begin() + sizes.size() / 2;
    std::nth_element(sizes.begin(), middle, sizes.end());
    const double std_px = std::max(kMinAnatomyNoise_px, kMadToSigma * *middle);
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
  return PoseRefinement(result, views, seen, tree, settings).solve();
}

}  // namespace angio::calibration
