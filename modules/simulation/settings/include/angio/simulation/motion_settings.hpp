// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>

#include "angio/base/settings.hpp"
#include "angio/geometry/measured_motion.hpp"
#include "angio/simulation_settings/namespace.hpp"

namespace angio::simulation_settings {

/// Breathing as the organs under the diaphragm follow it. Zero at the end of breathing out.
///
/// Source of the course in time, sin^(2n): Lujan et al., A method for incorporating organ motion due to breathing into
/// 3D dose calculations, Med Phys 26 (1999). Organs' amplitudes are listed by Keall et al., The management of
/// respiratory motion in radiation oncology (AAPM TG 76), Med Phys 33 (2006).
struct BreathingSettings {
  double amplitude_mm = 0;
  double forward_mm = 3;  ///< How far the diaphragm comes forward, for each 10 mm down.
  double period_s = 4;
  double sharpness = 2;     ///< Lujan's n: the higher, the longer the pause after breathing out.
  double hysteresis = 0.1;  ///< Forward motion lags by this part of the period: the way out is not the way back.
  double variation = 0.15;
  double drift_mm_per_min = 0;
  double diaphragm_mm = 70;
  double reach_mm = 110;  ///< Motion falls off from the diaphragm to the feet as a normal curve of this width.

  void visit(SettingsVisitor& v) {
    v.number("amplitude_mm", amplitude_mm, 0, 60, "How far the diaphragm comes down, towards the feet");
    v.number("period_s", period_s, 0.5, 30, "Duration of a breath");
    v.number("variation", variation, 0, 0.5, "Standard deviation of a breath's amplitude, relative");
    v.number("drift_mm_per_min", drift_mm_per_min, -30, 30, "Drift of the resting position, towards the feet");
    v.number("diaphragm_mm", diaphragm_mm, -300, 300, "How far the diaphragm is above the tree's centroid");
    v.fixed("forward_mm", forward_mm, -10, 10);
    v.fixed("sharpness", sharpness, 1, 10);
    v.fixed("hysteresis", hysteresis, 0, 0.5);
    v.fixed("reach_mm", reach_mm, 20, 1000);
  }
};

/// Heartbeat: what lies around the heart is drawn to it and turned about its axis in systole.
struct HeartbeatSettings {
  double amplitude_mm = 0;
  double rate_per_min = 70;
  double turn_deg = 6;
  double center_mm[3] = {0, 0, 0};
  double reach_mm = 50;  ///< Motion fades like a normal curve of this width.

  void visit(SettingsVisitor& v) {
    v.number("amplitude_mm", amplitude_mm, 0, 20, "Motion of the point that the heartbeat moves farthest");
    v.number("rate_per_min", rate_per_min, 20, 220, "Beats a minute");
    v.number("turn_deg", turn_deg, -30, 30, "Turn at the heart's centre, for each 10 mm of amplitude");
    v.numbers("centre_mm", center_mm, 3, -300, 300,
              "Centre of the heart, from the tree's centroid: left, posterior, up");
    v.fixed("reach_mm", reach_mm, 10, 300);
  }
};

/// The whole patient on the table.
struct ShiftSettings {
  double drift_mm_per_min[3] = {0, 0, 0};
  double sudden_mm[3] = {0, 0, 0};
  double sudden_turn_deg = 0;
  double sudden_at_s = 5;

  void visit(SettingsVisitor& v) {
    v.numbers("drift_mm_per_min", drift_mm_per_min, 3, -100, 100, "Drift of the patient: left, posterior, up");
    v.numbers("sudden_mm", sudden_mm, 3, -100, 100, "Sudden shift of the patient: left, posterior, up");
    v.number("sudden_turn_deg", sudden_turn_deg, -30, 30, "Sudden turn of the patient about the long axis");
    v.number("sudden_at_s", sudden_at_s, 0, 86400, "When the sudden shift and turn happen");
  }
};

/// How the patient's vessels differ from the tree at all times, as they do when the tree is of another day, position or
/// breath: four plane waves of displacement, or a measured motion that is carried over to the tree.
struct TreeDeformationSettings {
  double rms_mm = 0;
  std::shared_ptr<const MeasuredMotion> measured;  ///< No key: a program reads it from a file. Null: waves.
  static constexpr double wavelength_mm = 200;     ///< Of the shortest wave; of the longest twice as much.

  void visit(SettingsVisitor& v) {
    v.number("rms_mm", rms_mm, 0, 30, "Root mean square of the displacements' lengths");
  }
};

/// All motions of a simulated patient.
struct MotionSettings {
  BreathingSettings breathing;
  HeartbeatSettings heartbeat;
  ShiftSettings shift;
  TreeDeformationSettings deformation;

  void visit(SettingsVisitor& v) {
    v.section("breathing", [this](SettingsVisitor& s) { breathing.visit(s); });
    v.section("heartbeat", [this](SettingsVisitor& s) { heartbeat.visit(s); });
    v.section("shift", [this](SettingsVisitor& s) { shift.visit(s); });
    v.section("bend", [this](SettingsVisitor& s) { deformation.visit(s); });
  }
};

}  // namespace angio::simulation_settings
