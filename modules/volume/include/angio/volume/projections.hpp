// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>

#include "angio/vessel/vessel_tree.hpp"
#include "angio/volume/volume.hpp"

namespace angio::volume {

/// Three pictures side by side, one along each axis of the volume: its largest values around the tree, and the tree on
/// them (colour by branch, a dot at each root). CV_8UC3.
cv::Mat drawProjections(const Volume& volume, const VesselTree& tree);

}  // namespace angio::volume
