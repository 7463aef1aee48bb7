// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "angio/machine_check/machine_check.hpp"

namespace angio::machine_check {

/// What a channel's messages say of their rate, order and clock.
class ObservedChannel {
 public:
  void see(std::int64_t time_us, std::int64_t sequence, std::int64_t now_us);

  std::int64_t count() const { return count_; }
  double rate_hz() const;

  CheckRow rateRow(const std::string& name, double min_hz, double max_hz) const;
  CheckRow sequenceRow(const std::string& name) const;

  /// Whether its clock runs in microseconds, as ours does.
  CheckRow clockRow(const std::string& name) const;

 private:
  std::int64_t count_ = 0, missing_ = 0, disordered_ = 0;
  std::int64_t first_time_us_ = 0, last_time_us_ = 0, last_sequence_ = 0, first_now_us_ = 0, last_now_us_ = 0;
};

/// States by their time: where the machine was at an exposure, and how it moved since some time of ours.
class ObservedStates {
 public:
  struct Entry {
    CArmState state;
    std::int64_t now_us;  ///< When it came.
  };
  void see(const CArmState& state, std::int64_t now_us);
  const std::optional<CArmState>& newest() const { return newest_; }
  CArmState at(std::int64_t time_us) const;
  const std::deque<Entry>& entries() const { return entries_; }

 private:
  std::optional<CArmState> newest_;
  std::deque<Entry> entries_;  // Oldest first, of the last seconds.
};

/// How a joint's motion looks against what was expected: `share` 1 is as expected, -1 the other way round.
struct MotionShare {
  double share = 0;
  double rest = 0;  ///< Of the motion that goes another way, as a share of the expected one.
};

/// Of displacements, 2 x N [px], by least squares.
MotionShare shareOf(const Eigen::Matrix2Xd& seen, const Eigen::Matrix2Xd& expected);

/// Whether a motion is as long as was expected, with what noise and a latency may take from it: 0.75 to 1.3 times.
bool asExpected(double share);

/// Whether a joint is an angle, and its value for people: "2.00 deg", "9.80 mm".
inline bool isAngle(int joint) { return joint < 2; }
std::string inUnits(int joint, double value);

CheckRow verdictRow(const std::string& name, bool good, std::string measured, std::string asked);

/// "as expected", "the other way round", "57 times as far: ...", for people.
std::string wordsOf(const MotionShare& share);

}  // namespace angio::machine_check
