// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/perception/namespace.hpp"
#include "angio/registration/result.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::perception {

/// Adds to the claims of a fit of these vessels to a catheter's curve what it cannot know: where the catheter lies in
/// its vessel, depth, which is as open as it was before the run, as vessels that bend make up for what a curve's size
/// would say of it, and how places beside these vessels are bent.
void addUnknowns(const VesselTree& vessels, RegistrationResult& fit);

}  // namespace angio::perception
