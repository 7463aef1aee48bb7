// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "angio/base/settings.hpp"
#include "angio/geometry/carm_limits.hpp"
#include "angio/simulation/namespace.hpp"
#include "angio/types/carm_motion.hpp"
#include "angio/types/command_gate.hpp"

namespace angio::simulation {

/// How many commands a simulated machine did not obey, by the reason; each is counted once, by the first that applies.
struct IgnoredCommands {
  std::int64_t not_finite = 0;       ///< A velocity was NaN or infinite.
  std::int64_t bad_validity = 0;     ///< valid_for_us was not in (0, 1 s].
  std::int64_t out_of_sequence = 0;  ///< Neither a higher sequence than the last one obeyed, nor a later time.
  std::int64_t jumped = 0;           ///< Too far ahead of the last one obeyed (CommandGate).
  std::int64_t other_sender = 0;     ///< From another sender than the one that is obeyed (CommandGate).
  std::int64_t too_old = 0;          ///< The frame behind it was too long ago, or still to come.
  std::int64_t wrong_unit = 0;       ///< So far beyond a speed limit that its numbers mean something else.

  std::int64_t total() const {
    return not_finite + bad_validity + out_of_sequence + jumped + other_sender + too_old + wrong_unit;
  }
};

/// What a receiver asks of a command before it moves by it: the last gate, for it alone sees what arrives and when.
struct ReceiverSettings {
  double max_command_age_ms = 300;
  double max_command_lead_ms = 100;
  double max_overspeed = 10;  ///< Times a speed limit: less is cut to the limit, more is in wrong units.

  void visit(SettingsVisitor& v) {
    v.number("max_command_age_ms", max_command_age_ms, 1, 60e3,
             "Largest time since the frame behind a command, by the machine's clock, which is the frames'");
    v.number("max_command_lead_ms", max_command_lead_ms, 0, 60e3,
             "How far a command's frame may be ahead of the machine's clock");
    v.fixed("max_overspeed", max_overspeed, 1, 1000);
  }
};

/// Which commands a simulated machine obeys: those that CommandGate lets pass, finite, valid for up to 1 s, of now, and
/// in the right units. One that stands still is always obeyed.
class CommandReceiver {
 public:
  /// Throws InputError when a setting is out of its range.
  explicit CommandReceiver(const ReceiverSettings& settings);

  static constexpr std::int64_t kMaxValidity_us = 1'000'000;

  /// Whether a command that arrives at `now_us` [us] is obeyed; counts why not.
  ///
  /// @param speeds  Of each axis, by its limit.
  /// @param sender  As the bus names it; empty: unknown.
  template <typename Command>
  bool takes(const Command& command, const Eigen::Ref<const Eigen::VectorXd>& speeds, std::int64_t now_us,
             const std::string& sender) {
    return takes(command.time_us, command.sequence, command.valid_for_us, speeds, now_us, sender);
  }

  /// A session was announced: its commands are obeyed from now on.
  void begin(const ServoSession& session, std::int64_t now_us, const std::string& sender = {}) {
    gate_.begin(session, sender, now_us);
  }

  /// One line on the first command that was too far ahead, and on the first one of another sender; each once.
  std::optional<std::string> takeNews();

  const IgnoredCommands& ignored() const { return ignored_; }

 private:
  bool takes(std::int64_t time_us, std::int64_t sequence, std::int64_t valid_for_us,
             const Eigen::Ref<const Eigen::VectorXd>& speeds, std::int64_t now_us, const std::string& sender);
  void count(CommandGate::Refusal refusal, std::int64_t sequence, const std::string& sender, std::int64_t now_us);

  ReceiverSettings settings_;
  IgnoredCommands ignored_;
  CommandGate gate_;
  std::deque<std::string> news_;
};

/// A C-arm whose joints follow commanded velocities within their range, speed and acceleration, and come to rest by
/// themselves when the last command has run out: silence means stop.
///
/// Motion between two times is exact (pieces of constant acceleration), so it does not depend on how often `advance` is
/// called. Each joint brakes in front of the end of its range, and stops there without passing it.
class SimulatedCArm : public CommandReceiver {
 public:
  /// At rest at `start` at the time `now_us` [us]. Throws InputError when a limit is not finite, a speed or
  /// acceleration not positive, a range empty, or `start` outside the range.
  SimulatedCArm(const CArmLimits& limits, const CArmJoints& start, std::int64_t now_us,
                const ReceiverSettings& receiver = {});

  /// Takes a command that arrives at `now_us` [us] and holds for its validity from then on; speeds beyond the limits
  /// are cut to them. What CommandReceiver does not take is ignored, and the command before it stays in force until it
  /// runs out. An arrival before the present time counts as now.
  ///
  /// @param sender  As the bus names it; empty: unknown.
  void obey(const CArmCommand& command, std::int64_t now_us, const std::string& sender = {});

  /// Moves to the time `now_us` [us]; an earlier time than the present is ignored.
  void advance(std::int64_t now_us);

  /// Joints and velocities at the present time. The sequence number is the sender's to fill in.
  CArmState state() const;

  /// How often the last command ran out before another came: the watchdog's stops.
  std::int64_t ranOut() const { return ran_out_; }

 private:
  void move(double duration_s, const CArmJoints& wanted_velocity);

  CArmLimits limits_;
  CArmState state_;
  CArmJoints wanted_ = CArmJoints::Zero();
  std::uint64_t valid_left_us_ = 0;
  bool in_force_ = false;  // Whether a command has not run out yet.
  std::int64_t ran_out_ = 0;
};

}  // namespace angio::simulation
