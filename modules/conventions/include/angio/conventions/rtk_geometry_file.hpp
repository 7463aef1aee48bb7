// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/conventions/rtk.hpp"

namespace angio::conventions {

/// Reads RTK's geometry file (RTKThreeDCircularGeometry, versions 2 and 3): its projections in their order.
///
/// As in RTK's own reader a number holds from where it stands to where it stands again, and a Matrix must be that of
/// the numbers within 0.001. Collimation is passed over: it hides what is beside it and moves nothing. Throws
/// InputError that names file, projection, element and rule; also for a cylindrical detector and for elements that RTK
/// does not have.
std::vector<RtkProjection> readRtkGeometry(const std::string& path);

/// Writes what readRtkGeometry and RTK read, with the matrices: a number that all projections share stands once, and
/// one that is zero in all is left out. Throws InputError when there is no projection, a number is not finite or the
/// file cannot be written.
void writeRtkGeometry(const std::string& path, const std::vector<RtkProjection>& projections);

}  // namespace angio::conventions
