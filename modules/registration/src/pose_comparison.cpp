// SPDX-License-Identifier: GPL-2.0-or-later
#include "pose_comparison.hpp"

#include <algorithm>
#include <cmath>

#include "angio/geometry/decompositions.hpp"
#include "fit_classification.hpp"

namespace angio::registration {

constexpr double kCompared_px = 3;
// A point of the model has found its vessel where the kernel sum is half of a vessel's.
constexpr double kMatchedMass = 0.5;
// A different pose is compared where it matters: at the distance that a right fit leaves.
constexpr double kAlternative_px = 2;
// What the belief finds less likely than this (chi-square of 6, one in a million) is no alternative.
constexpr double kBelievable = 38;

Pose depthMirrored(const Pose& T_camera_centered, const Eigen::Vector3d& flat_axis) {
  // Across the beam to the centroid, not across the optical axis: a tree at the detector's edge is seen at a slant.
  const Eigen::Vector3d beam = T_camera_centered.translation().normalized();
  const Eigen::Matrix3d S = Eigen::Matrix3d::Identity() - 2 * beam * beam.transpose();
  const Eigen::Matrix3d P = Eigen::Matrix3d::Identity() - 2 * flat_axis * flat_axis.transpose();
  Pose mirrored = T_camera_centered;
  mirrored.linear() = S * T_camera_centered.linear() * P;
  return mirrored;
}

PoseComparison::PoseComparison(const OrientedModel& model, FieldSearch& fields, LineFit& lines)
    : model_(model), fields_(fields), lines_(lines) {
  flat_axis_ = eigenOfSymmetric(model.points * model.points.transpose()).vectors.col(0);
}

// Share of the model's points in view that have found a vessel; 1 where it does not count.
double PoseComparison::modelShare(const PosePriorTerm& belief, PoseCandidate& candidate) const {
  if (small_) return 1;
  fields_.ascend(*frame_, belief, model_.subsets.back(), kFieldScales - 1, 0, {kMatchedMass}, candidate);
  return candidate.score;
}

void PoseComparison::rank(const PosePriorTerm& belief, std::vector<PoseCandidate>& candidates,
                          const LineFitPlan& plan) {
  for (auto& candidate : candidates) {
    candidate.T_camera_centered = lines_.fit(*frame_, belief, candidate.T_camera_centered, plan).T_camera_centered;
    const double model = modelShare(belief, candidate);
    candidate.score = model * lines_.explained(*frame_, candidate.T_camera_centered, kCompared_px, plan.max_points);
  }
  std::sort(candidates.begin(), candidates.end(), better);
}

double PoseComparison::score(const PosePriorTerm& belief, const Pose& T_camera_centered) const {
  PoseCandidate candidate{T_camera_centered, 1};
  return modelShare(belief, candidate) *
         lines_.explained(*frame_, T_camera_centered, kAlternative_px, kQuick.max_points);
}

PoseCandidate PoseComparison::bestAlternative(const PosePriorTerm& belief, const std::vector<Pose>& known,
                                              const std::vector<PoseCandidate>& others) const {
  const Pose& T_camera_centered = known.front();
  const auto different = [&](const Pose& T) {
    return std::all_of(known.begin(), known.end(), [&](const Pose& other) {
      const Pose between = other.inverse() * T;
      const double turn_m = model_.radius_m * rotationAngle(between.linear());
      return std::hypot(between.translation().norm(), turn_m) > kDifferentPose_m;
    });
  };
  PoseCandidate best{T_camera_centered, 0};
  const auto ask = [&](const Pose& T) {
    if (!different(T)) return;
    const double its_score = score(belief, T);
    if (its_score > best.score) best = {T, its_score};
  };
  for (const auto& other : others) ask(other.T_camera_centered);
  // Always asked: what is flat or far looks the same from both sides, and no number of draws need come upon it.
  if (mirrorIsOpen(belief, T_camera_centered)) {
    PoseCandidate mirrored{depthMirrored(T_camera_centered, flat_axis_), 0};
    // Fitted as if it had been believed: else the belief, which may be in the wrong one of the two, draws it back.
    PosePriorTerm there = belief;
    there.T0_camera_centered = mirrored.T_camera_centered;
    for (int scale = 1; scale < kFieldScales; ++scale) {
      fields_.ascend(*frame_, there, model_.subsets[scale], scale, 6, {kMatchedMass}, mirrored);
    }
    ask(lines_.fit(*frame_, there, mirrored.T_camera_centered, kQuick).T_camera_centered);
  }
  return best;
}

bool PoseComparison::mirrorIsOpen(const PosePriorTerm& belief, const Pose& T_camera_centered) const {
  return !small_ && frame_->viewCount() == 1 && belief.cost(depthMirrored(T_camera_centered, flat_axis_)) < kBelievable;
}

}  // namespace angio::registration
