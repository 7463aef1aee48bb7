// SPDX-License-Identifier: GPL-2.0-or-later

#include <visp3/visual_features/vpFeatureDepth.h>
#include <visp3/visual_features/vpFeaturePoint.h>
#include <visp3/visual_features/vpFeatureThetaU.h>

#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/geometry/visp.hpp"
#include "visp_servo_law.hpp"

namespace angio::servo {
namespace {

class Hybrid final : public ServoLaw {
 public:
  Hybrid(const HybridSettings& settings, const LawModel& model)
      : target_(*model.target),
        theta_u_(vpFeatureThetaU::cdRc),
        desired_theta_u_(vpFeatureThetaU::cdRc),
        task_(settings, model.target) {
    task_.servo().addFeature(point_, desired_point_);
    task_.servo().addFeature(depth_);  // Towards log(Z / Z*) = 0.
    task_.servo().addFeature(theta_u_, desired_theta_u_, vpFeatureThetaU::selectTUx() | vpFeatureThetaU::selectTUy());
  }

  std::optional<CArmJoints> velocity(const LawInput& input) override {
    const auto goal = task_.goal(input);
    if (!goal) return std::nullopt;
    const Eigen::Vector3d p = task_.T_camera_model() * target_, pd = *goal * target_;
    point_.set_xyZ(p.x() / p.z(), p.y() / p.z(), p.z());
    desired_point_.set_xyZ(pd.x() / pd.z(), pd.y() / pd.z(), pd.z());
    depth_.buildFrom(p.x() / p.z(), p.y() / p.z(), p.z(), std::log(p.z() / pd.z()));
    theta_u_.buildFrom(toVisp(Pose(*goal * task_.T_camera_model().inverse())));
    return task_.velocity(input);
  }

 private:
  Eigen::Vector3d target_;
  vpFeaturePoint point_, desired_point_;
  vpFeatureDepth depth_;
  vpFeatureThetaU theta_u_, desired_theta_u_;
  VispServoLaw task_;  // Last: goes before the features that it holds.
};

}  // namespace

std::unique_ptr<ServoLaw> make(const HybridSettings& settings, const LawModel& model) {
  checkSettings(HybridSettings::kName, settings);
  if (!model.target) throw InputError(HybridSettings::kName, "target", "", "the law needs one");
  return std::make_unique<Hybrid>(settings, model);
}

}  // namespace angio::servo
