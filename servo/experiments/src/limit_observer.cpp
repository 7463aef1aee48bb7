// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/experiments/limit_observer.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/formatted.hpp"

namespace angio::experiments {
namespace {

// Rounding of positions that are integrated over minutes; a thousandth of a limit is no excess to speak of.
constexpr double kRounding = 1e-9;
// Commands arrive on whole microseconds, a limiter reckons in real ones.
constexpr double kEnvelopeRounding = 1e-6;

}  // namespace

void LimitObserver::see(const AxesState& state) {
  const auto note = [&](Eigen::Index axis, const char* what, double value, double most) {
    if (!breach_) breach_ = formatted("axis %d: %s %.6g exceeds %.6g", static_cast<int>(axis), what, value, most);
  };
  if (!limits_.envelope.faces.empty()) {
    const CArmJoints joints = state.place;
    const auto* face = limits_.envelope.violated(joints);
    if (face && !breach_ && !(face->room(joints) >= -kEnvelopeRounding * face->normal.norm())) {
      breach_ = formatted("envelope: %s, by %.6g", face->name.c_str(), -face->room(joints));
    }
  }
  const double dt_s = last_ ? 1e-6 * static_cast<double>(state.time_us - last_->time_us) : 0;
  for (Eigen::Index i = 0; i < state.place.size(); ++i) {
    const double q = state.place[i], v = state.velocity[i];
    if (!std::isfinite(q) || !std::isfinite(v)) note(i, "state", q, limits_.upper[i]);
    if (!(q <= limits_.upper[i] + kRounding)) note(i, "position", q, limits_.upper[i]);
    if (!(q >= limits_.lower[i] - kRounding)) note(i, "position below", q, limits_.lower[i]);
    speed_share_ = std::max(speed_share_, std::abs(v) / limits_.velocity[i]);
    if (!(std::abs(v) <= limits_.velocity[i] + kRounding)) note(i, "speed", std::abs(v), limits_.velocity[i]);
    if (!(dt_s > 0)) continue;
    // The mean over the interval: never more than the largest within it.
    const double a = std::abs(v - last_->velocity[i]) / dt_s;
    acceleration_share_ = std::max(acceleration_share_, a / limits_.acceleration[i]);
    if (!(a <= limits_.acceleration[i] * (1 + 1e-6) + kRounding)) note(i, "acceleration", a, limits_.acceleration[i]);
  }
  last_ = state;
}

}  // namespace angio::experiments
