// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/simulation_settings/namespace.hpp"

namespace angio::simulation_settings {

/// How a simulated lab keeps time.
struct LabSettings {
  double frame_rate_hz = 15;
  double state_rate_hz = 100;
  double command_latency_ms = 80;
  bool images = true;

  void visit(SettingsVisitor& v) {
    v.number("frame_rate_hz", frame_rate_hz, 1, 100, "Frames a second");
    v.number("state_rate_hz", state_rate_hz, 1, 1000, "Rate of the encoders' messages, beside one at each exposure");
    v.number("command_latency_ms", command_latency_ms, 0, 2000,
             "Time from an exposure until the command that answers it reaches its machine");
    v.flag("images", images, "Frames are rendered and sent; without, an exposure's image is empty");
  }
};

}  // namespace angio::simulation_settings
