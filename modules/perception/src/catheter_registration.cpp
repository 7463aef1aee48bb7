// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/catheter_registration.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "angio/base/formatted.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/perception/registration_gate.hpp"
#include "catheter_claims.hpp"
#include "lone_catheter.hpp"

namespace angio::perception {
namespace {

constexpr int kFirst = 4;
constexpr std::size_t kMost = 32;
// Frames that follow each other sooner show the same: the catheter has hardly moved, nor has the breath.
constexpr double kApart_s = 0.4;

// So much longer than the curve are the vessels under it taken to be: lengths in the image differ by what bends.
constexpr double kLonger = 1.05;

// Other answers are looked for from starts so far aside, and no further than a few of these standard deviations from
// them. One whose tip is further off than this counts when it is less than so many nats worse (e^20 to one).
constexpr double kAside_m = 20e-3, kNear_m = 5e-3, kDoubt = 20;
constexpr double kAside[][2] = {{kAside_m, 0}, {-kAside_m, 0}, {0, kAside_m}, {0, -kAside_m}};
constexpr double kNearAside_mm = 5;

// What a frame's pose may be off by when the run is pinned: its own shift across the beam, and what the run leaves open
// of depth and rotation. Standard deviations.
constexpr double kAcross_m = 3e-3, kDepth_m = 20e-3, kRotation_rad = kPi / 180;

double lengthOf_px(const SeenCatheter& seen) {
  const Eigen::Index steps = seen.points_px.cols() - 1;
  return (seen.points_px.rightCols(steps) - seen.points_px.leftCols(steps)).colwise().norm().sum();
}

// The tree's points from the root to the tip, as far as a curve of that length in the image reaches back from it.
std::vector<int> pointsUnder(double length_px, const TipPlace& tip, const VesselTree& tree, const TreeTopology& map,
                             const XrayCamera& camera, const Pose& T_camera_model) {
  const std::vector<int> chain = map.pointsTo({tip.branch, tip.arc_m});
  std::size_t first = chain.size();
  std::optional<Eigen::Vector2d> beyond;
  for (double left_px = length_px; first > 0 && left_px >= 0;) {
    const auto pixel = camera.project(T_camera_model * tree.points().col(chain[--first]));
    if (!pixel) break;
    if (beyond) left_px -= (*pixel - *beyond).norm();
    beyond = pixel;
  }
  return {chain.begin() + static_cast<std::ptrdiff_t>(first), chain.end()};
}

VesselTree chainOf(const std::vector<int>& points, const VesselTree& tree) {
  Eigen::Matrix3Xd place(3, static_cast<Eigen::Index>(points.size()));
  std::vector<int> parents;
  std::vector<std::optional<double>> radii;
  for (std::size_t k = 0; k < points.size(); ++k) {
    place.col(static_cast<Eigen::Index>(k)) = tree.points().col(points[k]);
    parents.push_back(static_cast<int>(k) - 1);
    radii.push_back(tree.radii()[static_cast<std::size_t>(points[k])]);
  }
  return VesselTree(place, parents, radii);
}

// A pose whose translation is uncertain along the camera's axes.
PosePrior believed(const Pose& T_camera_model) {
  PosePrior prior{T_camera_model, Matrix6d::Zero()};
  const Eigen::Matrix3d R = T_camera_model.linear();
  const Eigen::Vector3d std_m(kAcross_m, kAcross_m, kDepth_m);
  prior.covariance->topLeftCorner<3, 3>() = R.transpose() * std_m.cwiseAbs2().asDiagonal() * R;
  prior.covariance->bottomRightCorner<3, 3>().diagonal().setConstant(kRotation_rad * kRotation_rad);
  return prior;
}

// A run that has pinned its vessels explains its curves well. One in a neighbour does where that can be bent to it.
void requireWellExplained(RegistrationResult& fit) {
  constexpr double kScore = 0.7;
  if (fit.status != RegistrationStatus::kConverged || fit.alignment.score() >= kScore) return;
  fit.status = RegistrationStatus::kAmbiguous;
  fit.reason =
      formatted("catheter and the vessels that it lies in explain each other with a score of %.2f, less than %g",
                fit.alignment.score(), kScore);
}

bool explainsAll(const SequenceResult& result) {
  return std::all_of(result.beliefs.begin(), result.beliefs.end(),
                     [](const TipBelief& belief) { return belief.status == BeliefStatus::kSeen; });
}

// Whether the same run may as well be elsewhere.
bool contradicts(const SequenceResult& other, const SequenceResult& found) {
  return (other.path.back().tip_model - found.path.back().tip_model).norm() > kNear_m &&
         other.log_evidence > found.log_evidence - kDoubt;
}

}  // namespace

CatheterRegistration::CatheterRegistration(const OrientedKernelSettings& method, const VesselTree& tree,
                                           int rounds_at_once)
    : method_(method), tree_(tree), rounds_at_once_(rounds_at_once) {
  method_.deformation = Deformation::kNonrigid;
  checkSettings("catheter registration", method_);
}

std::optional<RegisteredByCatheter> CatheterRegistration::observe(const XrayView& view, const Pose& T_camera_model,
                                                                  std::int64_t time_us) {
  const Stopwatch watch;
  const auto lone = loneCatheter(view.centerline, view.camera);
  if (!lone) return std::nullopt;
  if (kept_ > 0 && time_us <= last_us_) {
    frames_.clear();
    kept_ = 0;
    due_ = false;
    learning_.reset();
    pinned_.reset();
  }
  const auto since_s = [time_us](std::int64_t before_us) { return 1e-6 * static_cast<double>(time_us - before_us); };
  SequenceFrame frame{lone->seen, {view.camera, T_camera_model, Matrix6d::Zero()}, {}};
  if (kept_ > 0) frame.motion.period_s = since_s(kept_us_);
  if (kept_ == 0 || since_s(kept_us_) >= kApart_s) {
    frames_.push_back(frame);
    if (frames_.size() > kMost) frames_.pop_front();
    ++kept_;
    kept_us_ = time_us;
    due_ |= kept_ >= kFirst && (kept_ & (kept_ - 1)) == 0;
  }
  CatheterMotion motion;
  motion.period_s = since_s(std::exchange(last_us_, time_us));
  if (!pinned_) return std::nullopt;
  SeenPose pose = frame.pose;
  pose.T_camera_model = pose.T_camera_model * pinned_->correction;
  const TipBelief belief = pinned_->localiser.update(frame.seen, pose, motion);
  if (!isFromFrame(belief)) return std::nullopt;
  auto by = registered({lone->curve, view.camera, view.T_view_first, view.collimator_px, view.image}, frame, belief);
  if (by) by->result.times.total_s = watch.seconds();
  return by;
}

void CatheterRegistration::learn() {
  if (!learning_ && std::exchange(due_, false)) {
    std::vector<SequenceFrame> frames(frames_.begin(), frames_.end());
    SequenceLocaliser localiser(frames, tree_);
    learning_.emplace(Learning{std::move(frames), std::move(localiser), {}, 0, kept_});
  }
  for (int round = 0; learning_ && (rounds_at_once_ == 0 || round < rounds_at_once_); ++round) {
    if (!learnRound()) learning_.reset();
  }
}

// One more round. Returns whether there are others to come.
bool CatheterRegistration::learnRound() {
  if (!learning_->localiser.step()) return true;
  const SequenceResult& other = learning_->localiser.result();
  if (!learning_->found) {
    if (!other.converged || !explainsAll(other)) return false;
    learning_->found = other;
  } else if (explainsAll(other) && contradicts(other, *learning_->found)) {
    return false;
  }
  const bool stands_alone = pinned_.has_value() || learning_->aside == std::size(kAside);
  if (stands_alone) {
    pin(*learning_);
    return false;
  }
  SequenceSettings nearby;
  nearby.pose_translation_std_mm = kNearAside_mm;
  std::vector<SequenceFrame> moved = learning_->frames;
  const auto& [x_m, y_m] = kAside[learning_->aside++];
  for (SequenceFrame& frame : moved) {
    Pose& T = frame.pose.T_camera_model;
    T = T * learning_->found->correction;
    T.translation().head<2>() += Eigen::Vector2d(x_m, y_m);
  }
  learning_->localiser = SequenceLocaliser(std::move(moved), tree_, nearby);
  return true;
}

// By what the run has shown up to when learning began, and the frames since then.
void CatheterRegistration::pin(const Learning& learnt) {
  const SequenceResult& found = *learnt.found;
  const VesselTree bent(tree_.points() + found.displacements_m, tree_.parents(), tree_.radii());
  const TipPlace& tip = found.beliefs.back().tip;
  pinned_.emplace(Pinned{found.correction, bent, TreeTopology(bent), CatheterLocaliser({}, bent)});
  const double length_m = pinned_->map.length_m(tip.branch);
  pinned_->localiser.reset(tip.branch, std::min(tip.arc_m, length_m), std::max(tip.std_m, 1e-3));
  const std::size_t since = std::min(frames_.size(), static_cast<std::size_t>(kept_ - learnt.kept));
  for (std::size_t k = frames_.size() - since; k < frames_.size(); ++k) {
    SeenPose pose = frames_[k].pose;
    pose.T_camera_model = pose.T_camera_model * found.correction;
    (void)pinned_->localiser.update(frames_[k].seen, pose, frames_[k].motion);
  }
  last_us_ = kept_us_;
}

std::optional<RegisteredByCatheter> CatheterRegistration::registered(const XrayView& view, const SequenceFrame& frame,
                                                                     const TipBelief& belief) const {
  const VesselTree& bent = pinned_->bent;
  Pose T = frame.pose.T_camera_model * pinned_->correction;
  const double pixel_m = (T * belief.tip.tip_model).z() / view.camera.parameters().fx_px;
  T.translation().head<2>() += pixel_m * belief.shift_px;
  const std::vector<int> under =
      pointsUnder(kLonger * lengthOf_px(frame.seen), belief.tip, bent, pinned_->map, view.camera, T);
  if (under.size() < 2) return std::nullopt;
  RegisteredByCatheter by{{}, chainOf(under, bent), under, {}};
  by.result = makeRegistration(method_, by.vessels)->search({view}, believed(T), {});
  Eigen::Matrix3Xd displacements_m = bent.points() - tree_.points();
  for (std::size_t k = 0; k < under.size() && by.result.displacements_m.cols() > 0; ++k) {
    displacements_m.col(under[k]) += by.result.displacements_m.col(static_cast<Eigen::Index>(k));
  }
  by.result.displacements_m = displacements_m;
  addUnknowns(by.vessels, by.result);
  requireWellExplained(by.result);
  const RegistrationGate gate({}, by.vessels.centroid(), TargetNeed::kAcrossBeam);
  by.rejection = gate.contradiction(by.result, T, T);
  return by;
}

}  // namespace angio::perception
