// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "geometry_problem.hpp"

namespace angio {

/// Throws InputError for positions from which a C-arm's geometry cannot be known, whatever the images show: fewer than
/// 6 different ones, or a primary angle that hardly moves.
void requirePositions(const std::string& place, const std::vector<CArmJoints>& positions);

/// Frees what the positions can tell at this start, and says in words what they cannot, and why.
std::vector<std::string> freeObservable(GeometryProblem& problem, const GeometryModel& start, bool refines_camera);

/// Throws InputError when the views do not agree on one C-arm as well as `wide` allows: some of them, named, are
/// explained by another one, or joints explain nothing.
void requireOneMachine(const std::string& place, const GeometryProblem& problem, const GeometryModel& start,
                       const PoseScatter& wide);

}  // namespace angio
