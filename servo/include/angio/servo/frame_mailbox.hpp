// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "angio/messaging/mailbox.hpp"
#include "angio/servo/namespace.hpp"
#include "angio/types/any_message.hpp"

namespace angio::servo {

/// What a loop does not estimate itself from its frames, but hears from other programs.
struct ExternalInputs {
  bool registration = false;  ///< Where the model is: REGISTRATION.
  bool tip = false;           ///< Where the catheter's tip is: CATHETER_TIP.
};

/// What other programs have estimated of one frame.
struct ExternalEstimates {
  std::optional<RegistrationMessage> registration;
  std::optional<CatheterTip> tip;
};

/// A frame with what has been estimated of it.
struct FrameWithEstimates {
  XrayFrame frame;
  ExternalEstimates external;
  std::string sender = {};  ///< Of the frame (Bus::sender()); empty: unknown.
};

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

  /// What has been heard of frames; and the channels on which messages are awaited of frames that have come.
  const ChannelRecord& record() const { return frames_.record(); }
  std::vector<std::string> awaited() const;

 private:
  ExternalInputs wanted_;
  LatestMessage<XrayFrame> frames_;
  std::unique_ptr<MessageQueue<RegistrationMessage>> registrations_;
  std::unique_ptr<MessageQueue<CatheterTip>> tips_;
  struct Waiting {
    XrayFrame frame;
    std::string sender;
  };
  std::deque<Waiting> waiting_;  // Oldest first.
  std::deque<RegistrationMessage> heard_registrations_;
  std::deque<CatheterTip> heard_tips_;
};

}  // namespace angio::servo
