// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "catheter_results.hpp"

namespace angio::apps {

/// Frames in rows of `columns`, each cut to what all curves need and scaled to a width of `side_px`: the tree in grey,
/// the way from its root to the tip in green, the curve in red, the tip as a ring. CV_8UC3. Needs at least one frame.
cv::Mat catheterSheet(const CatheterRoute& way, const std::vector<SequenceFrame>& frames, const CaseSet& set,
                      int columns, int side_px);

}  // namespace angio::apps
