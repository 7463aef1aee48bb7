// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/machine_check/machine_check.hpp"
#include "image_check.hpp"
#include "observed_machine.hpp"

namespace angio::machine_check {

/// What is done, one after the other.
struct Step {
  enum class Kind { kWatch, kLook, kMove, kRest, kSilence, kStop, kNan, kEnd } kind = Kind::kEnd;
  int joint = -1;
  int sign = 1;
};

/// How long a command is good for: what a loop usually sends.
constexpr std::int64_t kUsualValid_us = 200'000;

/// From a command to motion: what the loop's own settings can make up for.
constexpr double kMaxLatency_s = 0.3;

struct MachineCheck::Parts {
  Parts(const MachineCheckSettings& s, const VesselTree& t);

  double goal(int joint) const { return isAngle(joint) ? degToRad(settings.angle_deg) : 1e-3 * settings.table_mm; }
  double speed(int joint) const {
    const double asked =
        isAngle(joint) ? degToRad(settings.angle_speed_deg_per_s) : 1e-3 * settings.table_speed_mm_per_s;
    return std::min(asked, settings.limits.velocity[joint]);
  }
  const Step& step() const { return plan[at]; }
  double since_s(std::int64_t now_us) const { return 1e-6 * static_cast<double>(now_us - *began_us); }
  void next(std::int64_t now_us);
  void abort(const std::string& why, std::int64_t now_us);
  bool stands() const;
  bool restSeen(const std::string& name, double still_s, double allowed_s, const std::string& asked);
  void checkEncoder(int joint);
  void watchMotion(const CArmState& state, std::int64_t now_us);
  CArmCommand commandOf(const CArmJoints& velocity, std::int64_t valid_us = kUsualValid_us);
  std::optional<CArmCommand> move(std::int64_t now_us);
  void checkStates(std::vector<CheckRow>& rows) const;
  void checkFrames(std::vector<CheckRow>& rows) const;

  MachineCheckSettings settings;
  ImageCheck image;
  std::vector<Step> plan;
  std::size_t at = 0;
  std::optional<std::int64_t> began_us;  // Of the step.

  ObservedChannel states, frames;
  ObservedStates history;
  std::optional<std::string> implausible;
  std::optional<XrayFrame> newest_frame;  // Without its image.
  double oldest_frame_s = 0;
  double sum_age_s = 0;

  std::int64_t sequence = 0;
  CArmJoints start = CArmJoints::Zero();       // Of a motion.
  std::int64_t commanded_us = 0;               // When its first command was given, ours.
  bool seen_moving = false;                    // Since then.
  std::optional<double> latency_s;             // The largest.
  CArmJoints integrated = CArmJoints::Zero();  // Of the velocities that were reported since the step began.
  std::optional<double> velocity_share;        // Of a motion that they explain, the worst.
  std::optional<double> rest_after_s;
  std::vector<CheckRow> found;
  bool aborted = false;
};

}  // namespace angio::machine_check
