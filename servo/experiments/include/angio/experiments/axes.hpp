// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <limits>

#include "angio/experiments/namespace.hpp"
#include "angio/geometry/carm_limits.hpp"
#include "angio/messaging/messages.hpp"
#include "angio/simulation/catheter_settings.hpp"

namespace angio::experiments {

/// A number for each axis of a machine: the C-arm's joints, or a drive's insertion, roll and bend [rad, m].
using Axes = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kCArmJointCount, 1>;

/// Where a machine's axes are, and how fast [rad, m, /s].
struct AxesState {
  AxesState(const CArmState& s) : time_us(s.time_us), place(s.joints), velocity(s.velocity) {}
  AxesState(const CatheterState& s)
      : time_us(s.time_us),
        place(Eigen::Vector3d(s.insertion_m, s.roll_rad, s.bend_rad)),
        velocity(Eigen::Vector3d(s.insertion_speed_m_per_s, s.roll_speed_rad_per_s, s.bend_speed_rad_per_s)) {}

  std::int64_t time_us;
  Axes place, velocity;
};

/// A command for them.
struct AxesCommand {
  AxesCommand(const CArmCommand& c)
      : frame_sequence(c.frame_sequence), valid_for_us(c.valid_for_us), velocity(c.velocity) {}
  AxesCommand(const CatheterCommand& c)
      : frame_sequence(c.frame_sequence),
        valid_for_us(c.valid_for_us),
        velocity(Eigen::Vector3d(c.insertion_speed_m_per_s, c.roll_speed_rad_per_s, c.bend_speed_rad_per_s)) {}

  std::int64_t frame_sequence, valid_for_us;
  Axes velocity;
};

/// Their range, speed and acceleration, and a C-arm's envelope.
struct AxesLimits {
  AxesLimits(const CArmLimits& l)
      : lower(l.lower), upper(l.upper), velocity(l.velocity), acceleration(l.acceleration), envelope(l.envelope) {}

  /// Roll has no end, and a simulated drive is as fast as it is told at once.
  AxesLimits(const CatheterSettings& c)
      : lower(Eigen::Vector3d(0, -kNoEnd, 0)),
        upper(Eigen::Vector3d(1e-3 * c.length_mm, kNoEnd, degToRad(c.max_bend_deg))),
        velocity(Eigen::Vector3d(1e-3 * c.max_insertion_speed_mm_per_s, degToRad(c.max_roll_speed_deg_per_s),
                                 degToRad(c.max_bend_speed_deg_per_s))),
        acceleration(Eigen::Vector3d::Constant(kNoEnd)) {}

  static constexpr double kNoEnd = std::numeric_limits<double>::infinity();
  Axes lower, upper, velocity, acceleration;
  CArmEnvelope envelope;
};

}  // namespace angio::experiments
