// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/motion/namespace.hpp"

namespace angio::motion {

/// How far ahead of the last measurement a motion is believed to be known, and what it is taken to be made of.
///
/// The defaults are those of an organ under the diaphragm: breaths of 15 mm in 4 s that differ by 15 % from each other,
/// a heartbeat of a few millimetres, a slow drift, seen 15 times a second to some tenths of a millimetre.
struct MotionPredictorSettings {
  double breathing_low_hz = 0.1, breathing_high_hz = 0.6;
  double heart_low_hz = 0.7, heart_high_hz = 3;
  static constexpr int breathing_harmonics = 3;  ///< Lujan's sin^4 has two.
  static constexpr int heart_harmonics =
      5;  ///< As many of them as half the frame rate allows; 0: no heart is looked for.
  static constexpr double breaths_to_learn = 2;  ///< Before as many have been seen, nothing is taken for periodic.
  double memory_s = 20;
  static constexpr double amplitude_memory_s = 25;  ///< Over this time a harmonic's amplitude and phase are forgotten.
  static constexpr double drift_std_mm_per_s =
      0.5;  ///< Of the resting position: its speed; it changes over `amplitude_memory_s`.
  static constexpr double offset_walk_mm =
      0.5;  ///< Of the resting position, per square root of a second: breaths that differ.

  /// Of a motion without a period, per axis. A breath of 20 mm in 3 s accelerates by up to 44 mm/s^2.
  static constexpr double acceleration_std_mm_per_s2 = 40;
  static constexpr double acceleration_mean_s =
      1.0 / 15;                                    ///< Density of the white acceleration: its variance times this.
  static constexpr double measured_std_mm = 0.05;  ///< Added to what a measurement says of itself, per axis.
  static constexpr double gate = 21.1;    ///< Squared Mahalanobis distance of a surprise: 99.99 % of three numbers.
  static constexpr double max_gap_s = 3;  ///< Without a measurement for longer, everything is forgotten.
  double max_horizon_ms = 700;            ///< Nothing is predicted further ahead.
  static constexpr double scoring_horizon_ms = 130;  ///< The horizon at which the models are compared.
  static constexpr double scoring_memory_s = 3;      ///< Time constant of that comparison.

  void visit(SettingsVisitor& v) {
    v.number("breathing_low_hz", breathing_low_hz, 0.02, 10, "Lowest frequency at which breathing is looked for");
    v.number("breathing_high_hz", breathing_high_hz, 0.02, 10, "Highest frequency at which breathing is looked for");
    v.number("heart_low_hz", heart_low_hz, 0.1, 20, "Lowest frequency at which the heartbeat is looked for");
    v.number("heart_high_hz", heart_high_hz, 0.1, 20, "Highest frequency at which the heartbeat is looked for");
    v.number("memory_s", memory_s, 2, 120, "Length of the past that frequencies are looked for in");
    v.fixed("max_horizon_ms", max_horizon_ms, 1, 5000);
  }
};

}  // namespace angio::motion
