// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/evaluation/simulation.hpp"

namespace angio::evaluation {

/// Which branches of a tree contrast agent fills in a trial.
///
/// `settings.missing` empties branches at random. `settings.filled` fills what lies downstream of injection sites,
/// until that share of the length is filled: the first site is drawn in proportion to what it would fill, the others
/// are those nearest to it, all of them among the sites that do not fill more than is still wanted. Where none is left,
/// the nearest one's branches are filled in the order in which blood comes to them. A branch is filled as a whole.
///
/// @param length  Of each branch, in any one unit, as far as it is in view.
std::vector<bool> filledBranches(const VesselTree& tree, const std::vector<double>& length,
                                 const SimulationSettings& settings, int trial);

/// 1 at the tree's points on filled branches, 0 at the others.
Eigen::VectorXd filledPoints(const VesselTree& tree, const std::vector<bool>& filled_branches);

}  // namespace angio::evaluation
