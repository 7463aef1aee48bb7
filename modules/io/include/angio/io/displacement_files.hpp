// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <string>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// Reads displacements of a tree's points (CSV: id,dx_mm,dy_mm,dz_mm), one row per point in the order of the tree file.
/// Returns 3 x `points` [m], model axes. Throws InputError that names file, line, field, value and rule.
Eigen::Matrix3Xd readDisplacements(const std::string& path, int points);

/// Writes them, with ids from 0.
void writeDisplacements(const std::string& path, const Eigen::Matrix3Xd& displacements_m);

}  // namespace angio::io
