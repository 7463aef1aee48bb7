// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::imaging {

/// Returns which branches of the tree are wider in an image than the extractor looks for, how wide they are and which
/// setting says so, as one line; nothing when none is, or when the extractor takes vessels of any width.
///
/// A branch counts by the mean of its points' radii in the image [px]: those that are known and in front of the camera.
/// Branches have the numbers of VesselTree::branches(), which angio-inspect --picture shows.
std::optional<std::string> tooWideVessels(const VesselTree& tree, const XrayCamera& camera, const Pose& T_camera_model,
                                          const ExtractorSettings& extractor);

}  // namespace angio::imaging
