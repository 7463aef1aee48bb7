// SPDX-License-Identifier: GPL-2.0-or-later

#include <visp3/visual_features/vpFeatureThetaU.h>
#include <visp3/visual_features/vpFeatureTranslation.h>

#include "angio/geometry/visp.hpp"
#include "visp_servo_law.hpp"

namespace angio::servo {
namespace {

class PositionBased final : public ServoLaw {
 public:
  PositionBased(const PositionBasedSettings& settings, const LawModel& model)
      : translation_(vpFeatureTranslation::cdMc),
        desired_translation_(vpFeatureTranslation::cdMc),
        theta_u_(vpFeatureThetaU::cdRc),
        desired_theta_u_(vpFeatureThetaU::cdRc),
        task_(settings, model.target) {
    task_.servo().addFeature(translation_, desired_translation_);
    task_.servo().addFeature(theta_u_, desired_theta_u_, vpFeatureThetaU::selectTUx() | vpFeatureThetaU::selectTUy());
  }

  std::optional<CArmJoints> velocity(const LawInput& input) override {
    const auto goal = task_.goal(input);
    if (!goal) return std::nullopt;
    const vpHomogeneousMatrix cdMc = toVisp(Pose(*goal * task_.T_camera_model().inverse()));
    translation_.buildFrom(cdMc);
    theta_u_.buildFrom(cdMc);
    return task_.velocity(input);
  }

 private:
  vpFeatureTranslation translation_, desired_translation_;
  vpFeatureThetaU theta_u_, desired_theta_u_;
  VispServoLaw task_;  // Last: goes before the features that it holds.
};

}  // namespace

std::unique_ptr<ServoLaw> make(const PositionBasedSettings& settings, const LawModel& model) {
  checkSettings(PositionBasedSettings::kName, settings);
  return std::make_unique<PositionBased>(settings, model);
}

}  // namespace angio::servo
