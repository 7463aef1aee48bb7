// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "angio/perception/patient_tracker.hpp"
#include "angio/registration/depth_from_motion.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::perception {

/// The last frames that were registered, so far apart in time or angle that each says something new: what
/// depthFromMotion() is asked of. The same frames give the same answers.
class DepthWindow {
 public:
  /// Takes a frame's registration; one without evidence is left out. A frame that is little later than the last but
  /// one, from nearly there, takes the last one's place: the newest frame is always the last.
  ///
  /// @param view        What the frame shows.
  /// @param calibrated  The pose in it before any image.
  void add(const RegistrationResult& registration, const XrayView& view, const PosePrior& calibrated,
           const CameraPlace& place);

  bool empty() const { return frames_.empty(); }

  /// Largest angle between the newest frame's beam and another's [rad].
  double turn_rad() const;

  /// Whether the camera stood still from the frame before to the newest one.
  bool still() const { return still_; }

  /// Returns where the tree that was registered is in the newest frame, by all of them; nothing where they do not tell.
  std::optional<DepthFromMotion> fit(const VesselTree& tree) const;

  /// Where the camera was in the newest frame. There must be one.
  const Pose& T_camera_patient() const { return frames_.back().T_camera_patient; }
  std::int64_t time_us() const { return newest_us_; }

 private:
  std::deque<MovingFrame> frames_;
  std::optional<std::int64_t> first_us_;
  std::int64_t newest_us_ = 0;
  bool still_ = false;
  // Of the newest frame.
  Centerline2d centerline_;
  std::optional<XrayCamera> camera_;
  PosePrior calibrated_;
};

}  // namespace angio::perception
