// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <visp3/core/vpHomogeneousMatrix.h>
#include <visp3/core/vpMatrix.h>

#include <memory>
#include <optional>
#include <variant>

#include "angio/geometry/carm.hpp"
#include "angio/servo/hybrid_settings.hpp"
#include "angio/servo/image_based_settings.hpp"
#include "angio/servo/position_based_settings.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::servo {

/// Where the anatomy is seen and where it should be seen.
struct LawInput {
  vpHomogeneousMatrix cMo;   ///< Pose of the model in the camera, as seen [m].
  vpHomogeneousMatrix cdMo;  ///< The same as desired.
  vpMatrix eJe;              ///< 6 x 5: velocity of the camera relative to the patient, camera frame, by joints'.
  const XrayCamera* camera = nullptr;  ///< Whose detector bounds what is in view; without one all is. Borrowed.
};

/// Turns a LawInput into joint velocities. Eye-in-hand: the camera is on the arm.
///
/// A C-arm without detector rotation cannot turn its image about the beam. So every law takes the desired image turned
/// about its beam to where the seen one is, once the beams are brought together along the shortest way: a roll that no
/// joint mends is no error, and costs neither the view's direction nor the target's place.
class ServoLaw {
 public:
  virtual ~ServoLaw() = default;

  /// Joint velocities [rad/s, m/s] before any limit.
  ///
  /// Nothing comes back when the task is singular, a number is not finite, or a point that matters lies behind the
  /// source: ViSP would hand out a NaN without a word, or throw.
  virtual std::optional<CArmJoints> velocity(const LawInput& input) = 0;
};

/// What a law may need to know of the anatomy.
struct LawModel {
  const VesselTree* tree = nullptr;       ///< Borrowed while the law is made, no longer. For image_based.
  std::optional<Eigen::Vector3d> target;  ///< The point that matters [m], model frame. For hybrid.
};

/// The settings type is the choice of the law.
using ServoLawSettings = std::variant<PositionBasedSettings, ImageBasedSettings, HybridSettings>;

/// Throws InputError when a setting is out of its range or what the law needs of the model is missing.
std::unique_ptr<ServoLaw> makeServoLaw(const ServoLawSettings& settings, const LawModel& model = {});

}  // namespace angio::servo
