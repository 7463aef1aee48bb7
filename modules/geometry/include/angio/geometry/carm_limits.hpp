// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "angio/geometry/namespace.hpp"

namespace angio::geometry {

/// Joints of a C-arm with its table: primary and secondary angle [rad], table x, y, z [m]; velocities in rad/s, m/s.
using CArmJoints = Eigen::Matrix<double, 5, 1>;
constexpr int kCArmJointCount = 5;

/// What reports call the joints.
constexpr const char* kJointNames[kCArmJointCount] = {"primary", "secondary", "table x", "table y", "table z"};

/// Where the arm may be beyond the range of each single joint, so that detector, table and patient do not touch: a
/// convex region of joint space, cut out by faces `normal^T joints <= bound`. Without faces all is free.
struct CArmEnvelope {
  /// One half-space `normal^T joints <= bound` that the joints have to stay in.
  struct Face {
    std::string name;   ///< What would touch.
    CArmJoints normal;  ///< In the unit of `bound` by rad or m.
    double bound = 0;
    double room(const CArmJoints& joints) const { return bound - normal.dot(joints); }  ///< Negative: beyond it.
  };
  std::vector<Face> faces;

  /// The face that these joints are furthest beyond, or nothing when they lie within all.
  const Face* violated(const CArmJoints& joints) const;

  /// Of a C-arm whose detector's front is `isocentre_detector_m` from the isocentre, over a table 0.46 m wide:
  ///
  /// - detector and table's side: with its front at d, the detector at the primary angle p clears the edge of a table
  ///   of half width w, b below the isocentre and moved by x, while sin p (w + x) - cos p b <= d, that is
  ///   x <= d / sin p + b cot p - w. The right side is convex in p; a face must be linear and safe, so it is the
  ///   tangent at p = 90 deg: x + b (p - 90 deg) <= d - w, with b = 0.15 m, less 20 mm to keep; both sides alike.
  /// - detector and patient: the patient's front, 0.1 m over the isocentre, is raised by -y, and the tilted detector's
  ///   edge comes down with the secondary angle s: -y + 0.1 m |s| <= d - 0.1 m, less 20 mm.
  /// - arm and patient: the corners |p| + 2 |s| > 180 deg, where the arc comes in from the side over the head or feet.
  ///
  /// Numbers of a plausible machine, not of one that exists: measure your own. Throws InputError when the distance is
  /// not positive.
  static CArmEnvelope typical(double isocenter_detector_m);
};

/// Where a C-arm may be and how it may move: range, speed, acceleration and jerk of each joint, in the order and units
/// of CArmJoints, and the envelope of all.
struct CArmLimits {
  CArmJoints lower, upper, velocity, acceleration;
  CArmJoints jerk = CArmJoints::Constant(1e3);  ///< Of what is commanded [rad/s^3, m/s^3].
  CArmEnvelope envelope;

  /// A fast floor-mounted C-arm: +-120 deg / +-60 deg, 25 deg/s, 40 deg/s^2 and 160 deg/s^3; table +-0.3 m, 0.1 m/s,
  /// 0.2 m/s^2 and 0.8 m/s^3. No envelope: it depends on where the detector is.
  ///
  /// Ranges and speeds are of the size that makers' data sheets give. They give no jerk: full acceleration within a
  /// quarter of a second is what a gantry of half a tonne does without being heard.
  static CArmLimits typical();

  /// The same within CArmEnvelope::typical(), for a detector whose front is so far from the isocentre [m].
  static CArmLimits typical(double isocenter_detector_m);
};

}  // namespace angio::geometry
