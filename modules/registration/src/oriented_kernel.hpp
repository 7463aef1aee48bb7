// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>

#include "angio/registration/registration.hpp"

namespace angio::registration {

/// Oriented kernel fields with many starts, and a point-to-line polish from image to model.
std::unique_ptr<Registration> make(const OrientedKernelSettings& settings, const VesselTree& tree);

}  // namespace angio::registration
