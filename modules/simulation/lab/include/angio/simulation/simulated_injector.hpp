// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/lab/namespace.hpp"
#include "angio/messaging/mailbox.hpp"

namespace angio::lab {

/// The person at the injector: injects contrast agent from when a view is asked for (VIEW_REQUEST) until some time
/// after the C-arm's loop says that it is reached (SERVO_STATUS). Owns no clock: the caller says what time it is.
class SimulatedInjector {
 public:
  /// Borrows the bus, which must outlive it.
  /// @param after_s  That the injection goes on for when the view is reached [s], >= 0.
  SimulatedInjector(Bus& bus, double after_s);

  /// Whether contrast agent is injected at `now_us`. To be called at least as often as frames are exposed.
  bool injects(std::int64_t now_us);

 private:
  LatestMessage<ViewRequest> requests_;
  LatestMessage<ServoStatus> statuses_;
  std::int64_t after_us_;
  std::int64_t request_us_ = 0;             // Of the view that is being reached, or was; 0: none.
  std::optional<std::int64_t> reached_us_;  // When it was reached, by the caller's clock.
};

}  // namespace angio::lab
