// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/types/time_stamp.hpp"

#include <cmath>

#include "angio/base/formatted.hpp"

namespace angio::types {
namespace {

constexpr double kHour_us = 3600e6, kYear_us = 365.25 * 24 * kHour_us;

}  // namespace

std::string sourceOf(const TimeStamp& stamp) {
  return stamp.sender.empty() ? stamp.channel : stamp.channel + " from " + stamp.sender;
}

std::string timeInWords(std::int64_t time_us) {
  const double time = static_cast<double>(time_us);
  const std::string number = std::to_string(time_us) + " us";
  const auto since_1970 = [](double years_since_1970) { return years_since_1970 > 50 && years_since_1970 < 130; };
  if (since_1970(time / kYear_us)) return number + " (since 1970)";
  if (since_1970(1e-3 * time / kYear_us)) return number + " (nanoseconds since 1970?)";
  return number + formatted(" (%.3g h)", time / kHour_us);
}

bool differentEpochs(std::int64_t a_us, std::int64_t b_us) {
  return std::abs(static_cast<double>(a_us) - static_cast<double>(b_us)) > kHour_us;
}

std::optional<std::string> differentEpochs(const TimeStamp& a, const TimeStamp& b) {
  if (!differentEpochs(a.time_us, b.time_us)) return std::nullopt;
  return "the clocks of " + sourceOf(a) + " and " + sourceOf(b) + " count from different epochs: utime " +
         timeInWords(a.time_us) + " and " + timeInWords(b.time_us) + ": set both to one clock";
}

}  // namespace angio::types
