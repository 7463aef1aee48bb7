// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "angio/navigation/namespace.hpp"

namespace angio::navigation {

/// Chooses the turn of a tip that is tried again and again at one fork, by where its earlier turns led.
///
/// A branch takes a tip at turns that lie side by side. Between two turns that led into different branches lies the
/// edge of one of them, and at times another branch: such gaps are halved before wider ones between turns that led
/// to the same.
class TurnSearch {
 public:
  /// Pushed on with its drive at `roll_rad` (any number of turns) and bent by `bend_rad`, the tip first went into the
  /// branch `entered`, or into none.
  void add(double roll_rad, double bend_rad, std::optional<int> entered);

  /// The roll of the drive to try next with this bend [rad], in [0, 2 pi): the middle of a gap between the turns that
  /// were tried with that bend. Half a turn from the only one; nothing where there is none.
  std::optional<double> next(double bend_rad) const;

 private:
  struct Turn {
    double roll_rad;  // In [0, 2 pi).
    double bend_rad;
    std::optional<int> entered;
  };
  std::vector<Turn> turns_;  // By their roll.
};

}  // namespace angio::navigation
