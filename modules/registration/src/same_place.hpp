// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

namespace angio::registration {

/// Whether two deformed trees are one answer to the same views.
///
/// Across the beam they may be 3 mm apart (rms). Along it a single view tells a tree from the same with near and far
/// exchanged, and leaves the depth of the whole to the belief: there the whole may be shifted by anything, and what is
/// left may be as large as the relief of `here`; with near and far exchanged it is twice that. Several views tell the
/// depth: there the distance along the first view's beam may be three standard deviations.
///
/// @param here, there    The same points of both trees in the camera frame of the first view, 3 x N [m].
/// @param depth_std_m    What is claimed of the depth of `here`, rms over the tree; not asked of a single view.
bool isSamePlace(const Eigen::Matrix3Xd& here, const Eigen::Matrix3Xd& there, bool single_view, double depth_std_m);

}  // namespace angio::registration
