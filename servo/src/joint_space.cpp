// SPDX-License-Identifier: GPL-2.0-or-later

#include "visp_servo_law.hpp"

namespace angio::servo {
namespace {

class JointSpace final : public ServoLaw {
 public:
  JointSpace(const JointSpaceSettings& settings, const LawModel& model) : task_(settings, model.target) {}

  std::optional<CArmJoints> velocity(const LawInput& input) override {
    if (!input.joints_left || !input.joints_left->allFinite() || !task_.goal(input)) return std::nullopt;
    return CArmJoints(task_.lambda() * *input.joints_left);
  }

 private:
  VispServoLaw task_;
};

}  // namespace

std::unique_ptr<ServoLaw> make(const JointSpaceSettings& settings, const LawModel& model) {
  checkSettings(JointSpaceSettings::kName, settings);
  return std::make_unique<JointSpace>(settings, model);
}

}  // namespace angio::servo
