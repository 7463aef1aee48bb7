// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <deque>
#include <limits>
#include <map>
#include <optional>
#include <string>

#include "angio/experiments/namespace.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/simulation/catheter_settings.hpp"
#include "angio/types/any_message.hpp"

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

/// Watches a machine's true motion for what it must never do: leave an axis' range or the envelope, exceed its speed or
/// its acceleration. Judges by the states alone, not by the code that is to keep the limits.
class LimitObserver {
 public:
  explicit LimitObserver(const AxesLimits& limits) : limits_(limits) {}

  /// The machine's next state, in the order of time.
  void see(const AxesState& state);

  /// What was exceeded first, by which axis and how far; nothing while all was kept.
  const std::optional<std::string>& breach() const { return breach_; }

 private:
  AxesLimits limits_;
  std::optional<AxesState> last_;
  std::optional<std::string> breach_;
};

/// Watches what a machine truly does beside what is on the wire, for motion that nothing sound explains, and what its
/// loop tells it. Knows which frames were true; asks nothing of the code that is to keep the machine safe.
///
/// An axis may gain speed, or keep it, only while a command is in force that asks for that much in that direction, was
/// made from a true frame, and came no later than `max_age_s` after its exposure. Otherwise it has to brake. A loop
/// may send motion only for a true frame no older than `max_frame_age_s`, and only finite speeds within their limits.
class CommandObserver {
 public:
  CommandObserver(const AxesLimits& limits, double max_age_s, double max_frame_age_s)
      : limits_(limits), max_age_s_(max_age_s), max_frame_age_s_(max_frame_age_s) {}

  /// A frame was exposed [us, the lab's clock]; `spoilt` says how what was sent of it is not the truth.
  void exposed(std::int64_t frame_sequence, std::int64_t now_us, const std::optional<std::string>& spoilt);

  /// The loop has sent a command.
  void sent(const AxesCommand& command, std::int64_t now_us);

  /// A command has reached the machine.
  void arrived(const AxesCommand& command, std::int64_t now_us);

  /// The machine's true state, in the order of time.
  void see(const AxesState& state);

  /// The first motion that nothing explains, or that was commanded by what does not allow it; nothing while there was
  /// none.
  const std::optional<std::string>& breach() const { return breach_; }

  /// Commands for motion that arrived and were too old, or made from frames that were not true.
  int unsound() const { return unsound_; }

 private:
  struct Seen {
    std::int64_t time_us;
    std::optional<std::string> spoilt;
  };
  struct Order {
    AxesCommand command;
    std::int64_t arrived_us, until_us;
    std::optional<std::string> wrong;
  };

  std::optional<std::string> wrongWith(const AxesCommand& command, std::int64_t now_us, double max_age_s) const;
  bool explained(Eigen::Index axis, double speed, double sign, std::int64_t from_us, std::int64_t to_us) const;
  std::string suspect(Eigen::Index axis, double sign) const;

  AxesLimits limits_;
  double max_age_s_, max_frame_age_s_;
  std::map<std::int64_t, Seen> frames_;
  std::deque<Order> orders_;
  std::optional<AxesState> last_;
  std::optional<std::string> breach_;
  int unsound_ = 0;
};

/// Watches how far a machine's true motion leaves what its start and its goal span.
class TrajectoryObserver {
 public:
  /// @param goal            True joints at the goal.
  /// @param target_patient  The point that matters, in the true patient frame [m].
  TrajectoryObserver(const CArmGeometry& truth, const CArmJoints& start, const CArmJoints& goal,
                     const Eigen::Vector3d& target_patient);

  /// The machine's next state.
  void see(const CArmJoints& joints);

  /// The table's distance from the box of start and goal [m], at the last state and the largest so far.
  double table_m() const { return table_m_; }
  double maxTable_m() const { return max_table_m_; }

  /// By how much the target is further from its goal in the camera than at the start [m]: at the last state, negative
  /// when it is nearer, and the largest so far, at least zero.
  double target_m() const { return target_m_; }
  double maxTarget_m() const { return max_target_m_; }

 private:
  double distance_m(const CArmJoints& joints) const;

  CArmGeometry truth_;
  Eigen::Vector3d target_, wanted_;
  Eigen::AlignedBox3d box_;
  double start_m_, table_m_ = 0, target_m_ = 0, max_table_m_ = 0, max_target_m_ = 0;
};

}  // namespace angio::experiments
