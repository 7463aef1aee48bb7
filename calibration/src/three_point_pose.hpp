// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/calibration/namespace.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::calibration {

/// Poses in which three points are seen along three directions (P3P), for a phantom that is less deep than its distance
/// from the source: the third point's distance is between half of the first's and twice it. A search
/// calls it some hundred thousand times: it allocates nothing once `poses` has grown, which OpenCV's solvers do.
///
/// @param points_m  One a column, not in a line. @param rays  Unit directions, one a column, in the camera's frame.
/// @param poses  What is found is put here; it is empty where nothing is.
/// Source: Haralick et al., Review and analysis of solutions of the three point perspective pose estimation problem,
/// IJCV 13 (1994), Grunert's solution.
void threePointPoses(const Eigen::Matrix3d& points_m, const Eigen::Matrix3d& rays, std::vector<Pose>& poses);

}  // namespace angio::calibration
