// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/simulation_settings/namespace.hpp"

namespace angio::simulation_settings {

/// How a simulated lab keeps time.
struct LabSettings {
  double frame_rate_hz = 15;
  double state_rate_hz = 100;      ///< Of the encoders' messages, beside one at each exposure.
  double command_latency_ms = 80;  ///< From an exposure until the command that answers it reaches its machine.
  bool images = true;              ///< Whether frames are rendered and sent; without, an exposure's image is empty.

  void visit(SettingsVisitor& v) {
    v.number("frame_rate_hz", frame_rate_hz, 1, 100);
    v.number("state_rate_hz", state_rate_hz, 1, 1000);
    v.number("command_latency_ms", command_latency_ms, 0, 2000);
    v.flag("images", images);
  }
};

}  // namespace angio::simulation_settings
