// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>

namespace angio::registration {

/// How far from its line an image point is matched, which follows the noise that matches show.
struct LineGate {
  double gate_px;       ///< No point is matched from further away.
  double tolerance_px;  ///< A point's weight is exp(-r^2 / 2 tolerance^2).
  double noise_px;
  double min_gate_px = 1;

  /// From wide to narrow by the noise; the least tolerance is a share of the least gate.
  void tighten() {
    constexpr double kGateOverNoise = 6, kToleranceOverNoise = 3, kMinTolerance = 0.3;
    gate_px = std::clamp(kGateOverNoise * noise_px, min_gate_px, gate_px);
    tolerance_px = std::clamp(kToleranceOverNoise * noise_px, min_gate_px * kMinTolerance, tolerance_px);
  }
};

/// Half of the gate is tolerated at first, and a quarter is taken for noise.
inline LineGate lineGate(double gate_px) { return {gate_px, gate_px / 2, gate_px / 4}; }

}  // namespace angio::registration
