// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/depth_window.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace angio::perception {
namespace {

// Two breaths.
constexpr double kMemory_s = 8;
// Frames nearer to each other than both say the same.
constexpr double kNear_s = 0.24, kNear_rad = 0.005, kStill_rad = 0.5e-3;

double turnBetween(const MovingFrame& a, const MovingFrame& b) {
  const Eigen::Vector3d across =
      a.T_camera_patient.linear().row(2).cross(b.T_camera_patient.linear().row(2)).transpose();
  return std::asin(std::min(1.0, across.norm()));
}

}  // namespace

void DepthWindow::add(const RegistrationResult& registration, const XrayView& view, const PosePrior& calibrated,
                      const CameraPlace& place) {
  if (!registration.evidence) return;
  if (!first_us_) first_us_ = place.time_us;
  const double time_s = 1e-6 * (static_cast<double>(place.time_us) - static_cast<double>(*first_us_));
  if (!frames_.empty() && !(time_s > frames_.back().time_s)) frames_.clear();  // Another clock.
  const MovingFrame frame{registration.evidence, place.T_camera_patient, time_s};
  still_ = !frames_.empty() && turnBetween(frames_.back(), frame) < kStill_rad;
  if (frames_.size() > 1) {
    const MovingFrame& before = frames_[frames_.size() - 2];
    if (frames_.back().time_s - before.time_s < kNear_s && turnBetween(frames_.back(), before) < kNear_rad) {
      frames_.pop_back();
    }
  }
  frames_.push_back(frame);
  while (frames_.size() > kMaxTurnFrames || frames_.front().time_s < time_s - kMemory_s) frames_.pop_front();
  newest_us_ = place.time_us;
  centerline_ = view.centerline;
  camera_.emplace(view.camera);
  calibrated_ = calibrated;
}

double DepthWindow::turn_rad() const {
  double turn_rad = 0;
  for (const MovingFrame& frame : frames_) turn_rad = std::max(turn_rad, turnBetween(frame, frames_.back()));
  return turn_rad;
}

std::optional<DepthFromMotion> DepthWindow::fit(const VesselTree& tree) const {
  if (empty()) return std::nullopt;
  return depthFromMotion(std::vector<MovingFrame>(frames_.begin(), frames_.end()), XrayView{centerline_, *camera_},
                         calibrated_, tree);
}

}  // namespace angio::perception
