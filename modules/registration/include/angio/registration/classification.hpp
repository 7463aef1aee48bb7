// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/registration/result.hpp"

namespace angio::registration {

/// Returns whether model and image explain each other as well as a converged result requires, whatever the covariance
/// leaves open.
///
/// True for every converged result that was not accepted for want of alternatives alone. A result that is explained and
/// not converged may be used by a caller that gates on the covariance itself: one view of a deformed tree determines
/// where the tree is across the beam, and leaves its depth open.
bool explained(const RegistrationResult& result);

}  // namespace angio::registration
