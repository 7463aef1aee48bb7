// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/apps/namespace.hpp"
#include "angio/cli/command_line_fwd.hpp"
#include "angio/simulation/catheter_settings.hpp"

namespace angio::apps {

enum class CatheterModel { kKinematic, kElastic };

/// What a command line says of a simulated catheter: its model, and of an elastic one what no settings file says.
struct CatheterOptions {
  CatheterModel model = CatheterModel::kKinematic;
  std::optional<double> shaft_bending_n_mm2, tip_bending_n_mm2, soft_length_mm, wall_friction;

  void addTo(cli::Command& command);

  /// Throws InputError that names the option when one of an elastic catheter is given to another.
  void applyTo(CatheterSettings& settings) const;
};

}  // namespace angio::apps
