// SPDX-License-Identifier: GPL-2.0-or-later
#include "position_based.hpp"

#include <visp3/visual_features/vpFeatureThetaU.h>
#include <visp3/visual_features/vpFeatureTranslation.h>
#include <visp3/vs/vpServo.h>

#include <cmath>

namespace angio {
namespace {

class PositionBased final : public ServoLaw {
 public:
  explicit PositionBased(const PositionBasedSettings& settings)
      : translation_(vpFeatureTranslation::cdMc),
        desired_translation_(vpFeatureTranslation::cdMc),
        theta_u_(vpFeatureThetaU::cdRc),
        desired_theta_u_(vpFeatureThetaU::cdRc) {
    task_.setServo(vpServo::EYEINHAND_L_cVe_eJe);
    task_.setInteractionMatrixType(vpServo::CURRENT, vpServo::PSEUDO_INVERSE);
    task_.setLambda(settings.lambda_per_s);
    task_.set_cVe(vpVelocityTwistMatrix());  // The camera is the end-effector.
    task_.addFeature(translation_, desired_translation_);
    task_.addFeature(theta_u_, desired_theta_u_, vpFeatureThetaU::selectTUx() | vpFeatureThetaU::selectTUy());
  }
  // vpServo holds the features by address.
  PositionBased(const PositionBased&) = delete;
  PositionBased& operator=(const PositionBased&) = delete;
  ~PositionBased() override { task_.kill(); }

  std::optional<CArmJoints> velocity(const vpHomogeneousMatrix& cMo, const vpHomogeneousMatrix& cdMo,
                                     const vpMatrix& eJe) override {
    const vpHomogeneousMatrix cdMc = cdMo * cMo.inverse();
    for (unsigned i = 0; i < cdMc.size(); ++i) {
      if (!std::isfinite(cdMc.data[i])) return std::nullopt;
    }
    translation_.buildFrom(cdMc);
    theta_u_.buildFrom(cdMc);
    task_.set_eJe(eJe);
    const vpColVector qdot = task_.computeControlLaw();
    if (task_.getTaskRank() != kCArmJointCount || qdot.size() != kCArmJointCount) return std::nullopt;
    CArmJoints result;
    for (int i = 0; i < kCArmJointCount; ++i) result[i] = qdot[static_cast<unsigned>(i)];
    if (!result.allFinite()) return std::nullopt;
    return result;
  }

 private:
  vpFeatureTranslation translation_, desired_translation_;
  vpFeatureThetaU theta_u_, desired_theta_u_;
  vpServo task_;
};

}  // namespace

std::unique_ptr<ServoLaw> make(const PositionBasedSettings& settings) {
  checkSettings(PositionBasedSettings::kName, settings);
  return std::make_unique<PositionBased>(settings);
}

}  // namespace angio
