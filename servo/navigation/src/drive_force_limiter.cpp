// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/drive_force_limiter.hpp"

#include <algorithm>
#include <cmath>

#include "angio/navigation/namespace.hpp"

namespace angio::navigation {
namespace {

constexpr double kShortestPeriod_s = 1.0 / 60, kLongestPeriod_s = 0.2;  // A longer gap is no period.
constexpr double kLatePeriods = 0.25;                                   // That a command may come later than it should.
constexpr double kSeenWay_m = 0.2e-3;                                   // That shows a stiffness.

double seconds(std::int64_t us) { return 1e-6 * static_cast<double>(us); }

// Of the force over the way from one state to another [N/m]; 0 where the way is too short to tell.
double slope(const CatheterState& from, const CatheterState& to) {
  const double way_m = to.insertion_m - from.insertion_m;
  return std::abs(way_m) < kSeenWay_m ? 0.0 : (to.insertion_force_n - from.insertion_force_n) / way_m;
}

}  // namespace

void DriveForceLimiter::observe(const CatheterState& drive) {
  if (drive_) {
    const double passed_s = seconds(drive.time_us - drive_->time_us);
    if (passed_s > 0 && passed_s <= kLongestPeriod_s) period_s_ = std::max(passed_s, kShortestPeriod_s);
  }
  learn(drive);
  drive_ = drive;
}

// A rise that the next frame confirms: one that is gone again was an error of the sensor.
void DriveForceLimiter::learn(const CatheterState& drive) {
  if (!from_) from_ = drive;
  if (risen_from_) {
    stiffness_n_per_m_ =
        std::max(stiffness_n_per_m_, std::min(slope(*risen_from_, *from_), slope(*risen_from_, drive)));
    risen_from_.reset();
  }
  if (slope(*from_, drive) == 0) return;
  risen_from_ = from_;
  from_ = drive;
}

// From the drive's state until the answer to a frame moves it, at the latest [s].
double DriveForceLimiter::reach_s(std::int64_t frame_us) const {
  return std::max(seconds(frame_us - drive_->time_us), 0.0) + latency_s_ + kLatePeriods * period_s_;
}

// By which earlier commands may move the drive in a direction, +1 or -1, within `reach_s` [m].
double DriveForceLimiter::wayInFlight_m(double direction, double reach_s) const {
  double fastest = std::max(direction * drive_->insertion_speed_m_per_s, 0.0);
  for (std::size_t i = 0; i < sent_.size(); ++i) {
    double lasts_s = seconds(sent_[i].valid_for_us);
    if (i + 1 < sent_.size()) lasts_s = std::min(lasts_s, seconds(sent_[i + 1].time_us - sent_[i].time_us));
    const bool over = seconds(drive_->time_us - sent_[i].time_us) > lasts_s + reach_s;
    if (!over) fastest = std::max(fastest, direction * sent_[i].insertion_speed_m_per_s);
  }
  return fastest * reach_s;
}

CatheterCommand DriveForceLimiter::limited(const CatheterCommand& wanted) const {
  const double speed = std::abs(wanted.insertion_speed_m_per_s);
  if (!drive_ || !(speed > 0)) return wanted;
  const double direction = wanted.insertion_speed_m_per_s > 0 ? 1.0 : -1.0, reach = reach_s(wanted.time_us);
  const double room_m = (max_force_n_ - direction * drive_->insertion_force_n) / stiffness_n_per_m_;
  const double left_m = room_m - wayInFlight_m(direction, reach);
  const double lasts_s = (1 + kLatePeriods) * period_s_;  // Until the next command moves the drive.
  // By what is left alone the speed would swing: what is fast now leaves little for what comes.
  const double cut = std::max(std::min({speed, room_m / (reach + lasts_s), left_m / lasts_s}), 0.0);
  CatheterCommand command = wanted;
  command.insertion_speed_m_per_s = direction * cut;
  if (cut * seconds(wanted.valid_for_us) > left_m && cut > 0) {
    command.valid_for_us = static_cast<std::int64_t>(1e6 * left_m / cut);
  }
  return command;
}

void DriveForceLimiter::commit(const CatheterCommand& sent) {
  const auto over = [&](const CatheterCommand& c) {
    const double ago_s = seconds(sent.time_us - c.time_us);
    return ago_s < 0 || ago_s > seconds(c.valid_for_us) + latency_s_ + kLongestPeriod_s;
  };
  sent_.erase(std::remove_if(sent_.begin(), sent_.end(), over), sent_.end());
  sent_.push_back(sent);
}

}  // namespace angio::navigation
