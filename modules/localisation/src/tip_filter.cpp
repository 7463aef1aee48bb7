// SPDX-License-Identifier: GPL-2.0-or-later
#include "tip_filter.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"

namespace angio::localisation {

constexpr double kGate = 4;         // Standard deviations of the tip's place in the image.
constexpr double kQuickDoubt = 15;  // Nats below the best: a place that a quick look puts there is not looked at again.
constexpr std::size_t kManyPlaces = 60;  // Fewer are looked at in full at once.
constexpr int kQuickStride = 4;

constexpr double kMaxPeriod_s = 1;
constexpr double kReach = 4;  // Standard deviations.
constexpr double kWorthNaming = 0.01;

namespace {

// The first moments of the places of one branch.
struct BranchMoments {
  double mass = 0, arc_m = 0, arc_squared = 0;
};

// The place at an arc length, between the grid's.
TipPlace placeOf(const PlaceGrid& grid, int branch, const BranchMoments& moments) {
  TipPlace place;
  place.branch = branch;
  place.probability = std::min(moments.mass, 1.0);  // A sum of many may round to more.
  place.arc_m = moments.arc_m / moments.mass;
  const double variance = std::max(0.0, moments.arc_squared / moments.mass - place.arc_m * place.arc_m);
  place.std_m = std::sqrt(variance + grid.spacing_m * grid.spacing_m / 12);
  int above = grid.last_of_branch[branch];
  place.path_m = grid.path_m[above] - grid.arc_m[above] + place.arc_m;
  while (grid.parent[above] >= 0 && grid.path_m[grid.parent[above]] >= place.path_m) above = grid.parent[above];
  const int below = grid.parent[above];
  place.direction_model = grid.directions.col(above);
  place.tip_model = grid.points_m.col(above);
  if (below >= 0 && grid.path_m[above] > grid.path_m[below]) {
    const double weight = (place.path_m - grid.path_m[below]) / (grid.path_m[above] - grid.path_m[below]);
    place.tip_model = (1 - weight) * grid.points_m.col(below) + weight * grid.points_m.col(above);
  }
  return place;
}

}  // namespace

TipFilter::TipFilter(const LocaliserSettings& settings, PlaceGrid grid, const Eigen::Vector3d& centroid_m)
    : settings_(settings), grid_(std::move(grid)), matcher_(settings_, grid_), centroid_m_(centroid_m) {
  for (const int last : grid_.last_of_branch) {
    branch_length_m_.push_back(grid_.arc_m[last]);
    int fork = last;
    while (fork >= 0 && grid_.branch[fork] == grid_.branch[last]) fork = grid_.parent[fork];
    fork_of_branch_.push_back(fork);
  }
  next_probability_.resize(grid_.size());
  next_shift_.resize(grid_.size());
  reset();
}

Eigen::Matrix2d TipFilter::stationary() const {
  return Eigen::Matrix2d::Identity() * std::pow(1e-3 * settings_.shift_std_mm * px_per_m_, 2);
}

void TipFilter::reset() {
  probability_.assign(grid_.size(), 1.0 / grid_.size());
  shift_.assign(grid_.size(), {});
  px_per_m_ = 0;
  candidates_.clear();
}

void TipFilter::reset(int branch, double arc_m, double std_m) {
  if (branch < 0 || branch >= static_cast<int>(branch_length_m_.size())) {
    throw InputError("catheter localiser", "chain", std::to_string(branch), "must be a branch of the tree");
  }
  requireBetween("catheter localiser", "arc_m", arc_m, 0, branch_length_m_[branch] * (1 + 1e-9));
  requirePositive("catheter localiser", "std_m", std_m);
  reset();
  // Along this branch and the route to the root; a frame's motion carries it beyond the branch's end.
  const double middle_m = grid_.path_m[grid_.last_of_branch[branch]] - branch_length_m_[branch] + arc_m;
  std_m = std::max(std_m, 0.5 * grid_.spacing_m);
  probability_.assign(grid_.size(), 0.0);
  double sum = 0;
  for (int i = grid_.last_of_branch[branch]; i >= 0; i = grid_.parent[i]) {
    const double off = (grid_.path_m[i] - middle_m) / std_m;
    sum += probability_[i] = std::exp(-0.5 * off * off);
  }
  for (double& p : probability_) p /= sum;
}

// Places keep the first two moments of the shifts that come to them.
void TipFilter::carry(Shift& to, double weight, const Shift& from) {
  to.mean_px += weight * from.mean_px;
  to.covariance += weight * (from.covariance + from.mean_px * from.mean_px.transpose());
}

void TipFilter::predict(const CatheterMotion& motion) {
  TipMotion reach(settings_, grid_, motion);
  const int count = grid_.size();
  const double jump = settings_.jump_probability / count;
  std::fill(next_probability_.begin(), next_probability_.end(), jump);
  std::fill(next_shift_.begin(), next_shift_.end(), Shift{});
  Shift everywhere;
  for (int i = 0; i < count; ++i) {
    if (probability_[i] < 1e-3 * jump) continue;
    carry(everywhere, probability_[i], shift_[i]);
    for (const Reach& to : reach.from(i)) {
      const double weight = probability_[i] * to.probability;
      next_probability_[to.place] += weight;
      carry(next_shift_[to.place], weight, shift_[i]);
    }
  }
  const double period_s = std::isfinite(motion.period_s) && motion.period_s > 0 ? motion.period_s : 1;
  const double kept = std::exp(-period_s / settings_.shift_time_s);
  double sum = 0;
  for (int i = 0; i < count; ++i) {
    Shift& shift = next_shift_[i];
    carry(shift, jump, everywhere);
    shift.mean_px /= next_probability_[i];
    shift.covariance = shift.covariance / next_probability_[i] - shift.mean_px * shift.mean_px.transpose();
    shift.mean_px *= kept;
    shift.covariance = kept * kept * shift.covariance + (1 - kept * kept) * stationary();
    sum += next_probability_[i];
  }
  for (double& p : next_probability_) p /= sum;
  probability_.swap(next_probability_);
  shift_.swap(next_shift_);
}

std::optional<std::string> TipFilter::project(const SeenPose& pose) {
  if (!pose.T_camera_model.matrix().allFinite() || rotationDefect(pose.T_camera_model.linear()) > 1e-6) {
    return "the pose is not a rigid transform";
  }
  if (!pose.covariance.allFinite() || pose.covariance.diagonal().minCoeff() < 0) {
    return "the pose's covariance is not one";
  }
  in_camera_m_.noalias() = pose.T_camera_model.linear() * grid_.points_m;
  in_camera_m_.colwise() += pose.T_camera_model.translation();
  if (!(in_camera_m_.row(2).minCoeff() > 1e-3)) return "a part of the tree is not in front of the X-ray source";
  const auto& camera = pose.camera.parameters();
  projected_px_.resize(2, grid_.size());
  projected_px_.row(0) = camera.fx_px * in_camera_m_.row(0).cwiseQuotient(in_camera_m_.row(2)).array() + camera.cx_px;
  projected_px_.row(1) = camera.fy_px * in_camera_m_.row(1).cwiseQuotient(in_camera_m_.row(2)).array() + camera.cy_px;
  rescale(camera.fx_px / (pose.T_camera_model * centroid_m_).z());
  return std::nullopt;
}

// Shifts are kept in pixels of the last frame.
void TipFilter::rescale(double px_per_m) {
  const bool first = px_per_m_ == 0;
  const double ratio = first ? 1 : px_per_m / px_per_m_;
  px_per_m_ = px_per_m;
  for (Shift& shift : shift_) {
    shift.mean_px *= ratio;
    shift.covariance *= ratio * ratio;
    if (first) shift.covariance = stationary();
  }
}

TipFilter::Expected TipFilter::expected(int place, const SeenPose& pose) const {
  // A point p of the camera's frame moves by dt + dw x (p - t), see RegistrationResult::covariance.
  const Eigen::Vector3d p = in_camera_m_.col(place);
  Eigen::Matrix<double, 3, 6> moved;
  moved << Eigen::Matrix3d::Identity(), -skew(p - pose.T_camera_model.translation());
  Eigen::Matrix<double, 2, 3> J;
  pose.camera.project(p, &J);
  const Eigen::Matrix<double, 3, 6> shaken = moved * pose.covariance;
  const Eigen::Matrix2d registered = J * (shaken * moved.transpose()) * J.transpose();
  const double depth_variance = (shaken * moved.transpose())(2, 2);
  Expected result;
  result.total = shift_[place].covariance + registered;
  result.prior.mean << shift_[place].mean_px, 0, 0;
  result.prior.information.setZero();
  result.prior.information.topLeftCorner<2, 2>() = (result.total + 1e-4 * Eigen::Matrix2d::Identity()).inverse();
  const double scale_std = settings_.scale_std_percent / 100, roll_std_rad = degToRad(settings_.roll_std_deg);
  result.prior.information(2, 2) = 1 / (scale_std * scale_std + depth_variance / (p.z() * p.z()));
  result.prior.information(3, 3) = 1 / (roll_std_rad * roll_std_rad + pose.covariance(5, 5));
  return result;
}

// Looks at all places whose projection may be the curve's end.
void TipFilter::collect(const SeenCatheter& seen, const SeenPose& pose, bool tip_is_last) {
  const CurveSamples curve = samplesOf(seen, settings_.step_px, tip_is_last);
  const Eigen::Matrix2d tip_covariance =
      Eigen::Matrix2d::Identity() * (settings_.tip_std_px * settings_.tip_std_px + std::pow(settings_.model_std_px, 2));
  collected_.clear();
  for (int i = 0; i < grid_.size(); ++i) {
    const Eigen::Vector2d off = curve.points_px.front() - projected_px_.col(i) - shift_[i].mean_px;
    const double roughly_px = 6 * kGate * (1e-3 * settings_.shift_std_mm * px_per_m_ + settings_.tip_std_px);
    if (pose.covariance.isZero() && off.squaredNorm() > roughly_px * roughly_px) continue;
    const Expected e = expected(i, pose);
    if (off.dot((e.total + tip_covariance).inverse() * off) > kGate * kGate) continue;
    collected_.push_back({i, tip_is_last, {}});
  }
  std::optional<Misfit> start;
  const bool many = collected_.size() > kManyPlaces;
  if (many) {
    matcher_.prepare(projected_px_, curve, kQuickStride);
    double best = -1e300;
    for (Candidate& one : collected_) {
      one.match = matcher_.match(one.place, expected(one.place, pose).prior, 1);
      best = std::max(best, one.match.log_evidence + std::log(probability_[one.place]));
    }
    const auto hopeless = [&](const Candidate& one) {
      return one.match.log_evidence + std::log(probability_[one.place]) < best - kQuickDoubt;
    };
    collected_.erase(std::remove_if(collected_.begin(), collected_.end(), hopeless), collected_.end());
  }
  matcher_.prepare(projected_px_, curve, 1);
  for (Candidate& one : collected_) {
    if (many) start = one.match.misfit;
    one.match = matcher_.match(one.place, expected(one.place, pose).prior, many ? 2 : 3, start);
  }
  candidates_.insert(candidates_.end(), collected_.begin(), collected_.end());
}

FrameOutcome TipFilter::observe(const SeenCatheter& seen, const SeenPose& pose) {
  FrameOutcome outcome;
  if (auto defect = defectOf(seen)) return outcome.why = *defect, outcome;
  if (auto defect = project(pose)) return outcome.why = *defect, outcome;
  candidates_.clear();
  collect(seen, pose, true);
  if (seen.tip_end == TipEnd::kUnknown) collect(seen, pose, false);
  if (candidates_.empty()) return outcome.why = "no place of the tree is near the curve's end", outcome;
  const auto score = [&](const Candidate& one) { return one.match.log_evidence + std::log(probability_[one.place]); };
  const Candidate& best = *std::max_element(candidates_.begin(), candidates_.end(),
                                            [&](const auto& a, const auto& b) { return score(a) < score(b); });
  outcome.residual_px = best.match.residual_px;
  outcome.shift_px = best.match.misfit.head<2>();
  if (best.match.residual_px > settings_.lost_px) {
    outcome.why = formatted("the best path lies %.1f px from the curve on average", best.match.residual_px);
    return outcome;
  }
  outcome.log_evidence = weigh(pose);
  outcome.used = true;
  return outcome;
}

// Bayes: probabilities by the candidates' evidence, shifts by their misfits. Returns the logarithm of what the
// frame's evidence is on average.
double TipFilter::weigh(const SeenPose& pose) {
  double best = -1e300;
  for (const Candidate& one : candidates_) {
    best = std::max(best, one.match.log_evidence + std::log(probability_[one.place]));
  }
  std::fill(next_probability_.begin(), next_probability_.end(), 0.0);
  std::copy(shift_.begin(), shift_.end(), next_shift_.begin());
  double sum = 0;
  for (const Candidate& one : candidates_) {
    const int i = one.place;
    const double weight = std::exp(one.match.log_evidence + std::log(probability_[i]) - best);
    if (weight <= next_probability_[i]) continue;  // The other end of the curve explains it better.
    sum += weight - next_probability_[i];
    next_probability_[i] = weight;
    // The misfit's shift is the patient's and the registration's together; the patient's part is a Kalman step of it.
    const Eigen::Matrix2d total = expected(i, pose).total + 1e-4 * Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d gain = shift_[i].covariance * total.inverse();
    next_shift_[i].mean_px = shift_[i].mean_px + gain * (one.match.misfit.head<2>() - shift_[i].mean_px);
    next_shift_[i].covariance =
        shift_[i].covariance - gain * (total - one.match.covariance.topLeftCorner<2, 2>()) * gain.transpose();
  }
  for (double& p : next_probability_) p /= sum;
  probability_.swap(next_probability_);
  shift_.swap(next_shift_);
  return best + std::log(sum);
}

// A belief as a navigator reads it: branches, arc lengths, standard deviations.
TipBelief TipFilter::summarised(const std::vector<double>& probability) const {
  std::vector<BranchMoments> moments(grid_.last_of_branch.size());
  for (int i = 0; i < grid_.size(); ++i) {
    BranchMoments& branch = moments[grid_.branch[i]];
    branch.mass += probability[i];
    branch.arc_m += probability[i] * grid_.arc_m[i];
    branch.arc_squared += probability[i] * grid_.arc_m[i] * grid_.arc_m[i];
  }
  std::vector<int> order(moments.size());
  for (std::size_t c = 0; c < order.size(); ++c) order[c] = static_cast<int>(c);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return moments[a].mass > moments[b].mass; });
  TipBelief belief;
  belief.tip = placeOf(grid_, order.front(), moments[order.front()]);
  for (std::size_t k = 1; k < order.size() && moments[order[k]].mass > kWorthNaming; ++k) {
    belief.alternatives.push_back(placeOf(grid_, order[k], moments[order[k]]));
  }
  for (int i = 0; i < grid_.size(); ++i) {
    const bool near =
        (grid_.points_m.col(i) - belief.tip.tip_model).squaredNorm() <= std::pow(1e-3 * settings_.near_mm, 2);
    if (near) belief.near_probability += probability[i];
  }
  belief.near_probability = std::min(belief.near_probability, 1.0);
  return belief;
}

TipMotion::TipMotion(const LocaliserSettings& settings, const PlaceGrid& grid, const CatheterMotion& motion)
    : grid_(grid) {
  const bool timed = std::isfinite(motion.period_s) && motion.period_s > 0;
  const double period_s = timed ? std::min(motion.period_s, kMaxPeriod_s) : kMaxPeriod_s;
  const double fastest_m = 1e-3 * settings.max_speed_mm_per_s * period_s;
  const bool pushed = motion.pushed_m && std::isfinite(*motion.pushed_m);
  if (pushed) mean_m_ = std::clamp(*motion.pushed_m, -fastest_m, fastest_m);
  const double slip_m = pushed ? settings.slip_std * std::abs(mean_m_) : 1e-3 * settings.speed_std_mm_per_s * period_s;
  const double doubt_m = std::isfinite(motion.loose_m) ? std::hypot(slip_m, motion.loose_m) : slip_m;
  // Less than half a step would not let the mean move by parts of a step.
  std_m_ = std::max(std::hypot(doubt_m, 1e-3 * settings.backlash_mm), 0.5 * grid.spacing_m);
  const double max_m = std::max(fastest_m, 2 * grid.spacing_m);
  lowest_m_ = std::max(mean_m_ - kReach * std_m_, -max_m);
  highest_m_ = std::min(mean_m_ + kReach * std_m_, max_m);
}

// A route back and then ahead into another branch is as unlikely as the shorter of its parts is long.
void TipMotion::add(int place, double back_m, double ahead_m, double share) {
  const double moved_m = ahead_m - back_m;
  if (moved_m < lowest_m_ || moved_m > highest_m_) return;
  const double off = (moved_m - mean_m_) / std_m_, turn = std::min(back_m, ahead_m) / std_m_;
  reached_.push_back({place, share * std::exp(-0.5 * (off * off + turn * turn))});
}

void TipMotion::descend(int place, double back_m, double ahead_m, double share, int except) {
  add(place, back_m, ahead_m, share);
  if (ahead_m - back_m > highest_m_ || ahead_m > kReach * std_m_ + std::abs(mean_m_)) return;
  const auto& children = grid_.children[place];
  const int choices = static_cast<int>(children.size()) - (except >= 0 ? 1 : 0);
  for (const int child : children) {
    if (child == except) continue;
    descend(child, back_m, ahead_m + grid_.path_m[child] - grid_.path_m[place], share / choices, -1);
  }
}

const std::vector<Reach>& TipMotion::from(int from) {
  reached_.clear();
  descend(from, 0, 0, 1, -1);
  const double max_back_m = kReach * std_m_ + std::abs(mean_m_);
  for (int below = from, at = grid_.parent[from]; at >= 0; below = at, at = grid_.parent[at]) {
    const double back_m = grid_.path_m[from] - grid_.path_m[at];
    if (back_m > max_back_m) break;
    descend(at, back_m, 0, 1, below);
  }
  double sum = 0;
  for (const Reach& one : reached_) sum += one.probability;
  if (!(sum > 0)) {
    // Pushed on at the vessel's end, or pulled back at the root: there it stays.
    reached_.assign(1, {from, 1.0});
    return reached_;
  }
  for (Reach& one : reached_) one.probability /= sum;
  return reached_;
}

}  // namespace angio::localisation
