// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_fit.hpp"
#include "angio/geometry/decompositions.hpp"

#include <algorithm>
#include <cmath>

#include "oriented_frame.hpp"

namespace angio::registration {

// Rounds on a part of the image: enough for gate and weights to follow the noise.
constexpr int kFirstRounds = 3;
// Below this the model's own edges, which are chords of deforms, are no better than the image [px].
constexpr double kMinNoise_px = 0.05;
// Weights fall off at so many times the noise: 98.6 % efficient on normal noise.
constexpr double kLineToleranceOverNoise = 3, kLineGateOverNoise = 4.5;
constexpr double kMinTolerance_px = 0.3, kMinLineGate_px = 1;

const OrientedPoints& LineFit::chosen(const OrientedFrame& frame, std::size_t view, int max_points) {
  const OrientedPoints& all = frame.points(view);
  const int stride = (frame.pointCount() + max_points - 1) / std::max(1, max_points);
  if (stride <= 1) return all;
  if (chosen_.size() < frame.viewCount()) chosen_.resize(frame.viewCount());
  thinned(all, stride, chosen_[view]);
  return chosen_[view];
}

double LineFit::explained(const OrientedFrame& frame, const Pose& T_camera_centered, double scale_px, int max_points) {
  double sum = 0, total = 0;
  for (std::size_t v = 0; v < frame.viewCount(); ++v) {
    const XrayView& view = frame.views()[v];
    const OrientedPoints& image = chosen(frame, v, max_points);
    projected_.project(model_.points, model_.edges, view.camera, view.T_view_first * T_camera_centered);
    for (int j = 0; j < image.size(); ++j) {
      const auto near = projected_.nearest(image.u[j], image.v[j], image.cos2[j], image.sin2[j],
                                           static_cast<float>(3 * scale_px), static_cast<float>(kMinCos2));
      total += image.mass_px[j];
      if (near.edge >= 0) sum += image.mass_px[j] * std::exp(-near.distance2_px2 / (2 * scale_px * scale_px));
    }
  }
  return total > 0 ? sum / total : 0;
}

LineFitResult LineFit::fit(const OrientedFrame& frame, const PosePriorTerm& belief, const Pose& T_start,
                           const LineFitPlan& plan) {
  LineFitResult result;
  result.T_camera_centered = T_start;
  double gate = plan.gate_px, tolerance = gate / 2;
  if (matches_.size() < frame.viewCount()) matches_.resize(frame.viewCount());
  used_.resize(frame.viewCount());
  for (int round = 0; round < plan.max_rounds; ++round) {
    // Far from the answer a part of the image says as much as all of it.
    const int max_points = round < kFirstRounds ? std::min(plan.first_points, plan.max_points) : plan.max_points;
    int points = 0;
    for (std::size_t v = 0; v < frame.viewCount(); ++v) {
      const XrayView& view = frame.views()[v];
      const OrientedPoints& image = chosen(frame, v, max_points);
      used_[v] = &image;
      projected_.project(model_.points, model_.edges, view.camera, view.T_view_first * result.T_camera_centered);
      matchLines(image, projected_, gate, kMinCos2, matches_[v]);
      if (round >= kFirstRounds) softenShared(image, projected_, kMinCos2, matches_[v]);
      resolveMatches(model_.points, model_.edges, matches_[v]);
      points += image.size();
    }
    for (int step = 0; step < 2; ++step) {
      LineSums sums;
      double pixels_per_metre = 0;
      for (std::size_t v = 0; v < frame.viewCount(); ++v) {
        const XrayView& view = frame.views()[v];
        const Pose T = view.T_view_first * result.T_camera_centered;
        addLineEquations(*used_[v], matches_[v], view.camera, T, tolerance, sums);
        pixels_per_metre =
            std::max(pixels_per_metre, view.camera.parameters().fx_px / std::max(0.05, T.translation().z()));
      }
      if (!(sums.weight > 0)) return result;
      result.noise_px = std::max(kMinNoise_px, noiseBehind(sums.squares_px2 / sums.weight, tolerance));
      // Efficiency of the weights on normal noise, and neighbours that say the same.
      const double a = result.noise_px * result.noise_px / (tolerance * tolerance);
      const double lost = std::pow(1 + 2 * a, -1.5) * std::pow(1 + a, 2.5);
      const double together = sums.togetherness(points);
      const double currency = 1 / (result.noise_px * result.noise_px * lost * together);
      Matrix6d H = currency * sums.H;
      Vector6d g = -currency * sums.g;
      Matrix6d H_prior = Matrix6d::Zero();
      Vector6d g_prior = Vector6d::Zero();
      belief.add(result.T_camera_centered, H_prior, g_prior);
      H += H_prior;
      g -= g_prior;
      result.information = H;
      result.currency = currency;
      tolerance_px_ = tolerance;
      const Twist dx = solveSymmetric(H, g);
      if (!dx.allFinite()) return result;
      result.T_camera_centered = result.T_camera_centered * expSE3(dx);
      result.last_step_px = pixels_per_metre * (dx.head<3>().norm() + model_.radius_m * dx.tail<3>().norm());
      ++result.steps;
      if (result.last_step_px < plan.rest * result.noise_px) break;
    }
    const bool settled = gate <= 1.1 * std::max(kMinLineGate_px, kLineGateOverNoise * result.noise_px);
    if (round >= kFirstRounds && settled && result.last_step_px < plan.rest * result.noise_px) break;
    gate = std::clamp(kLineGateOverNoise * result.noise_px, kMinLineGate_px, gate);
    tolerance = std::clamp(kLineToleranceOverNoise * result.noise_px, kMinTolerance_px, tolerance);
  }
  result.T_camera_centered.linear() = nearestRotation(result.T_camera_centered.linear());
  return result;
}

std::vector<ResidualGroup> LineFit::residuals(const OrientedFrame& frame, const Pose& T_camera_centered) const {
  std::vector<MatchedView> views;
  for (std::size_t v = 0; v < frame.viewCount(); ++v) {
    const XrayView& view = frame.views()[v];
    views.push_back({view.camera, view.T_view_first * T_camera_centered, *used_[v], matches_[v]});
  }
  return residualGroups(views, model_, model_.points, tolerance_px_, kCoarseGroups);
}

}  // namespace angio::registration
