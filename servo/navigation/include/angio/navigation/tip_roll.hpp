// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/localisation/seen_catheter.hpp"
#include "angio/navigation/namespace.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::navigation {

/// How far a catheter's tip is deflected out of its vessel, as one X-ray frame shows it: the part across the vessel's
/// image.
struct TipDeflection {
  double slope = 0;  ///< Sideways displacement of the tip for each metre of its length.
  double sigma = 1;  ///< Standard deviation of that.
  /// The direction in which it is positive, in the vessel's frame at the tip: components `normal` and `binormal`.
  /// Shorter than 1: what is deflected along the beam is not seen.
  Eigen::Vector2d observable_axis = Eigen::Vector2d::Zero();
  double offset_m = 0;         ///< Of the tip's end beside the vessel's axis, in the same direction [m].
  double offset_std_m = 1e-3;  ///< Standard deviation of that [m].
};

/// Returns the deflection of the last `tip_length_m` [m] of a seen catheter against the image of the vessel that they
/// are in.
///
/// Returns nothing when the vessel points too much along the beam, when the tip is behind the source, or when the
/// curve is too short or does not say which end is its tip.
std::optional<TipDeflection> seenDeflection(const SeenCatheter& seen, const XrayCamera& camera,
                                            const Pose& T_camera_model, const TreeTopology& map,
                                            const TreeLocation& tip, double tip_length_m);

/// Estimates the direction of a bent tip for a given roll of its drive: zero, wind-up and backlash leave it unknown.
///
/// The tip is deflected by x = (p, q) in the vessel's frame when the drive's roll is 0, and by R(roll) x at any other.
/// The shaft behind it may cross the vessel: its slope b = (m, n) in the vessel's frame does not turn with the drive. A
/// frame measures y = observable_axis . (R(roll) x + b). The estimate is a linear Kalman filter over (p, q, m, n); its
/// row d y / d roll is the image Jacobian of roll. The dead band between drive and tip has a nominal width (a play
/// operator).
class TipRoll {
 public:
  /// @param deflection  How far tips are usually deflected, as a slope. @param dead_band_rad  Of roll, from one side to
  /// the other.
  TipRoll(double deflection, double dead_band_rad);

  /// The drive has rolled to `roll_rad`, and the tip has slid by `slid_m` [m] in the vessel.
  /// Call moveLoosely() instead for a tip between walls, which does not turn as its drive does.
  void move(double roll_rad, double slid_m);

  /// The same of a loose catheter: where its tip pointed is forgotten over the way that it slides and its drive rolls.
  void moveLoosely(double roll_rad, double slid_m);

  /// The drive has bent the tip: `deflection` is now its usual size, as in TipRoll(), positive. A tip that bends more
  /// may be deflected further, so that its deflection is less sure; one that bends less falls back in proportion.
  void bend(double deflection);

  /// Updates the estimate by one frame. Values beyond three standard deviations are clamped to those.
  void see(const TipDeflection& deflection);

  /// It has entered a branch that lies in this direction (in the vessel's frame: normal, binormal; any length).
  void entered(const Eigen::Vector2d& direction);

  /// Angle of the tip in the vessel's frame, from `normal` to `binormal` [rad].
  double angle_rad() const;

  /// Standard deviation of that angle [rad], at most that of a uniform one, pi / sqrt(3).
  double std_rad() const;

  /// How the tip is deflected in the vessel's frame: normal, binormal; sideways for each metre of its length.
  Eigen::Vector2d deflection() const { return turn() * state_.head<2>(); }

  /// Covariance of deflection().
  Eigen::Matrix2d deflectionCovariance() const { return turn() * P_.topLeftCorner<2, 2>() * turn().transpose(); }

  /// Where the tip points, its shaft's slope included: normal, binormal; sideways for each metre of its length.
  Eigen::Vector2d heading() const { return deflection() + state_.tail<2>(); }

  /// Covariance of heading().
  Eigen::Matrix2d headingCovariance() const;

 private:
  Eigen::Matrix2d turn() const;  // Of the tip, by the roll that has come through.

  double deflection_, half_band_rad_;
  double roll_rad_ = 0;  // Of the tip, as the dead band lets it.
  bool moved_ = false;
  Eigen::Vector4d state_ = Eigen::Vector4d::Zero();
  Eigen::Matrix4d P_;
};

}  // namespace angio::navigation
