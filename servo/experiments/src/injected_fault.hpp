// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <random>

#include "angio/experiments/fault_experiment.hpp"

namespace angio::experiments {

/// One fault of an experiment: what it does to a lab while it lasts.
class InjectedFault {
 public:
  /// Draws its numbers from the seed. `lab` and `other` are borrowed.
  ///
  /// @param max_frame_age_s  The loop's limit: frames that are late are later, and a clock that jumps by less is not
  ///                          wrong.
  /// @param other  The X-ray of another patient, under the same C-arm.
  InjectedFault(FaultKind kind, OperatedMachine machine, int seed, double command_latency_ms, double max_frame_age_s,
                SimulatedLab& lab, SimulatedXrayNode& other);

  void begin();
  void end();
  bool lasts() const { return lasts_; }

  /// Whether the loop's program ends when the fault begins, and is started again at once, or when it is over.
  bool startsAnewAtOnce() const { return kind_ == FaultKind::kLateFrames; }
  bool kills() const { return kind_ == FaultKind::kKilledNode || startsAnewAtOnce(); }

  /// Changes a frame before it is sent; returns how it is no longer the truth.
  std::optional<std::string> tamper(XrayFrame& frame);

  /// Sends what nobody should believe; to be called once a frame.
  void spoil(std::int64_t now_us);

  const std::string& description() const { return description_; }

 private:
  double uniform(double low, double high);
  void disturb(const DisturbanceSettings& machines, const DisturbanceSettings& loop);
  template <typename Command>
  void spoilCommands(const char* channel, std::int64_t now_us);

  FaultKind kind_;
  OperatedMachine machine_;
  std::mt19937_64 engine_;
  double command_latency_ms_, max_frame_age_s_;
  SimulatedLab& lab_;
  SimulatedXrayNode& other_;
  DisturbanceSettings from_machines_, from_loop_;
  double clock_jump_s_ = 0, late_ms_ = 0, impossible_ = 0;
  int joint_ = 0;
  bool lasts_ = false;
  std::int64_t spoilt_ = 0;
  cv::Mat last_image_;
  std::string description_;
};

}  // namespace angio::experiments
