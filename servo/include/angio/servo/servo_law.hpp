// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <visp3/core/vpHomogeneousMatrix.h>
#include <visp3/core/vpMatrix.h>

#include <memory>
#include <optional>
#include <variant>

#include "angio/base/settings.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/servo/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::servo {

/// How fast a law takes its error away: the error decays as exp(-lambda t) while no limit binds. lambda may grow
/// towards the goal (ViSP's vpAdaptiveGain), where it no longer asks for more than the arm can do:
///
///     lambda(x) = lambda_per_s + (lambda_at_goal_per_s - lambda_per_s) exp(-x / gain_change_deg)
///
/// with x the angle between the beams plus the angle under which the source sees the target's error, so that the same
/// numbers mean the same for every law.
struct ServoGain {
  double lambda_per_s = 1.5;
  double lambda_at_goal_per_s = 3;
  double gain_change_deg = 3;

  void visit(SettingsVisitor& v) {
    v.number("lambda_per_s", lambda_per_s, 0.01, 20, "Gain far from the goal");
    v.number("lambda_at_goal_per_s", lambda_at_goal_per_s, 0.01, 20, "Gain at the goal");
    v.number("gain_change_deg", gain_change_deg, 1e-3, 180,
             "Distance from the goal over which the gain grows to lambda_at_goal_per_s");
  }
};

/// Joint space: s = the joints, s* = the joints of the goal as the image shows it. All joints go in proportion: the
/// table goes straight from start to goal, and the target's distance from its goal falls all the time.
struct JointSpaceSettings : ServoGain {
  static constexpr const char* kName = "joint_space";
};

/// Position-based visual servoing: s = (cdtc, theta u of cdRc), s* = 0. The camera goes straight in its own frame; the
/// table, which has to make up for the arm's turn, may leave by centimetres what start and goal span.
struct PositionBasedSettings : ServoGain {
  static constexpr const char* kName = "position_based";
};

/// Image-based visual servoing: s are the images of points on the tree's centreline, with the depths that the
/// registration gives them.
struct ImageBasedSettings : ServoGain {
  static constexpr const char* kName = "image_based";

  static constexpr int samples = 40;  ///< Points along the centreline, spread well.
  static constexpr double max_step_deg =
      30;  ///< A goal further away is taken in steps of so much: images know only their like.

  void visit(SettingsVisitor& v) { ServoGain::visit(v); }
};

/// 2 1/2 D visual servoing: s = (the target's image x, y; log(Z / Z*); theta u of cdRc). The target goes straight to
/// its place in the image, whatever the rotation does.
struct HybridSettings : ServoGain {
  static constexpr const char* kName = "hybrid";
};

/// Where the anatomy is seen and where it should be seen.
struct LawInput {
  vpHomogeneousMatrix cMo;   ///< Pose of the model in the camera, as seen [m].
  vpHomogeneousMatrix cdMo;  ///< The same as desired.
  vpMatrix eJe;              ///< 6 x 5: velocity of the camera relative to the patient, camera frame, by joints'.
  const XrayCamera* camera = nullptr;  ///< Whose detector bounds what is in view; without one all is. Borrowed.
  std::optional<CArmJoints> joints_left = std::nullopt;  ///< From the arm's joints to the goal's. For joint_space.
};

/// Turns a LawInput into joint velocities. Eye-in-hand: the camera is on the arm.
///
/// A C-arm without detector rotation cannot turn its image about the beam. So every law takes the desired image turned
/// about its beam to where the seen one is, once the beams are brought together along the shortest rotation: a roll
/// that no joint mends is no error, and costs neither the view's direction nor the target's place.
class ServoLaw {
 public:
  virtual ~ServoLaw() = default;

  /// Joint velocities [rad/s, m/s] before any limit.
  ///
  /// Nothing comes back when the task is singular, a number is not finite, what the law needs is missing, or a point
  /// that matters lies behind the source: ViSP would hand out a NaN without a word, or throw.
  virtual std::optional<CArmJoints> velocity(const LawInput& input) = 0;
};

/// What a law may need to know of the anatomy.
struct LawModel {
  const VesselTree* tree = nullptr;       ///< Borrowed while the law is made, no longer. For image_based.
  std::optional<Eigen::Vector3d> target;  ///< The point that matters [m], model frame. For hybrid.
};

/// The settings type is the choice of the law.
using ServoLawSettings = std::variant<JointSpaceSettings, PositionBasedSettings, ImageBasedSettings, HybridSettings>;

/// Throws InputError when a setting is out of its range or what the law needs of the model is missing.
std::unique_ptr<ServoLaw> makeServoLaw(const ServoLawSettings& settings, const LawModel& model = {});

}  // namespace angio::servo
