// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/device_score.hpp"

#include <nlohmann/json.hpp>

#include "nearest_on_curve.hpp"

namespace angio::evaluation {

void DeviceScore::add(const Centerline2d& found, const Centerline2d& shown, double tolerance_px) {
  const Centerline2d devices = densified(ofKind(shown, CurveKind::kDevice), kScoreStep_px);
  if (devices.size() * kScoreStep_px < kMinShown_px) return;
  const NearestOnCurve as_device(ofKind(found, CurveKind::kDevice)), as_vessel(ofKind(found, CurveKind::kVessel));
  double told = 0;
  for (int i = 0; i < devices.size(); ++i) {
    const Eigen::Vector2d p = devices.points_px.col(i);
    const bool is_told = as_device(p).distance_px <= tolerance_px;
    told += is_told;
    taken_ += !is_told && as_vessel(p).distance_px <= tolerance_px;
  }
  ++frames_;
  named_ += 2 * told >= devices.size();
  told_ += told;
  shown_ += devices.size();

  const NearestOnCurve true_device(devices), true_vessel(ofKind(shown, CurveKind::kVessel));
  for (const CurveKind kind : {CurveKind::kVessel, CurveKind::kDevice}) {
    const Centerline2d lines = densified(ofKind(found, kind), kScoreStep_px);
    for (int i = 0; i < lines.size(); ++i) {
      const Eigen::Vector2d p = lines.points_px.col(i);
      const auto vessel = true_vessel(p);
      if (vessel.distance_px > tolerance_px) continue;
      // A device lies in a vessel, anywhere in it: what is found there is either's.
      if (true_device(p).distance_px <= tolerance_px + vessel.radius_px) continue;
      // A device in a vessel may have a line besides the vessel's.
      if (kind == CurveKind::kDevice && as_vessel(p).distance_px <= tolerance_px) continue;
      ++vessels_;
      called_ += kind == CurveKind::kDevice;
    }
  }
}

void DeviceScore::add(const DeviceScore& other) {
  frames_ += other.frames_;
  named_ += other.named_;
  shown_ += other.shown_;
  told_ += other.told_;
  taken_ += other.taken_;
  vessels_ += other.vessels_;
  called_ += other.called_;
}

Json DeviceScore::asJson() const {
  const auto share = [](double part, double whole) { return whole > 0 ? part / whole : 0; };
  return {{"frames", frames_},
          {"named", share(named_, frames_)},
          {"told", share(told_, shown_)},
          {"taken_for_vessel", share(taken_, shown_)},
          {"vessels_called_device", share(called_, vessels_)}};
}

}  // namespace angio::evaluation
