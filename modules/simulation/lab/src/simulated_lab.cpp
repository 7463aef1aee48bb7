// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/simulated_lab.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/checked.hpp"
#include "angio/base/interruption.hpp"

namespace angio::lab {
namespace {

constexpr std::chrono::milliseconds kNoWait(0);

// Each connection has random numbers of its own.
constexpr std::uint64_t kMachinesSalt = 0x6d61, kLoopSalt = 0x6c6f;

}  // namespace

SimulatedLab::SimulatedLab(const VesselTree& tree, const SimulatedPatientSettings& patient, const LabWorld& world,
                           const LabSettings& settings)
    : period_us_(1e6 / checked("lab", settings).frame_rate_hz),
      report_period_us_(1e6 / settings.state_rate_hz),
      images_(settings.images),
      bus_(openBus("memq://")),
      from_machines_(*bus_, {}, static_cast<std::uint64_t>(patient.fluoroscopy.seed) ^ kMachinesSalt),
      from_loop_(*bus_, {}, static_cast<std::uint64_t>(patient.fluoroscopy.seed) ^ kLoopSalt),
      arm_(from_machines_, world.limits, world.start, 0),
      xray_(tree, patient, world.carm, world.T_patient_model, world.claimed_camera) {
  DisturbanceSettings latency;
  latency.delay_ms = settings.command_latency_ms;
  from_loop_.disturb(kCArmCommandChannel, latency);
  if (!world.catheter) return;
  from_loop_.disturb(kCatheterCommandChannel, latency);
  catheter_.emplace(from_machines_, tree, world.catheter->settings, world.catheter->start, 0);
  xray_.show([this](const Eigen::Matrix3Xd& points) { return catheter().device(points); });
}

std::int64_t SimulatedLab::exposure_us(std::int64_t k) const {
  return std::llround(static_cast<double>(k + 1) * period_us_);
}

std::int64_t SimulatedLab::report_us(std::int64_t k) const {
  return std::llround(static_cast<double>(k + 1) * report_period_us_);
}

std::optional<Exposure> SimulatedLab::advance() {
  throwIfInterrupted();
  std::int64_t next = std::min(exposure_us(exposures_), report_us(reports_));
  for (const auto due : {from_machines_.nextDue_us(), from_loop_.nextDue_us()}) {
    if (due) next = std::min(next, std::max(*due, now_us_));
  }
  moveTo(next);

  std::optional<Exposure> exposure;
  if (now_us_ == exposure_us(exposures_)) {
    ++exposures_;
    report();
    const CArmState state = arm().state();
    exposure = Exposure{images_ ? xray_.render(now_us_, state.joints) : xray_.blank(now_us_), state, {}};
    if (catheter_) exposure->catheter = catheter().truth();
    if (tamper_) tamper_(exposure->frame);
    if (images_) publish(from_machines_, kXrayFrameChannel, exposure->frame);
  }
  if (now_us_ == report_us(reports_)) {
    ++reports_;
    if (!exposure) report();
  }
  bus_->handle(kNoWait);
  return exposure;
}

// Messages that are due come first, and what is due for a machine is obeyed from now on.
void SimulatedLab::moveTo(std::int64_t time_us) {
  now_us_ = time_us;
  from_machines_.advance(now_us_);
  from_loop_.advance(now_us_);
  bus_->handle(kNoWait);
  arm_.listen(now_us_);
  if (catheter_) catheter_->listen(now_us_);
}

void SimulatedLab::report() {
  arm_.report(now_us_);
  if (catheter_) catheter_->report(now_us_);
}

}  // namespace angio::lab
