// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/motion/motion_predictor_settings.hpp"
#include "angio/perception/target_need.hpp"
#include "angio/servo/path_plan_settings.hpp"

namespace angio::servo {

/// What is kept: a point of the tree, or the tip of a catheter, wherever that goes.
enum class CenterOn { kTarget, kCatheterTip };

/// Keep the target at a pixel by the table alone, while the patient breathes, the heart beats and both drift.
///
/// The depth along the beam is not followed. A table of 0.2 m/s^2 can follow breathing: Lujan's sin^4 of 15 mm in 4 s
/// has a largest speed of 15 mm/s and a largest acceleration of 37 mm/s^2, half as much again in a deep breath. It can
/// not follow a heartbeat of some millimetres, whose systole alone asks for 200 mm/s^2 a millimetre: commands are
/// planned so that the table goes through the middle of it.
struct CenterTaskSettings {
  static constexpr const char* kName = "centre";
  static constexpr bool kPatientMoves = true;  ///< Frames are looked for where the motion is predicted to be.
  static constexpr TargetNeed kTargetNeed = TargetNeed::kAcrossBeam;  ///< The image's middle has no depth.

  CenterOn on = CenterOn::kTarget;
  bool predict = true;           ///< Not: the target is taken to stay where it was seen last.
  double offset_px[2] = {0, 0};  ///< The wanted pixel, from the principal point: right, down.
  PathPlanSettings plan;
  double reached_mm = 1;  ///< At the target: the target is centred when its image is as near as this.
  double max_std_mm = 8;  ///< Of the predicted place across the beam: beyond it the task holds.

  /// How far around the target the image is looked at for how the place itself lies, where a tree that bends is
  /// registered as a rigid one; 0: not at all. And how far off it may lie, as a standard deviation.
  static constexpr double near_mm = 15;
  static constexpr double near_std_mm = 2;

  /// Of the registered depth, besides what the registration says itself: a breath or a heartbeat that stretches the
  /// tree by 3 % across the beam is taken for 20 mm along it, at 0.75 m.
  static constexpr double depth_std_mm = 20;

  MotionPredictorSettings motion;

  void visit(SettingsVisitor& v) {
    v.choice("on", on, {"target", "catheter_tip"});
    v.flag("predict", predict);
    v.numbers("offset_px", offset_px, 2, -1e4, 1e4);
    plan.visit(v);
    v.number("reached_mm", reached_mm, 1e-3, 100);
    v.number("max_std_mm", max_std_mm, 1e-3, 1000);
    v.section("motion", [this](SettingsVisitor& fields) { motion.visit(fields); });
  }
};

}  // namespace angio::servo
