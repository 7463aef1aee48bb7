// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/servo/servo_law.hpp"

namespace angio::servo {

/// IBVS with ViSP's vpServo on one feature that stacks the images of centreline points, with their own depths.
/// Source: Chaumette & Hutchinson, "Visual servo control I", IEEE Robotics & Automation Magazine 13(4), 2006, eq. 11.
///
/// The points that count are those that the goal shows (all, when it shows fewer than eight): they are the same all the
/// way, so that the error does not jump when one comes into view. Throws InputError when the model has no tree.
std::unique_ptr<ServoLaw> make(const ImageBasedSettings& settings, const LawModel& model);

}  // namespace angio::servo
