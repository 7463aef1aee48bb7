// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/lab/namespace.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/simulation/simulated_catheter.hpp"

namespace angio::lab {

/// The catheter drive's side of a bus: hears CATHETER_COMMAND and says CATHETER_STATE. Owns no clock: its caller says
/// what time it is.
class SimulatedCatheterNode {
 public:
  /// Borrows the bus, which must outlive it. Throws InputError as SimulatedCatheter does.
  SimulatedCatheterNode(Bus& bus, const VesselTree& tree, const CatheterSettings& settings, const TreeLocation& start,
                        std::int64_t now_us);

  /// Obeys the newest command that waits, as one that arrives now.
  void listen(std::int64_t now_us);

  /// Moves to `now_us` and publishes the state there.
  void report(std::int64_t now_us);

  const SimulatedCatheter& catheter() const { return catheter_; }

 private:
  Bus& bus_;
  LatestMessage<CatheterCommand> commands_;
  SimulatedCatheter catheter_;
  std::int64_t sequence_ = 0;
};

}  // namespace angio::lab
