// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/motion/motion_predictor_settings.hpp"
#include "angio/perception/target_need.hpp"
#include "angio/servo/path_plan_settings.hpp"

namespace angio::servo {

/// Keep the view as it was when the task began: angles and table go along with the patient.
struct HoldTaskSettings {
  static constexpr const char* kName = "hold";
  static constexpr bool kPatientMoves = true;  ///< Frames are looked for where the motion is predicted to be.
  static constexpr TargetNeed kTargetNeed = TargetNeed::kEverywhere;

  bool predict = true;       ///< Not: the patient is taken to stay as seen last.
  double reached_deg = 0.2;  ///< The view is kept while the beam is as near as this ...
  double reached_mm = 1;     ///< ... and the target.
  double max_std_mm = 8;     ///< Of the target's predicted place, its worst direction: beyond it the task holds.
  double max_std_deg = 3;    ///< Of the predicted rotation.
  PathPlanSettings plan;
  MotionPredictorSettings motion;

  void visit(SettingsVisitor& v) {
    v.flag("predict", predict);
    v.number("reached_deg", reached_deg, 1e-4, 10);
    v.number("reached_mm", reached_mm, 1e-3, 100);
    v.number("max_std_mm", max_std_mm, 1e-3, 1000);
    v.number("max_std_deg", max_std_deg, 1e-3, 90);
    plan.visit(v);
    v.section("motion", [this](SettingsVisitor& fields) { motion.visit(fields); });
  }
};

}  // namespace angio::servo
