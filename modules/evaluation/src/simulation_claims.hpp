// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "angio/evaluation/simulation.hpp"
#include "angio/results/case_run.hpp"

namespace angio::evaluation {

/// What a result claims of the places of the tree's points against where they truly are; nothing where it claims
/// nothing. Some hundred points are asked.
std::optional<CaseOutcome::Claim> claimOf(const VesselTree& tree, const RegistrationResult& result,
                                          const SimulatedTrial& trial);

bool isConverged(const CaseOutcome& outcome);

/// Converged, and more than one in twenty of the points is further off than three of its standard deviations.
bool isConvergedAndWrong(const CaseOutcome& outcome);

/// Whether claims hold where fits are poor as well as where they are good: the trials in quarters, by the score of the
/// fit, best first. Null where there are too few.
Json claimsByQuarter(const std::vector<CaseOutcome>& outcomes);

}  // namespace angio::evaluation
