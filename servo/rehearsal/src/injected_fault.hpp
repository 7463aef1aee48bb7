// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <random>

#include "angio/rehearsal/fault_campaign.hpp"

namespace angio {

/// One fault of a campaign: what it does to a room while it lasts.
class InjectedFault {
 public:
  /// Draws its numbers from the seed. `room` and `other` are borrowed.
  ///
  /// @param other  The X-ray of another patient, under the same C-arm.
  InjectedFault(FaultKind kind, int seed, double command_latency_ms, SimulatedRoom& room, SimulatedXrayNode& other);

  void begin();
  void end();
  bool lasts() const { return lasts_; }

  /// Changes a frame before it is sent; returns how it is no longer the truth.
  std::optional<std::string> tamper(XrayFrame& frame);

  /// Sends what nobody should believe; to be called once a frame.
  void spoil(std::int64_t now_us);

  const std::string& description() const { return description_; }

 private:
  double uniform(double low, double high);
  void disturb(const DisturbanceSettings& machines, const DisturbanceSettings& loop);

  FaultKind kind_;
  std::mt19937_64 engine_;
  double command_latency_ms_;
  SimulatedRoom& room_;
  SimulatedXrayNode& other_;
  DisturbanceSettings from_machines_, from_loop_;
  double clock_jump_s_ = 0;
  bool lasts_ = false;
  std::int64_t spoilt_ = 0;
  cv::Mat last_image_;
  std::string description_;
};

}  // namespace angio
