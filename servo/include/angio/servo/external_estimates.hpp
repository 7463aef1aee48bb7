// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/messaging/messages.hpp"
#include "angio/servo/namespace.hpp"

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
};

}  // namespace angio::servo
