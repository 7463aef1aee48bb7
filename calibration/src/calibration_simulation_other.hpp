// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/calibration/calibration_simulation.hpp"

namespace angio {

/// Another machine of another make with the same patient and phantom: what must not be mixed with the first.
SimulatedMachine otherMachine(const SimulatedMachine& machine, const CalibrationSimulationSettings& settings);

}  // namespace angio
