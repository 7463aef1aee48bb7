// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/calibration/anatomy_registration.hpp"
#include "angio/calibration/carm_files.hpp"
#include "angio/io/case_files.hpp"
#include "angio/registration/oriented_kernel_settings.hpp"
#include "angio/results/case_run.hpp"

namespace angio::apps {

/// What T_dsa_cb is calibrated by: a case set of registered runs, and how its poses are searched.
struct AnatomyAsked {
  std::string cases;   ///< Path of the case set; each case's first view is used.
  std::string angles;  ///< Path; empty: angles.yaml beside the case set, or those of DICOM images.
  std::string carm;    ///< Path of a C-arm file; empty: the angles say how far source and isocentre are apart.
  std::string run;     ///< Whose T_dsa_cb is written, its shift included; empty: the runs' mean.
  std::string method = OrientedKernelSettings::kName;
  double search_rotation_deg = 10, search_translation_mm = 30;  ///< About the initial poses.
  bool refine = true;                                           ///< Jointly on the image points of all views.
  AnatomyRegistrationSettings settings;
};

/// A case set with what the C-arm said of its views.
struct AnatomyCases {
  CaseSet set;
  VesselTree tree;
  AnatomyAngleSet angles;
  std::optional<CArmFile> carm;
  std::vector<std::string> input_paths;
};

/// Reads all of it. Throws InputError for cases of several trees or without angles.
AnatomyCases readAnatomyCases(const AnatomyAsked& asked);

/// The views that took part, in one order; a view from a centreline has no image.
struct SeenViews {
  std::vector<AnatomyView> views;
  std::vector<SeenAnatomy> seen;
  std::vector<std::optional<std::string>> image_paths;
};

/// Every case as registered, and those of them that take part.
struct RegisteredAnatomy {
  std::vector<CaseOutcome> outcomes;
  SeenViews seen;
  std::string left_out;  ///< The others by name, and why; empty: there are none.
};

/// Registers each case by itself. After an interruption those that are finished.
RegisteredAnatomy registerViews(const AnatomyCases& cases, const AnatomyAsked& asked, const Progress& progress = {});

/// T_dsa_cb by these views: registerAnatomy(), and refineAnatomy() where it is asked for.
AnatomyResult anatomyOf(const SeenViews& seen, const VesselTree& tree, const AnatomyAsked& asked);

/// A view left out, and T_dsa_cb made of the others alone.
struct LeftOutView {
  std::string name;
  double rotation_rad = 0;  ///< The view's rotation as registered from how T_dsa_cb predicts it.
  double moved_rad = 0;     ///< T_dsa_cb from that of all views.
};

/// Each view left out in turn. `all` is the result with all of them.
std::vector<LeftOutView> leaveOneOut(const AnatomyResult& all, const SeenViews& seen, const VesselTree& tree,
                                     const AnatomyAsked& asked);

/// T_dsa_cb of the run that is asked for, its shift included, or the runs' mean. Throws InputError for another run.
Pose patientOf(const AnatomyResult& result, const AnatomyAsked& asked);

/// Writes the result and its record, whole or not at all: the C-arm's file with T_dsa_cb, or without one T_dsa_cb and
/// the runs' shifts. Throws InputError for a C-arm file of another machine than the angles'.
void writeAnatomy(const std::string& path, const AnatomyCases& cases, const AnatomyAsked& asked,
                  const AnatomyResult& result);

}  // namespace angio::apps
