// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "geometry_problem.hpp"

namespace angio {

/// Values, covariance, residuals and weak directions of a solved geometry.
CalibrationRecord geometryRecord(const GeometryProblem& problem, const GeometryModel& model);

/// Each view against the model.
std::vector<GeometryViewFit> geometryFits(const GeometryProblem& problem, const GeometryModel& model);

/// Views that were left out and beads that lie elsewhere, a line each.
std::vector<std::string> geometryDoubts(const GeometryProblem& problem);

}  // namespace angio
