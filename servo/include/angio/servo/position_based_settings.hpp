// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"

namespace angio {

/// Position-based visual servoing: s = (cdtc, theta u of cdRc), s* = 0.
struct PositionBasedSettings {
  static constexpr const char* kName = "position_based";

  double lambda_per_s = 1.5;  ///< Gain: the error decays as exp(-lambda t) while no limit binds.

  void visit(SettingsVisitor& v) { v.number("lambda_per_s", lambda_per_s, 0.01, 20); }
};

}  // namespace angio
