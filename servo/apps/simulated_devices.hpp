// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <atomic>
#include <chrono>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "angio/apps/namespace.hpp"
#include "angio/simulation/catheter_node.hpp"
#include "angio/simulation/nodes.hpp"

namespace angio::apps {

/// The simulated C-arm, and the catheter drive where there is one, in real time on a thread and a bus of their own: as
/// real machines they hear and report while the X-ray is busy.
class SimulatedDevices {
 public:
  using Clock = std::chrono::steady_clock;

  /// How a catheter begins; borrows the tree.
  struct Catheter {
    const VesselTree& tree;
    CatheterSettings settings;
    TreeLocation start;
  };

  SimulatedDevices(std::unique_ptr<Bus> bus, const CArmLimits& limits, const CArmJoints& start,
                   const std::optional<Catheter>& catheter = std::nullopt);
  ~SimulatedDevices();
  SimulatedDevices(const SimulatedDevices&) = delete;
  SimulatedDevices& operator=(const SimulatedDevices&) = delete;

  /// From now on they obey what they hear as it comes, and report at `first` and every `period` after it.
  void start(Clock::time_point first, Clock::duration period);

  /// Ends that. Throws what went wrong meanwhile.
  void stop();

  /// Whether they have stopped by themselves, as something went wrong.
  bool failed() const { return failed_; }

  /// The catheter as it is now, as SimulatedCatheter::device. Only with a catheter; at any time.
  Device device(const Eigen::Matrix3Xd& points) const;

  /// Only while stopped.
  const SimulatedCArm& arm() const { return arm_.arm(); }
  const std::optional<SimulatedCatheterNode>& catheter() const { return catheter_; }

 private:
  void run(Clock::time_point first, Clock::duration period);
  void listen();
  void report();
  void end();

  std::unique_ptr<Bus> bus_;
  SimulatedCArmNode arm_;
  std::optional<SimulatedCatheterNode> catheter_;
  mutable std::mutex moving_;  // Of what the machines are.
  std::atomic<bool> stopped_{false}, failed_{false};
  std::exception_ptr thrown_;
  std::thread thread_;
};

}  // namespace angio::apps
