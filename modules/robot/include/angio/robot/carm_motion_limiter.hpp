// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>

#include "angio/geometry/carm_limits.hpp"
#include "angio/robot/nearest_in_polytope.hpp"

namespace angio::robot {

/// Turns wanted joint velocities into commands that keep every limit: speed, acceleration and jerk of what is
/// commanded, and range and envelope of what the arm then does, in continuous time and whether or not a next command
/// comes.
///
/// The arm is one that follows a command with its acceleration, keeps it for its validity and then brakes by itself.
/// One command is made in four steps:
///
/// 1. `wanted` is shortened as a whole to the joints' speeds (withinSpeed), and each joint aims at it by the shortest
///    jerk-limited motion that does not overshoot.
/// 2. For each joint, the velocities from which it can still stop inside its range, keeping its jerk.
/// 3. Of those that also run into no face of the envelope, the nearest to the aim (nearestInPolytope, velocities in
///    units of the joints' speeds): a joint that is blocked lets the others go on, and at a slanting face they slide.
/// 4. A certificate: if this command were followed by braking, or at any step of that by silence, the arm would stay
///    inside. For one without it, the faces are taken as nearer by what is missing, and in the end it is shortened
///    towards braking until it has it; if even braking has none, the arm is told to stand still, which the certificate
///    of the command before allows at any time.
///
/// Joints that are outside already (moved by hand, another envelope) may move back in but not further out.
class CArmMotionLimiter {
 public:
  static constexpr int kMaxFaces = Polytope::kMaxCount - 2 * kCArmJointCount;

  /// For an arm at rest. Throws InputError when a limit is not finite or not positive, a range is empty, a face not
  /// finite, or the validity [s] not positive.
  CArmMotionLimiter(const CArmLimits& limits, double command_validity_s);

  /// Returns the velocity to command [rad/s, m/s]; zero when a number is not finite. Lets `period_s` pass: call exactly
  /// one of propose() or pass() per frame, and then commit().
  ///
  /// @param wanted    Joint velocities [rad/s, m/s].
  /// @param joints    As measured ...
  /// @param age_s     ... this long before the command takes effect (latency): the arm's motion since then is added, by
  ///                  the commands that were sent.
  /// @param period_s  Since the command before [s, > 0], which was in force for so long, and until the next one.
  CArmJoints propose(const CArmJoints& wanted, const CArmJoints& joints, double age_s, double period_s);

  /// Lets time pass for a frame that holds; zero or less: no time.
  void pass(double period_s);

  /// The velocity that was sent for this frame: the proposed one, or zero, after which the arm brakes as hard as it
  /// can, its jerk aside.
  void commit(const CArmJoints& sent) { command_ = sent; }

  /// propose() and commit() in one, for a caller that sends what it is given.
  CArmJoints limit(const CArmJoints& wanted, const CArmJoints& joints, double age_s, double period_s);

  /// pass() and commit() of a command to stand still.
  CArmJoints rest(double period_s);

  /// Where the arm is when the command takes effect, by joints that were measured `age_s` before.
  CArmJoints predicted(const CArmJoints& joints, double age_s) const;

 private:
  using FaceVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxFaces, 1>;  // One number a face.
  struct Piece {
    double duration_s;
    CArmJoints start, commanded;  // Velocities.
  };
  void advance(double period_s);
  void remember(double duration_s, const CArmJoints& commanded);
  bool stopsInside(int joint, double position, double velocity, double lower, double upper, double dt_s) const;
  void keepToRange(const CArmJoints& joints, const CArmJoints& braking, double dt_s, CArmJoints& low,
                   CArmJoints& high) const;
  CArmJoints slid(const CArmJoints& joints, const CArmJoints& aim, const CArmJoints& low, const CArmJoints& high,
                  const CArmJoints& braking, const FaceVector& eased) const;
  FaceVector missingModule(const CArmJoints& joints, const CArmJoints& command, double dt_s) const;

  CArmLimits limits_;
  double command_validity_s_;
  CArmJoints velocity_ = CArmJoints::Zero();      // Of the arm, now, as modelled.
  CArmJoints acceleration_ = CArmJoints::Zero();  // Its mean over the last period.
  CArmJoints command_ = CArmJoints::Zero();       // The last one that was sent.
  std::deque<Piece> past_;                        // Newest last.
};

}  // namespace angio::robot
