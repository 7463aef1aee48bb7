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
#include "angio/vessel/resample.hpp"

namespace angio::perception {
namespace {

constexpr int kFirst = 4;
constexpr std::size_t kMost = 32;
// Frames that follow each other sooner show the same: the catheter has hardly moved, nor has the breath.
constexpr double kApart_s = 0.4;

// A curve that has this share of the image's points is all that it shows.
constexpr double kOnlyCurve = 0.9;

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

std::optional<SeenCatheter> onlyCurve(const XrayView& view) {
  Centerline2d seen = view.centerline;
  seen.kind.assign(static_cast<std::size_t>(seen.size()), CurveKind::kDevice);
  auto catheter = seenCatheter(seen, view.camera);
  if (!catheter || static_cast<double>(catheter->points_px.cols()) < kOnlyCurve * seen.size()) return std::nullopt;
  return catheter;
}

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

// A catheter lies anywhere in its vessel: half a radius off the axis, as a standard deviation. At least 1 mm, as a
// point of the vessel may also have gone along it, which a curve does not show.
double besideAxis_m(const VesselTree& vessels) {
  constexpr double kLeast_m = 1e-3;
  double sum_m = 0;
  int known = 0;
  for (const auto& radius_m : vessels.radii()) {
    if (radius_m) sum_m += *radius_m, ++known;
  }
  return known > 0 ? std::max(kLeast_m, 0.5 * sum_m / known) : kLeast_m;
}

// Errors of four brains deformed by 5 mm (20 runs, 115 frames) are 1.0 mm across the beam at scores above 0.8, and 1.3,
// 1.4 and 1.8 mm in each tenth below.
double asExplained(const AlignmentScore& alignment) {
  constexpr double kWell = 0.85, kByScore = 4;
  return 1 + kByScore * std::max(0.0, kWell - alignment.score());
}

// What a tree may be bent by where no curve shows it, per axis: as much as trees are that registration is tried on.
constexpr double kBend_m = 5e-3;

// What goes together of a deformation at places so far apart: Matern 5/2, as DeformationFit has it.
double correlation(double distance_m) {
  constexpr double kLength_m = 30e-3;
  const double x = std::sqrt(5.0) * distance_m / kLength_m;
  return (1 + x + x * x / 3) * std::exp(-x);
}

// What a fit to a catheter's curve claims of a point, and what it cannot know.
class WithUnknowns final : public PointUncertainty {
 public:
  WithUnknowns(const RegistrationResult& fit, double beside_m, double depth_m, const VesselTree& vessels)
      : fit_(PatientObservation::of(fit)),
        beside_m_(beside_m),
        depth_m_(depth_m),
        vessels_(vessels.points()),
        tip_(vessels_.rightCols<1>()) {}

  Eigen::Matrix3d covarianceAt(const Eigen::Vector3d& p_model) const override {
    const Eigen::Vector3d ray = (fit_.T_camera_model * p_model).normalized();
    const double near = std::max(0.0, 1 - (p_model - tip_).norm() / kNearTip_m);
    const double beside_m = beside_m_ + near * std::max(0.0, kAtTip_m - beside_m_);
    const double shared = correlation(std::sqrt((vessels_.colwise() - p_model).colwise().squaredNorm().minCoeff()));
    const double own_m2 = kBend_m * kBend_m * (1 - shared * shared);
    return fit_.pointCovariance(p_model) + (beside_m * beside_m + own_m2) * Eigen::Matrix3d::Identity() +
           depth_m_ * depth_m_ * ray * ray.transpose();
  }

 private:
  // The newest vessels have been seen by few frames, and may be taken for their neighbours.
  static constexpr double kNearTip_m = 40e-3, kAtTip_m = 2.6e-3;
  PatientObservation fit_;
  double beside_m_, depth_m_;
  Eigen::Matrix3Xd vessels_;
  Eigen::Vector3d tip_;
};

// Adds to a fit's claims where the catheter lies in its vessel, and depth as open as it was before the run: vessels
// that bend make up for what a curve's size would say of it.
void addUnknowns(const VesselTree& vessels, RegistrationResult& fit) {
  if (!fit.covariance) return;
  const double beside_m = asExplained(fit.alignment) * besideAxis_m(vessels),
               depth_m = 1e-3 * SequenceSettings().pose_translation_std_mm;
  fit.points = std::make_shared<WithUnknowns>(fit, beside_m, depth_m, vessels);
  const Eigen::Vector3d unknown_m2(beside_m * beside_m, beside_m * beside_m, beside_m * beside_m + depth_m * depth_m);
  fit.covariance->diagonal().head<3>() += unknown_m2;
  if (!fit.spread) return;
  fit.spread->across_m = std::hypot(fit.spread->across_m, std::sqrt(unknown_m2.head<2>().sum()));
  fit.spread->all_m = std::hypot(fit.spread->all_m, std::sqrt(unknown_m2.sum()));
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
  const auto curve = onlyCurve(view);
  if (!curve) return std::nullopt;
  if (kept_ > 0 && time_us <= last_us_) {
    frames_.clear();
    kept_ = 0;
    due_ = false;
    learning_.reset();
    pinned_.reset();
  }
  const auto since_s = [time_us](std::int64_t before_us) { return 1e-6 * static_cast<double>(time_us - before_us); };
  SequenceFrame frame{*curve, {view.camera, T_camera_model, Matrix6d::Zero()}, {}};
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
  auto by = registered(view, frame, belief);
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
    if (!goOn()) learning_.reset();
  }
}

// One more round. Returns whether there are others to come.
bool CatheterRegistration::goOn() {
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

RegistrationResult ofWholeTree(const RegisteredByCatheter& by) {
  RegistrationResult result = by.result;
  if (result.covariance) result.covariance->diagonal().head<3>().array() += kBend_m * kBend_m;
  if (result.status == RegistrationStatus::kConverged) {
    result.reason = "by a catheter alone: of the vessels that it lies in, and across the beam";
  }
  return result;
}

PatientObservation observationAt(const Eigen::Vector3d& p_model, const RegisteredByCatheter& by,
                                 const VesselTree& tree) {
  const RegistrationResult& seen = by.result;
  PatientObservation patient = PatientObservation::of(seen);
  const Eigen::Matrix3d known = patient.pointCovariance(p_model);
  const Eigen::Vector3d lever = patient.T_camera_model.linear() * p_model;
  if (seen.displacements_m.cols() == tree.size()) {
    patient.T_camera_model =
        patient.T_camera_model * Eigen::Translation3d(seen.displacements_m.col(nearestPoint(tree, p_model)));
  }
  const Eigen::Matrix3d rotation = patient.covariance.bottomRightCorner<3, 3>();
  patient.covariance = covarianceAbout(lever, known, rotation);
  return patient;
}

}  // namespace angio::perception
