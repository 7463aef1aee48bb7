// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_law.hpp"

#include "position_based.hpp"

namespace angio {

std::unique_ptr<ServoLaw> makeServoLaw(const ServoLawSettings& settings) {
  return std::visit([](const auto& chosen) { return make(chosen); }, settings);
}

}  // namespace angio
