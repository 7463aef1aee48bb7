// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/io/case_files.hpp"
#include "angio/localisation/tip_belief.hpp"
#include "angio/vessel/vessel_tree.hpp"

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

/// Frame by frame: chain, arc length, how sure, residual, shift of the image at the tip's depth.
std::string catheterTable(const CatheterRoute& way, const CaseSet& set);

/// The frames' figures in a few lines of text, and as numbers.
struct CatheterSummary {
  std::string text;
  nlohmann::ordered_json numbers;
};
CatheterSummary catheterSummary(const CatheterRoute& way);

/// The frames as other programs read them.
nlohmann::ordered_json catheterAsJson(const CatheterRoute& way, const CaseSet& set);

/// How far two ways put the tip from each other, in one line.
std::string catheterComparison(const CatheterRoute& a, const CatheterRoute& b);

}  // namespace angio::apps
