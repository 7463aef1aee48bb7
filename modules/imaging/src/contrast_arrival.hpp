// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// When contrast agent arrives in a run, by what lines its frames show.
///
/// Before it arrives frames show little and the same, and none of it has branches; then each shows more than the one
/// before. A run that begins while vessels fill has no such frames, and one that begins with full vessels no arrival.
class ContrastArrival {
 public:
  enum class Frame {
    kQuiet,   ///< Without contrast agent, as far as is known: no frame has shown much less.
    kFilled,  ///< Shows more than quiet ones, or branches, or much less, once.
    kAnew,    ///< What were taken for quiet frames were none, and this one is the first.
  };

  /// Takes the next frame.
  /// @param amount  Sum of its lines' lengths by their contrasts [px]. @param branched  Whether lines end at the sides
  /// of others. @param side  The image's shorter side, in the same pixels.
  Frame add(double amount, bool branched, double side);

  /// Whether contrast agent has arrived in this run.
  bool arrived() const { return arrived_; }

 private:
  Frame beginAnew(double amount);
  Frame addUnbranched(double amount, double side);
  bool isAbrupt(double amount) const;

  double quietest_ = 0;
  double first_ = 0, last_ = 0;           // Amounts of the first and the last quiet frame,
  int first_frame_ = 0, last_frame_ = 0;  // and their numbers.
  int frame_ = -1, quiet_frames_ = 0;
  bool was_low_ = false, arrived_ = false;
};

}  // namespace angio::imaging
