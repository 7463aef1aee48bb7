// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <visp3/core/vpHomogeneousMatrix.h>
#include <visp3/core/vpMatrix.h>

#include <memory>
#include <optional>
#include <string>
#include <variant>

#include "angio/geometry/carm.hpp"
#include "angio/servo/position_based_settings.hpp"

namespace angio {

/// Turns where the anatomy is seen and where it should be seen into joint velocities. Eye-in-hand: the camera is on the
/// arm.
class ServoLaw {
 public:
  virtual ~ServoLaw() = default;

  /// Joint velocities [rad/s, m/s] before any limit.
  ///
  /// @param cMo   Pose of the model in the camera, as seen. @param cdMo  The same as desired. [m]
  /// @param eJe   6 x 5: velocity of the camera relative to the patient, camera frame, by joint velocity.
  ///
  /// Nothing comes back when the task is singular or a number is not finite: ViSP would hand out a NaN without a word.
  virtual std::optional<CArmJoints> velocity(const vpHomogeneousMatrix& cMo, const vpHomogeneousMatrix& cdMo,
                                             const vpMatrix& eJe) = 0;
};

/// The settings type is the choice of the law.
using ServoLawSettings = std::variant<PositionBasedSettings>;

/// Throws InputError when a setting is out of its range.
std::unique_ptr<ServoLaw> makeServoLaw(const ServoLawSettings& settings);

}  // namespace angio
