// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/cli/command_line.hpp"
#include "camera_tables.hpp"

namespace angio::apps {

/// What `angio-calibrate camera` is told of pictures of a phantom of equal beads.
struct PictureOptions {
  std::vector<std::string> pictures, grids, known_beads, near, out, out_poses, mayacam;
  std::string phantom, phantom_unit, grid_shape = "hexagonal", relative, report, plates = "found";
  double plate_tolerance_mm = 0.3;
  bool mirrored = false, any_reading = false;
};

void addPictureOptions(cli::Command& command, PictureOptions& options);

/// Ends the reading of the command line for options that do not go together.
void checkPictureOptions(const PictureOptions& options, const std::vector<std::string>& pictures,
                         const std::vector<std::string>& out);

/// Calibrates one camera of all pictures, or with as many grids as pictures a camera of each.
int runPictures(const PictureOptions& options, const CameraSections& settings);

}  // namespace angio::apps
