// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "angio/volume/repairs.hpp"

namespace angio::volume {

/// Triangles of one surface. Corners are numbers of points.
struct TriangleMesh {
  std::vector<Eigen::Vector3d> points_mm;
  std::vector<std::array<int, 3>> triangles;
};

/// The pieces of a surface, each without holes: a ray through it crosses it an even number of times.
struct ClosedShells {
  std::vector<TriangleMesh> shells;  ///< The largest first.
  std::vector<Repair> repairs;       ///< Places in the axes of the points.
};

/// Closes a surface:
/// - Points nearer than `tolerance_mm` become one; triangles without area, and those given before, are dropped.
/// - Triangles that share edges are a shell.
/// - Edges with an odd number of triangles, the borders of holes, are joined to the centre of their border by a fan: a
///   flat lid where the border is plane. The rim of an inner wall, with three, is one of them: the fan and the inner
///   wall cancel out.
///
/// Normals are not used; those that disagree are reported. Returns no shell when no triangle has an area.
ClosedShells closedShells(const TriangleMesh& surface, double tolerance_mm);

}  // namespace angio::volume
