// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "angio/messaging/mailbox.hpp"

namespace angio {

/// What a loop does not look for itself in its frames, but is told by other programs.
struct ToldOfFrames {
  bool registration = false;  ///< Where the model is: REGISTRATION.
  bool tip = false;           ///< Where the catheter's tip is: CATHETER_TIP.
};

/// What other programs have said of one frame.
struct SeenElsewhere {
  std::optional<RegistrationMessage> registration;
  std::optional<CatheterTip> tip;
};

/// A frame with what has been said of it.
struct ToldFrame {
  XrayFrame frame;
  SeenElsewhere seen;
};

/// The newest X-ray frame of a bus, and with it what other programs say of the same frame: such frames wait until that
/// has come. Messages belong to a frame by its number and its time. Of several that say the same thing the first one
/// counts.
class FrameMailbox {
 public:
  /// Throws InputError as Bus::subscribe() does.
  FrameMailbox(Bus& bus, const ToldOfFrames& told);

  /// The newest frame of which all is known, once; older ones are let go.
  std::optional<ToldFrame> take();

  std::int64_t refused() const { return frames_.refused(); }  ///< Frames that could not be decoded.

 private:
  ToldOfFrames told_;
  LatestValue<XrayFrame> frames_;
  std::unique_ptr<EveryValue<RegistrationMessage>> registrations_;
  std::unique_ptr<EveryValue<CatheterTip>> tips_;
  std::deque<XrayFrame> waiting_;  // Oldest first.
  std::deque<RegistrationMessage> heard_registrations_;
  std::deque<CatheterTip> heard_tips_;
};

}  // namespace angio
