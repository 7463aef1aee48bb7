// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/servo/servo_law.hpp"

namespace angio::servo {

/// PBVS with ViSP's vpServo on vpFeatureTranslation (cdMc) and vpFeatureThetaU (cdRc).
///
/// A C-arm without detector rotation cannot turn its image about the beam, so the third component of theta u is left
/// out: five features for five joints.
std::unique_ptr<ServoLaw> make(const PositionBasedSettings& settings, const LawModel& model);

}  // namespace angio::servo
