// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/evaluation/simulation.hpp"

namespace angio::evaluation {

/// What one view of a trial shows, and the camera that shows just that field.
struct SimulatedView {
  XrayCamera camera;
  Centerline2d centerline;
  std::vector<Curve> spurious_px;  ///< Those of its curves that are no vessel.
};

/// One view of a tree.
///
/// @param branches_px  The whole tree's branches on the detector's plane, finely sampled, also what the detector does
///                     not see.
/// @param shown        Which of them contrast agent fills.
/// @param trial, view  Numbers that choose the draws.
SimulatedView simulatedView(const std::vector<Curve>& branches_px, const std::vector<bool>& shown,
                            const XrayCamera& camera, const SimulationSettings& settings, int trial, int view);

}  // namespace angio::evaluation
