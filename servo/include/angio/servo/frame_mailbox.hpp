// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "angio/messaging/mailbox.hpp"
#include "angio/servo/external_estimates.hpp"

namespace angio::servo {

/// The newest X-ray frame of a bus, and with it what other programs say of the same frame: such frames wait until that
/// has come. Messages belong to a frame by its number and its time. Of several that say the same thing the first one
/// counts.
class FrameMailbox {
 public:
  /// Throws InputError as Bus::subscribe() does.
  FrameMailbox(Bus& bus, const ExternalInputs& wanted);

  /// The newest frame of which all is known, once; older ones are let go.
  std::optional<FrameWithEstimates> take();

  std::int64_t refused() const { return frames_.refused(); }  ///< Frames that could not be decoded.

 private:
  ExternalInputs wanted_;
  LatestMessage<XrayFrame> frames_;
  std::unique_ptr<MessageQueue<RegistrationMessage>> registrations_;
  std::unique_ptr<MessageQueue<CatheterTip>> tips_;
  std::deque<XrayFrame> waiting_;  // Oldest first.
  std::deque<RegistrationMessage> heard_registrations_;
  std::deque<CatheterTip> heard_tips_;
};

}  // namespace angio::servo
