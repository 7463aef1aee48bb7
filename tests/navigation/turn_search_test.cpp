// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/turn_search.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "angio/geometry/se3.hpp"

namespace angio::navigation {
namespace {

constexpr int kBefore = 8, kWanted = 3, kOn = 2;

// As the arch takes tips at its left carotid artery: the wanted branch between one that takes 70 deg of turns and one
// that takes the others.
int branchAt(double roll_rad, double window_deg, double width_deg) {
  const double deg = std::fmod(radToDeg(roll_rad) - window_deg + 720, 360);
  if (deg < width_deg) return kWanted;
  return deg < width_deg + 70 ? kBefore : kOn;
}

int triesUntilWanted(double window_deg, double width_deg) {
  TurnSearch search;
  for (int tries = 1; tries <= 40; ++tries) {
    const double roll_rad = search.next(0).value_or(0);
    const int entered = branchAt(roll_rad, window_deg, width_deg);
    if (entered == kWanted) return tries;
    search.add(roll_rad + 4 * kPi, 0, entered);
  }
  return 41;
}

// The widths that rods whose place is known have found: 2 of 16 turns, and half of that.
TEST(TurnSearch, FindsANarrowWindowBetweenTwoBranchesWhereverItLies) {
  for (const double width_deg : {22.5, 45.0}) {
    int most = 0;
    for (double window_deg = 0; window_deg < 360; window_deg += 5)
      most = std::max(most, triesUntilWanted(window_deg, width_deg));
    EXPECT_LE(most, width_deg > 30 ? 8 : 12) << width_deg;
  }
}

// As in a fork of two branches: all tries lead to the other one, or nowhere.
TEST(TurnSearch, CoversTheCircleEvenlyWhereAllTurnsLeadToTheSame) {
  TurnSearch search;
  std::vector<double> rolls;
  for (int i = 0; i < 16; ++i) {
    rolls.push_back(search.next(0.5).value_or(0));
    search.add(rolls.back(), 0.5, std::nullopt);
  }
  std::sort(rolls.begin(), rolls.end());
  for (int i = 0; i < 16; ++i) EXPECT_NEAR(rolls[i], i * kPi / 8, 1e-9);
}

TEST(TurnSearch, KeepsTurnsOfOtherBendsApart) {
  TurnSearch search;
  EXPECT_FALSE(search.next(0));
  search.add(-0.5, 0, 2);
  EXPECT_NEAR(search.next(0).value(), kPi - 0.5, 1e-9);
  EXPECT_FALSE(search.next(0.7));
}

}  // namespace
}  // namespace angio::navigation
