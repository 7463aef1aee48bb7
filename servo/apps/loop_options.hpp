// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/cli/program.hpp"
#include "servo_settings.hpp"

namespace angio::apps {

/// What a command line says of a loop; what is given comes before the settings file's.
struct LoopOptions {
  std::string task, view_from, perception, center_on;
  std::optional<double> view_primary_deg, view_secondary_deg;

  void addTo(CLI::App& app);
  bool given() const;
  void applyTo(ServoSettings& settings) const;
};

}  // namespace angio::apps
