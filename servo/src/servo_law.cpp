// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_law.hpp"

#include "visp_servo_law.hpp"

namespace angio::servo {

std::unique_ptr<ServoLaw> makeServoLaw(const ServoLawSettings& settings, const LawModel& model) {
  return std::visit([&](const auto& chosen) { return make(chosen, model); }, settings);
}

}  // namespace angio::servo
