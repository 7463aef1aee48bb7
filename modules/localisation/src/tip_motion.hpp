// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/localisation/catheter_localiser.hpp"
#include "place_grid.hpp"

namespace angio::localisation {

/// A place and how probable it is.
struct Reach {
  int place = 0;
  double probability = 0;
};

/// How far a tip gets from one frame to the next.
class TipMotion {
 public:
  /// A `motion` whose numbers are not finite, or whose period is not positive, is taken as one of the longest doubt: a
  /// second without news.
  TipMotion(const LocaliserSettings& settings, const PlaceGrid& grid, const CatheterMotion& motion);

  /// Where a tip may be that was at `from`; adds up to 1. Ahead, each branch of a bifurcation is as likely as the
  /// others. Borrowed until the next call.
  const std::vector<Reach>& from(int from);

 private:
  void descend(int place, double back_m, double ahead_m, double share, int except);
  void add(int place, double back_m, double ahead_m, double share);

  const PlaceGrid& grid_;
  double mean_m_ = 0, std_m_ = 0, lowest_m_ = 0, highest_m_ = 0;
  std::vector<Reach> reached_;
};

}  // namespace angio::localisation
