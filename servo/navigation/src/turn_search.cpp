// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/turn_search.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "angio/geometry/se3.hpp"

namespace angio::navigation {
namespace {

constexpr double kSameBend_rad = 0.1;
constexpr double kOfEqual = 0.4;      // What a gap between turns that led to the same counts, against others.
constexpr double kNarrow_rad = 0.17;  // A gap that a drive's backlash and wind-up fill.

double inTurn(double roll_rad) {
  const double in = std::fmod(roll_rad, 2 * kPi);
  return in < 0 ? in + 2 * kPi : in;
}

}  // namespace

void TurnSearch::add(double roll_rad, double bend_rad, std::optional<int> entered) {
  const Turn turn{inTurn(roll_rad), bend_rad, entered};
  const auto behind = std::upper_bound(turns_.begin(), turns_.end(), turn,
                                       [](const Turn& a, const Turn& b) { return a.roll_rad < b.roll_rad; });
  turns_.insert(behind, turn);
}

std::optional<double> TurnSearch::next(double bend_rad) const {
  std::vector<Turn> turns;
  std::copy_if(turns_.begin(), turns_.end(), std::back_inserter(turns),
               [&](const Turn& turn) { return std::abs(turn.bend_rad - bend_rad) < kSameBend_rad; });
  if (turns.empty()) return std::nullopt;
  double best = -1, middle_rad = 0;
  for (std::size_t i = 0; i < turns.size(); ++i) {
    const bool last = i + 1 == turns.size();
    const Turn &from = turns[i], &to = turns[last ? 0 : i + 1];
    const double gap_rad = to.roll_rad - from.roll_rad + (last ? 2 * kPi : 0);
    const bool counts = from.entered != to.entered && gap_rad > kNarrow_rad;
    const double worth = (counts ? 1 : kOfEqual) * gap_rad;
    if (worth > best) best = worth, middle_rad = from.roll_rad + 0.5 * gap_rad;
  }
  return inTurn(middle_rad);
}

}  // namespace angio::navigation
