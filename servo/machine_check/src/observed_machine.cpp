// SPDX-License-Identifier: GPL-2.0-or-later
#include "observed_machine.hpp"

#include <cmath>
#include <utility>

#include "angio/base/formatted.hpp"

namespace angio::machine_check {
namespace {

constexpr double kRemembered_us = 5e6;
// Share of messages that may be missing: one of a hundred is lost on a busy host.
constexpr double kMaxMissing = 0.01;
// A clock's rate against ours, over some seconds, with the jitter of a message's transport.
constexpr double kMaxDrift = 0.02;

}  // namespace

void ObservedChannel::see(std::int64_t time_us, std::int64_t sequence, std::int64_t now_us) {
  if (count_++ == 0) {
    first_time_us_ = time_us;
    first_now_us_ = now_us;
  } else if (sequence <= last_sequence_ || time_us <= last_time_us_) {
    ++disordered_;
  } else {
    missing_ += sequence - last_sequence_ - 1;
  }
  last_time_us_ = time_us;
  last_sequence_ = sequence;
  last_now_us_ = now_us;
}

double ObservedChannel::rate_hz() const {
  const double passed_s = 1e-6 * static_cast<double>(last_now_us_ - first_now_us_);
  return passed_s > 0 ? static_cast<double>(count_ - 1) / passed_s : 0;
}

CheckRow ObservedChannel::rateRow(const std::string& name, double min_hz, double max_hz) const {
  const std::string asked = formatted("%g to %g Hz", min_hz, max_hz);
  if (count_ < 2) return {name + " rate", CheckVerdict::kFail, formatted("%d messages came", int(count_)), asked};
  return verdictRow(name + " rate", rate_hz() >= 0.9 * min_hz && rate_hz() <= 1.1 * max_hz,
                    formatted("%.1f Hz", rate_hz()), asked);
}

CheckRow ObservedChannel::sequenceRow(const std::string& name) const {
  const std::string asked = "rises by one; later times; 1 % missing at most";
  if (count_ < 2) return {name + " order", CheckVerdict::kNotSeen, "too few messages came", asked};
  const double missing = static_cast<double>(missing_) / static_cast<double>(missing_ + count_);
  return verdictRow(name + " order", disordered_ == 0 && missing <= kMaxMissing,
                    formatted("%.1f %% missing, %d not later than the one before", 100 * missing, int(disordered_)),
                    asked);
}

CheckRow ObservedChannel::clockRow(const std::string& name) const {
  const std::string asked = "microseconds: 1 s in 1 s";
  const double passed = static_cast<double>(last_now_us_ - first_now_us_);
  if (count_ < 2 || !(passed > 0.5e6)) return {name + " clock", CheckVerdict::kNotSeen, "too few messages came", asked};
  const double rate = static_cast<double>(last_time_us_ - first_time_us_) / passed;
  std::string measured = formatted("%.4g s in 1 s", rate);
  if (rate > 0 && std::abs(rate * 1e3 - 1) < 0.1) measured += ": in milliseconds?";
  if (rate > 0 && std::abs(rate * 1e-3 - 1) < 0.1) measured += ": in nanoseconds?";
  return verdictRow(name + " clock", std::abs(rate - 1) <= kMaxDrift, measured, asked);
}

void ObservedStates::see(const CArmState& state, std::int64_t now_us) {
  newest_ = state;
  entries_.push_back({state, now_us});
  while (static_cast<double>(now_us - entries_.front().now_us) > kRemembered_us) entries_.pop_front();
}

CArmState ObservedStates::at(std::int64_t time_us) const {
  const Entry* nearest = &entries_.back();
  for (const Entry& entry : entries_) {
    if (std::abs(entry.state.time_us - time_us) < std::abs(nearest->state.time_us - time_us)) nearest = &entry;
  }
  return nearest->state;
}

bool asExpected(double share) { return share >= 0.75 && share <= 1.3; }

std::string inUnits(int joint, double value) {
  return isAngle(joint) ? formatted("%.2f deg", radToDeg(value)) : formatted("%.2f mm", 1e3 * value);
}

CheckRow verdictRow(const std::string& name, bool good, std::string measured, std::string asked) {
  return {name, good ? CheckVerdict::kPass : CheckVerdict::kFail, std::move(measured), std::move(asked)};
}

MotionShare shareOf(const Eigen::Matrix2Xd& seen, const Eigen::Matrix2Xd& expected) {
  MotionShare result;
  const double size = expected.squaredNorm();
  if (!(size > 0)) return result;
  result.share = seen.cwiseProduct(expected).sum() / size;
  result.rest = std::sqrt((seen - result.share * expected).squaredNorm() / size);
  return result;
}

std::string wordsOf(const MotionShare& motion) {
  const double s = motion.share, size = std::abs(s);
  std::string words = formatted("%.2f of what was expected", s);
  if (std::abs(size * 57.3 - 1) < 0.3 || std::abs(size / 57.3 - 1) < 0.3) return words + ": degrees for radians?";
  if (std::abs(size * 1000 - 1) < 0.3 || std::abs(size / 1000 - 1) < 0.3) return words + ": millimetres for metres?";
  if (motion.rest > 0.5) return words + formatted(", %.2f along another axis", motion.rest);
  if (s < -0.5) return words + ": the wrong sign";
  return words;
}

}  // namespace angio::machine_check
