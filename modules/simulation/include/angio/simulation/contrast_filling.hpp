// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/simulation/namespace.hpp"
#include "angio/simulation/patient_settings.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::simulation {

/// The random part of a filling.
struct FillingDraws {
  std::vector<int> emptying_order;  ///< The numbers of all branches, shuffled.
  double first_site = 0;            ///< Uniform in [0, 1): where the first injection site is.
};

/// Returns which branches of a tree contrast agent fills.
///
/// `settings.missing` empties branches at random. `settings.filled` fills what lies downstream of injection sites,
/// until that share of the length is filled: the first site is drawn in proportion to what it would fill, the others
/// are those nearest to it, all of them among the sites that do not fill more than is still wanted. Where none is left,
/// the nearest one's branches are filled in the order in which blood comes to them. A branch is filled as a whole.
///
/// @param length  Of each branch, in any one unit, for example as far as it is in view.
std::vector<bool> filledBranches(const VesselTree& tree, const std::vector<double>& length,
                                 const FillingSettings& settings, const FillingDraws& draws);

/// Returns 1 at the tree's points on filled branches, 0 at the others.
Eigen::VectorXd filledPoints(const VesselTree& tree, const std::vector<bool>& filled_branches);

}  // namespace angio::simulation
