// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

namespace angio {

/// Where a joint should be after one more period of commands, and how much that matters.
struct PathPoint {
  double place;  ///< From where the joint is now [m or rad].
  double weight;
};

/// The velocity of a joint over the next period with which it follows a path best over all its points, changing its
/// velocity by no more than `most_change` a period: what it can not follow it goes through the middle of, and a far
/// point it comes to rest at. Box-constrained least squares by coordinate descent, the first step of a receding
/// horizon.
///
/// @param effort  Weight of squared changes, as the ways they make in a period, against squared distances.
double followingVelocity(const std::vector<PathPoint>& path, double velocity, double period_s, double most_change,
                         double effort);

}  // namespace angio
