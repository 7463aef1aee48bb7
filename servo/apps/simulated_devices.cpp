// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulated_devices.hpp"

#include <algorithm>
#include <utility>

#include "angio/apps/namespace.hpp"
#include "angio/base/monotonic_clock.hpp"

namespace angio::apps {
namespace {

// So long it may take until they stop.
constexpr std::chrono::milliseconds kMaxWait(100);

}  // namespace

SimulatedDevices::SimulatedDevices(std::unique_ptr<Bus> bus, const CArmLimits& limits, const CArmJoints& start,
                                   const std::optional<Catheter>& catheter)
    : bus_(std::move(bus)), arm_(*bus_, limits, start, monotonic_us()) {
  if (catheter) catheter_.emplace(*bus_, catheter->tree, catheter->settings, catheter->start, monotonic_us());
}

SimulatedDevices::~SimulatedDevices() { end(); }

void SimulatedDevices::start(Clock::time_point first, Clock::duration period) {
  thread_ = std::thread([this, first, period] {
    try {
      run(first, period);
    } catch (...) {
      thrown_ = std::current_exception();
      failed_ = true;
    }
  });
}

void SimulatedDevices::end() {
  stopped_ = true;
  if (thread_.joinable()) thread_.join();
}

void SimulatedDevices::stop() {
  end();
  if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
}

Device SimulatedDevices::device(const Eigen::Matrix3Xd& points) const {
  const std::lock_guard<std::mutex> lock(moving_);
  return catheter_->catheter().device(points);
}

void SimulatedDevices::run(Clock::time_point first, Clock::duration period) {
  for (auto due = first; !stopped_;) {
    const auto left = std::clamp<Clock::duration>(due - Clock::now(), Clock::duration::zero(), kMaxWait);
    bus_->handle(std::chrono::floor<std::chrono::milliseconds>(left));
    listen();
    if (due - Clock::now() >= std::chrono::milliseconds(1)) continue;  // A message came first.
    std::this_thread::sleep_until(due);                                // What a wait in milliseconds left.
    report();
    due += period * ((Clock::now() - due) / period + 1);  // What was missed is not made up for in a burst.
  }
}

void SimulatedDevices::listen() {
  const std::lock_guard<std::mutex> lock(moving_);
  arm_.listen(monotonic_us());
  if (catheter_) catheter_->listen(monotonic_us());
}

void SimulatedDevices::report() {
  const std::lock_guard<std::mutex> lock(moving_);
  arm_.report(monotonic_us());
  if (catheter_) catheter_->report(monotonic_us());
}

}  // namespace angio::apps
