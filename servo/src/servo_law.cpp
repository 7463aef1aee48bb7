// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_law.hpp"

#include "hybrid.hpp"
#include "image_based.hpp"
#include "position_based.hpp"

namespace angio::servo {

std::unique_ptr<ServoLaw> makeServoLaw(const ServoLawSettings& settings, const LawModel& model) {
  return std::visit([&](const auto& chosen) { return make(chosen, model); }, settings);
}

}  // namespace angio::servo
