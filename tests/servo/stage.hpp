// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/servo/operator.hpp"
#include "angio/servo/servo_node.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "frame_period.hpp"

namespace angio::test {

/// A patient, an arm with a detector small enough for quick tests, and a loop that knows how the patient lies but for
/// 1 deg and 2 mm.
class Stage {
 public:
  VesselTree tree = branchingTree(6);
  ServoLoopSettings settings = [this] {
    ServoLoopSettings s;
    s.carm.pixel_spacing_m = 0.5e-3;
    s.carm.image_width_px = s.carm.image_height_px = 448;
    s.T_dsa_cb.linear() = expSO3(Eigen::Vector3d(0, degToRad(0.6), degToRad(0.8)));
    s.T_dsa_cb.translation() = tree.centroid() + Eigen::Vector3d(2e-3, 0, 0) - s.T_dsa_cb.linear() * tree.centroid();
    ViewTaskSettings view;
    view.primary_deg = 20;
    view.secondary_deg = 10;
    s.task = view;
    s.perception.search_starts.count = 3;  // The calibration is near enough.
    return s;
  }();
  CArmJoints joints = settings.carm.jointsFor({0, 0}, tree.centroid());

  /// The X-ray of `patient` from where `joints` are.
  XrayFrame frameOf(const VesselTree& patient, std::int64_t sequence, const FluoroscopySettings& look = {}) const {
    XrayFrame frame{sequence * kPeriod_us, sequence, {}, settings.carm.camera()};
    FluoroscopyRenderer renderer(withPlausibleRadii(patient, look.end_radius_mm * 1e-3), look);
    frame.image =
        renderer.render(frame.camera, settings.carm.T_camera_patient(joints), static_cast<std::uint64_t>(sequence));
    return frame;
  }
  XrayFrame frame(std::int64_t sequence) const { return frameOf(tree, sequence); }

  CArmState state(std::int64_t sequence) const { return {sequence * kPeriod_us, sequence, joints, CArmJoints::Zero()}; }
};

/// The same loop's settings, which move with the first frame that is trusted.
inline ServoLoopSettings moving(ServoLoopSettings settings) {
  settings.safety.states.frames_to_start = 1;
  return settings;
}

/// Arms and starts a node before its first frame.
inline void start(Bus& bus, ServoNode& node) {
  Operator person(bus);
  std::int64_t now_us = 0;
  for (const auto request : {ServoRequestKind::kArm, ServoRequestKind::kStart}) {
    person.ask(request, ++now_us);
    while (bus.handle(std::chrono::milliseconds(0)) > 0) continue;
    node.answer(now_us);  // Says its new state, which the next request has to have seen.
    while (bus.handle(std::chrono::milliseconds(0)) > 0) continue;
  }
}

}  // namespace angio::test
