// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/servo/best_view.hpp"

namespace angio::apps {

/// "LAO 23.4, CAU 10.1".
std::string inWords(const ViewAngles& angles);

/// Draws what each view of a segment costs, CV_8UC3: foreshortening, overlap and their weighted sum over primary angle
/// (to the right LAO) and secondary angle (up CRA), out of reach grey, the best view marked; and beside them the tree
/// from the front and in the best view, with the segment picked out.
cv::Mat viewMapPicture(const VesselTree& tree, const TreeSegment& segment, const BestView& best,
                       const BestViewScene& scene, double overlap_weight);

}  // namespace angio::apps
