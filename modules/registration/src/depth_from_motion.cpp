// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/depth_from_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "across_beam.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/geometry/matern.hpp"
#include "angio/registration/alignment_score.hpp"
#include "deformation_posterior.hpp"
#include "fit_classification.hpp"
#include "fit_uncertainty.hpp"
#include "frame_evidence.hpp"
#include "newest_frame.hpp"
#include "pose_prior_term.hpp"

namespace angio::registration {
namespace {

// Observations that take part: the system is of their number. In rounds before the last fewer are enough.
constexpr std::size_t kMaxGroups = 2400, kRoughGroups = 600;
constexpr int kRounds = 2;
// Over which a deformation goes together, as for a single image.
const double kLength_m = 1e-3 * DeformationSettings().length_mm;
// A residual so many standard deviations off was matched with another vessel.
constexpr double kMismatch = 4;

// The patient moves across the axis of the turn by about as much as along it, and half of that deforms the tree. The
// way in and the way out of a breath differ: a third of the motion lags or leads.
constexpr double kAcross = 1, kDeforms = 0.5, kOfLag = 0.33;
// What leads by more would be told by frames that are still to come: of that the last frames know nothing.
constexpr std::array<double, 3> kLags_s = {-0.1, 0.2, 0.4};
constexpr double kStill_m = 0.1e-3;
// A breath is a Gaussian process of such a length (Matern 5/2); frames tell its way along the axis with such a standard
// deviation.
constexpr double kBreath_s = 1, kSeen_m = 0.1e-3;

// How far a frame may be off for itself, per axis [m].
constexpr std::array<double, 5> kUnexplained_m = {0.01e-3, 0.05e-3, 0.15e-3, 0.4e-3, 1e-3};
constexpr std::size_t kMaxAskedOfMotion = 120;

struct Chosen {
  std::vector<const MovingFrame*> frames;
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();  // Of the turn, patient axes.
  double turn_rad = 0;
};

Eigen::Vector3d beamOf(const MovingFrame& frame) { return frame.T_camera_patient.linear().row(2).transpose(); }

// Evenly over the frames that have something to say, the newest among them.
Chosen choose(const std::vector<MovingFrame>& frames) {
  std::vector<const MovingFrame*> all;
  for (const MovingFrame& frame : frames) {
    if (frame.evidence && !frame.evidence->groups.empty()) all.push_back(&frame);
  }
  Chosen chosen;
  const std::size_t count = std::min(all.size(), kMaxTurnFrames);
  for (std::size_t k = 0; k < count; ++k) {
    chosen.frames.push_back(count > 1 ? all[k * (all.size() - 1) / (count - 1)] : all[k]);
  }
  for (const MovingFrame* a : chosen.frames) {
    for (const MovingFrame* b : chosen.frames) {
      const Eigen::Vector3d across = beamOf(*a).cross(beamOf(*b));
      const double turn_rad = std::asin(std::min(1.0, across.norm()));
      if (turn_rad <= chosen.turn_rad) continue;
      chosen.turn_rad = turn_rad;
      chosen.axis = across.normalized();
    }
  }
  return chosen;
}

// How far the patient is along the axis of the turn in each frame, zero mean [m].
struct Signal {
  Eigen::VectorXd along_m;
  // Second moments of the same some time before and after, summed over kLags_s, with what is not known of it between
  // frames, before the first and after the last.
  Eigen::MatrixXd shifted_m2;
  double rms_m = 0;
};

Signal signalOf(const Chosen& chosen) {
  const auto n = static_cast<Eigen::Index>(chosen.frames.size());
  Signal signal{Eigen::VectorXd(n), Eigen::MatrixXd::Zero(n, n), 0};
  for (Eigen::Index f = 0; f < n; ++f) {
    const MovingFrame& frame = *chosen.frames[f];
    const Eigen::Vector3d seen =
        frame.T_camera_patient.inverse() * (frame.evidence->T_camera_centered * frame.evidence->middle);
    signal.along_m[f] = chosen.axis.dot(seen);
  }
  signal.along_m.array() -= signal.along_m.mean();
  signal.rms_m = std::sqrt(signal.along_m.squaredNorm() / static_cast<double>(n));
  if (!(signal.rms_m > kStill_m)) {
    signal.along_m.setZero();
    return signal;
  }
  const auto correlations = [&](double lag_s) {
    Eigen::MatrixXd of(n, n);
    for (Eigen::Index f = 0; f < n; ++f) {
      for (Eigen::Index g = 0; g < n; ++g) {
        const double apart_s = std::abs(chosen.frames[f]->time_s - lag_s - chosen.frames[g]->time_s);
        of(f, g) = maternCorrelation(std::sqrt(5.0) * apart_s / kBreath_s);
      }
    }
    return of;
  };
  // Gaussian process regression of what frames saw, at the times that lag.
  const Eigen::MatrixXd together = correlations(0);
  const double noise = kSeen_m / signal.rms_m;
  Eigen::MatrixXd seen = together;
  seen.diagonal().array() += noise * noise;
  const Eigen::MatrixXd inverse = inverseOfSymmetric(seen);
  for (const double lag_s : kLags_s) {
    const Eigen::MatrixXd cross = correlations(lag_s), gain = cross * inverse;
    const Eigen::VectorXd shifted_m = gain * signal.along_m;
    signal.shifted_m2 += shifted_m * shifted_m.transpose();
    signal.shifted_m2 += signal.rms_m * signal.rms_m * (together - gain * cross.transpose());
  }
  return signal;
}

Moments momentsOf(const Signal& signal, std::vector<Eigen::Index> of_group, double unexplained_m, double amplitude_m) {
  const Eigen::MatrixXd moves =
      kAcross * kAcross * signal.along_m * signal.along_m.transpose() + kOfLag * kOfLag * signal.shifted_m2;
  Moments moments;
  moments.of_group = std::move(of_group);
  moments.shift_m2 = moves;
  moments.shift_m2.diagonal().array() += unexplained_m * unexplained_m;
  const double deforms = kDeforms / std::max(0.1e-3, amplitude_m);
  moments.deformation = deforms * deforms * moves;
  moments.deformation.array() += 1;
  return moments;
}

// All frames' observations about one pose of the patient and the displacements at each.
class Window {
 public:
  Window(const Chosen& chosen, const Pose& T_patient_centered) : T_patient_centered_(T_patient_centered) {
    const std::size_t each = std::max<std::size_t>(8, kMaxGroups / chosen.frames.size());
    for (std::size_t f = 0; f < chosen.frames.size(); ++f) {
      const FrameEvidence& evidence = *chosen.frames[f]->evidence;
      const std::size_t stride = (evidence.groups.size() + each - 1) / each;
      for (std::size_t i = 0; i < evidence.groups.size(); i += stride) {
        const ResidualGroup& group = evidence.groups[i];
        const auto there = evidence.camera.project(evidence.T_camera_centered * group.at);
        if (!there || !(group.normal.squaredNorm() > 1e-6)) continue;
        // Means over a group are not quite those of its mean place.
        const double offset_px = group.residual_px - group.normal.dot(*there - group.pixel);
        observations_.push_back({&group, &evidence.camera, chosen.frames[f]->T_camera_patient, offset_px,
                                 static_cast<Eigen::Index>(f), Eigen::Vector3d::Zero()});
      }
    }
  }

  std::size_t size() const { return observations_.size(); }

  // Of every `stride`-th, linear about the pose and the displacements as they are.
  std::vector<ResidualGroup> groups(std::size_t stride) const {
    std::vector<ResidualGroup> result;
    for (std::size_t i = 0; i < observations_.size(); i += stride) {
      const Observation& o = observations_[i];
      const Pose T = o.T_camera_patient * T_patient_centered_;
      ResidualGroup group = *o.group;
      const Eigen::Vector3d displaced = group.at + o.displacement;
      Eigen::Matrix<double, 2, 3> J;
      const auto there = o.camera->project(T * displaced, &J);
      if (there) {
        group.gradient = T.linear().transpose() * J.transpose() * group.normal;
        group.jacobian << group.gradient, displaced.cross(group.gradient);
        group.residual_px = group.normal.dot(*there - group.pixel) + o.offset_px - group.gradient.dot(o.displacement);
      }
      result.push_back(group);
    }
    return result;
  }

  std::vector<Eigen::Index> moments(std::size_t stride) const {
    std::vector<Eigen::Index> result;
    for (std::size_t i = 0; i < observations_.size(); i += stride) result.push_back(observations_[i].moment);
    return result;
  }

  void take(const DeformationPosterior& posterior) {
    for (std::size_t from = 0, to = 0; from < observations_.size(); from = to) {
      const Eigen::Index moment = observations_[from].moment;
      while (to < observations_.size() && observations_[to].moment == moment) ++to;
      Eigen::Matrix3Xd at(3, static_cast<Eigen::Index>(to - from));
      for (std::size_t i = from; i < to; ++i) at.col(i - from) = observations_[i].group->at;
      const Eigen::Matrix3Xd displacements_m = posterior.displacements(at, moment);
      for (std::size_t i = from; i < to; ++i) {
        observations_[i].displacement = displacements_m.col(i - from);
      }
    }
    T_patient_centered_ = T_patient_centered_ * expSE3(posterior.twist());
    T_patient_centered_.linear() = nearestRotation(T_patient_centered_.linear());
  }

  // Of every `stride`-th, by what is left of it.
  void drop(const Eigen::VectorXd& normalized, std::size_t stride) {
    std::vector<Observation> kept;
    for (std::size_t i = 0; i < observations_.size(); ++i) {
      if (i % stride != 0 || std::abs(normalized[i / stride]) <= kMismatch) kept.push_back(observations_[i]);
    }
    observations_ = std::move(kept);
  }

  const Pose& T_patient_centered() const { return T_patient_centered_; }

 private:
  struct Observation {
    const ResidualGroup* group;
    const XrayCamera* camera;
    Pose T_camera_patient;
    double offset_px;
    Eigen::Index moment;
    Eigen::Vector3d displacement;
  };
  std::vector<Observation> observations_;
  Pose T_patient_centered_;
};

// The size for which the residuals speak most; asked of some of them.
double unexplainedBy(const std::vector<ResidualGroup>& groups, const std::vector<Eigen::Index>& of_group,
                     const Signal& signal, const ErrorSizes& sizes, double length_m) {
  std::vector<ResidualGroup> some;
  std::vector<Eigen::Index> their;
  const std::size_t stride = (groups.size() + kMaxAskedOfMotion - 1) / kMaxAskedOfMotion;
  for (std::size_t i = 0; i < groups.size(); i += stride) {
    some.push_back(groups[i]);
    their.push_back(of_group[i]);
  }
  const DeformationProcess process(some, length_m, kOneViewShape);
  double best = -1e300;
  std::vector<std::pair<double, double>> tried;
  for (const double unexplained_m : kUnexplained_m) {
    const Moments moments = momentsOf(signal, their, unexplained_m, sizes.deformation_m);
    const double log_likelihood = restrictedLogLikelihood(process, some, moments, sizes);
    if (!std::isfinite(log_likelihood)) continue;
    tried.emplace_back(log_likelihood, unexplained_m);
    best = std::max(best, log_likelihood);
  }
  double sum = 0, mean2_m2 = 0;
  for (const auto& [log_likelihood, unexplained_m] : tried) {
    const double probability = std::exp(log_likelihood - best);
    sum += probability;
    mean2_m2 += probability * unexplained_m * unexplained_m;
  }
  return sum > 0 ? std::sqrt(mean2_m2 / sum) : kUnexplained_m.back();
}

}  // namespace

std::optional<DepthFromMotion> depthFromMotion(const std::vector<MovingFrame>& frames, const XrayView& view,
                                               const PosePrior& prior, const VesselTree& tree) {
  const Chosen chosen = choose(frames);
  if (chosen.frames.size() < static_cast<std::size_t>(kMinTurnFrames) || !(chosen.turn_rad >= kMinBeamTurn_rad)) {
    return std::nullopt;
  }
  const MovingFrame& newest = *chosen.frames.back();
  const FrameEvidence& evidence = *newest.evidence;
  if (evidence.groups.size() < static_cast<std::size_t>(kMinGroups)) return std::nullopt;
  const Pose T_patient_camera = newest.T_camera_patient.inverse();
  const Signal signal = signalOf(chosen);
  const ErrorSizes sizes = errorSizes(DeformationProcess(evidence.groups, kLength_m, kOneViewShape), evidence.groups);

  // The belief is of the patient: the centred model's axes are the same in every frame.
  PosePriorTerm belief = beliefOf(prior, OrientedKernelSettings{}, evidence.centroid);
  belief.T0_camera_centered = T_patient_camera * belief.T0_camera_centered;
  Window window(chosen, T_patient_camera * evidence.T_camera_centered);
  std::shared_ptr<const DeformationPosterior> posterior;
  double unexplained_m = 0;
  for (int round = 0; round < kRounds; ++round) {
    if (window.size() < static_cast<std::size_t>(kMinGroups)) return std::nullopt;
    const std::size_t stride = round + 1 < kRounds ? window.size() / kRoughGroups + 1 : 1;
    const auto groups = window.groups(stride);
    if (round == 0) unexplained_m = unexplainedBy(groups, window.moments(stride), signal, sizes, kLength_m);
    posterior = std::make_shared<DeformationPosterior>(
        groups, momentsOf(signal, window.moments(stride), unexplained_m, sizes.deformation_m), sizes, belief,
        window.T_patient_centered(), kLength_m, kOneViewShape);
    if (!posterior->known()) return std::nullopt;
    window.take(*posterior);
    if (round + 1 < kRounds) window.drop(posterior->normalizedLeftover(), stride);
  }
  const Pose T_camera_centered = newest.T_camera_patient * window.T_patient_centered();
  DepthFromMotion result;
  RegistrationResult& seen = result.registration;
  seen.T_camera_model = T_camera_centered * Eigen::Translation3d(-evidence.centroid);
  seen.prior = belief.source;
  seen.points_3d = tree.size();
  seen.points_2d = view.centerline.size();
  const Eigen::Matrix3Xd centered = tree.points().colwise() - evidence.centroid;
  const auto alignmentOf = [&](const Eigen::Matrix3Xd& displacements_m) {
    return alignmentScore(tree, tree.points() + displacements_m, {view}, seen.T_camera_model);
  };
  seen.displacements_m = posterior->displacements(centered);
  seen.alignment = alignmentOf(seen.displacements_m);
  NewestFrame frame(tree, view, T_camera_centered, evidence.centroid);
  Eigen::Matrix3Xd displaced = frame.displaced(*posterior);
  if (posterior->amplitude_m() > kWorthRefining_m) {
    const Eigen::Matrix3Xd refined = frame.refined(displaced, kLength_m);
    Eigen::Matrix3Xd displacements_m = frame.ofTree(refined);
    const AlignmentScore alignment = alignmentOf(displacements_m);
    // What explains no more stays: small trees that deform smoothly were further off by it.
    if (alignment.score() > seen.alignment.score() + kSameScore) {
      displaced = refined;
      seen.displacements_m = std::move(displacements_m);
      seen.alignment = alignment;
    }
  }
  setUncertainty(posterior, centered, T_camera_centered, evidence.centroid, seen, {1, frame.misfit(displaced), 1});
  const PosePriorTerm usual = beliefOf({prior.T_camera_model, {}}, OrientedKernelSettings{}, evidence.centroid);
  seen.low_score_suffices = isNearStart(usual, T_camera_centered);
  classifyInMotion(tree, seen);
  result.turn_rad = chosen.turn_rad;
  result.axis = chosen.axis;
  result.frames = static_cast<int>(chosen.frames.size());
  result.patient_motion_m = signal.rms_m;
  result.unexplained_m = unexplained_m;
  return result;
}

}  // namespace angio::registration
