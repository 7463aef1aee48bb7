// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/simulated_injector.hpp"

#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/types/channels.hpp"

namespace angio::lab {

SimulatedInjector::SimulatedInjector(Bus& bus, double after_s)
    : requests_(bus, kViewRequestChannel), statuses_(bus, kServoStatusChannel) {
  requireBetween("injector", "after_s", after_s, 0, 3600);
  after_us_ = std::llround(1e6 * after_s);
}

bool SimulatedInjector::injects(std::int64_t now_us) {
  if (const auto request = requests_.take(); request && request->time_us != request_us_) {
    request_us_ = request->time_us;
    reached_us_.reset();
  }
  const auto status = statuses_.take();
  if (request_us_ == 0) return false;
  if (!reached_us_ && status && status->view_reached_us == request_us_) reached_us_ = now_us;
  return !reached_us_ || now_us - *reached_us_ < after_us_;
}

}  // namespace angio::lab
