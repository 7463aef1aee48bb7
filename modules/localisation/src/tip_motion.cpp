// SPDX-License-Identifier: GPL-2.0-or-later
#include "tip_motion.hpp"

#include <algorithm>
#include <cmath>

namespace angio::localisation {
namespace {

constexpr double kMaxPeriod_s = 1;
constexpr double kReach = 4;  // Standard deviations.

}  // namespace

TipMotion::TipMotion(const LocaliserSettings& settings, const PlaceGrid& grid, const CatheterMotion& motion)
    : grid_(grid) {
  const bool timed = std::isfinite(motion.period_s) && motion.period_s > 0;
  const double period_s = timed ? std::min(motion.period_s, kMaxPeriod_s) : kMaxPeriod_s;
  const double fastest_m = 1e-3 * settings.max_speed_mm_per_s * period_s;
  const bool pushed = motion.pushed_m && std::isfinite(*motion.pushed_m);
  if (pushed) mean_m_ = std::clamp(*motion.pushed_m, -fastest_m, fastest_m);
  const double doubt_m = pushed ? settings.slip_std * std::abs(mean_m_) : 1e-3 * settings.speed_std_mm_per_s * period_s;
  // Less than half a step would not let the mean move by parts of a step.
  std_m_ = std::max(std::hypot(doubt_m, 1e-3 * settings.backlash_mm), 0.5 * grid.spacing_m);
  const double max_m = std::max(fastest_m, 2 * grid.spacing_m);
  lowest_m_ = std::max(mean_m_ - kReach * std_m_, -max_m);
  highest_m_ = std::min(mean_m_ + kReach * std_m_, max_m);
}

// A way back and then ahead into another branch is as unlikely as the shorter of its parts is long.
void TipMotion::add(int place, double back_m, double ahead_m, double share) {
  const double moved_m = ahead_m - back_m;
  if (moved_m < lowest_m_ || moved_m > highest_m_) return;
  const double off = (moved_m - mean_m_) / std_m_, turn = std::min(back_m, ahead_m) / std_m_;
  reached_.push_back({place, share * std::exp(-0.5 * (off * off + turn * turn))});
}

void TipMotion::descend(int place, double back_m, double ahead_m, double share, int except) {
  add(place, back_m, ahead_m, share);
  if (ahead_m - back_m > highest_m_ || ahead_m > kReach * std_m_ + std::abs(mean_m_)) return;
  const auto& children = grid_.children[place];
  const int ways = static_cast<int>(children.size()) - (except >= 0 ? 1 : 0);
  for (const int child : children) {
    if (child == except) continue;
    descend(child, back_m, ahead_m + grid_.path_m[child] - grid_.path_m[place], share / ways, -1);
  }
}

const std::vector<Reach>& TipMotion::from(int from) {
  reached_.clear();
  descend(from, 0, 0, 1, -1);
  const double max_back_m = kReach * std_m_ + std::abs(mean_m_);
  for (int below = from, at = grid_.parent[from]; at >= 0; below = at, at = grid_.parent[at]) {
    const double back_m = grid_.path_m[from] - grid_.path_m[at];
    if (back_m > max_back_m) break;
    descend(at, back_m, 0, 1, below);
  }
  double sum = 0;
  for (const Reach& one : reached_) sum += one.probability;
  if (!(sum > 0)) {
    // Pushed on at the vessel's end, or pulled back at the root: there it stays.
    reached_.assign(1, {from, 1.0});
    return reached_;
  }
  for (Reach& one : reached_) one.probability /= sum;
  return reached_;
}

}  // namespace angio::localisation
