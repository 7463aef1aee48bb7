// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/machine_check/machine_check.hpp"
#include "angio/perception/perception.hpp"

namespace angio::machine_check {

/// What the X-ray shows of a machine that stands: whether the image is the right way round, and how it has moved since
/// the machine stood somewhere else.
class ImageCheck {
 public:
  static constexpr int kFrames = 3;  ///< Of a look.

  ImageCheck(const MachineCheckSettings& settings, const VesselTree& tree);

  /// Begins a look.
  void begin() { now_ = Look(); }
  bool complete() const { return now_.frames >= kFrames; }

  /// One frame of it, and the machine's state at its exposure.
  void observe(const XrayFrame& frame, const CArmState& state);

  /// The next motion begins where this look was.
  void keep() { before_ = now_; }

  /// By the present look, the kept one and the encoders between them.
  CheckRow motionRow(int joint) const;

  CheckRow orientationRow() const;

 private:
  struct Look {
    int frames = 0, converged = 0;
    std::string status = "no frame came";
    CArmJoints joints = CArmJoints::Zero();
    std::optional<XrayCamera> camera;
    Pose T_camera_model = Pose::Identity();  // Of the last converged frame.
    Eigen::Matrix2Xd points_px;              // Mean over the converged frames, all points of the tree.
  };

  std::optional<Eigen::Matrix2Xd> project(const XrayCamera& camera, const Pose& T_camera_model) const;
  void nameReading(const XrayFrame& frame, const Observation& observation, const CArmState& state);

  VesselTree tree_;
  CArmGeometry carm_;
  Perception perception_;
  Look before_, now_;
  std::optional<CheckRow> orientation_;
};

}  // namespace angio::machine_check
