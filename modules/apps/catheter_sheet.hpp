// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/io/case_files.hpp"
#include "angio/localisation/sequence_localiser.hpp"

namespace angio::apps {

/// One frame as one way of looking at the sequence sees it.
struct Located {
  TipBelief belief;
  Pose T_camera_model = Pose::Identity();
  double time_s = 0;  ///< Of this frame alone, where frames come one by one.
};

/// One way of looking at a sequence.
struct CatheterRoute {
  std::string name;
  std::vector<Located> frames;
  VesselTree tree;           ///< As displaced.
  std::vector<bool> learnt;  ///< Frames that pose and displacements were learnt from.
};

/// Frames in rows of `columns`, each cut to what all curves need and scaled to a width of `side_px`: the tree in grey,
/// the way from its root to the tip in green, the curve in red, the tip as a ring. CV_8UC3. Needs at least one frame.
cv::Mat catheterSheet(const CatheterRoute& way, const std::vector<SequenceFrame>& frames, const CaseSet& set,
                      int columns, int side_px);

}  // namespace angio::apps
