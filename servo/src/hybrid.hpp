// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/servo/servo_law.hpp"

namespace angio::servo {

/// 2 1/2 D visual servoing with ViSP's vpFeaturePoint, vpFeatureDepth and vpFeatureThetaU (cdRc).
/// Source: Malis, Chaumette, Boudet, "2 1/2 D visual servoing", IEEE Trans. Robotics and Automation 15(2), 1999.
///
/// Throws InputError when the model names no target.
std::unique_ptr<ServoLaw> make(const HybridSettings& settings, const LawModel& model);

}  // namespace angio::servo
