// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/localisation/catheter_localiser.hpp"

namespace angio::localisation {

/// The tip's end in 3D, model frame [m]: the point on the ray through the seen tip that is nearest to the believed
/// place on the vessel's axis. A catheter leans on the wall of a wide vessel; the image shows how far, but for what it
/// leans along the beam. The place on the axis itself comes back when the image does not tell which end is the tip.
Eigen::Vector3d tipOnRay(const TipPlace& place, const SeenCatheter& seen, const SeenPose& pose);

}  // namespace angio::localisation
