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
  double slope = 0;  ///< Sideways way of the tip for each metre of its length.
  double sigma = 1;  ///< Standard deviation of that.
  /// The direction in which it is positive, in the vessel's frame at the tip: components `across` and `aside`. Shorter
  /// than 1: what is deflected along the beam is not seen.
  Eigen::Vector2d observable_axis = Eigen::Vector2d::Zero();
};

/// Measures how the last `tip_length_m` [m] of a seen catheter deflection against the image of the vessel that they are
/// in.
///
/// Nothing comes back when the vessel points too much along the beam, when the tip is behind the source, or when the
/// curve is too short or does not say which end is its tip.
std::optional<TipDeflection> seenDeflection(const SeenCatheter& seen, const XrayCamera& camera,
                                            const Pose& T_camera_model, const TreeTopology& map,
                                            const TreeLocation& tip, double tip_length_m);

}  // namespace angio::navigation
