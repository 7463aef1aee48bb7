// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/cli/command_line_fwd.hpp"
#include "angio/io/xa_files.hpp"

namespace angio::apps {

/// A pose and a camera in the words of another program.
struct PoseToConvert {
  std::string convention;            ///< Empty: nothing is to be converted.
  std::string camera;                ///< Camera file, for files that do not say it.
  std::string model_axes = "LPS";    ///< LPS, RAS or world.
  std::vector<double> isocentre_mm;  ///< Three numbers, or none for the model's origin.
};

/// Adds --convert-pose of the option `file`, and what goes with it; call it after --json, --picture and --calibration.
void addConversionOptions(cli::Command& app, PoseToConvert& o, const cli::Option* file);

/// Converts the pose of `file`, its frame or projection `frame`, to `out`, or to stdout where that is empty, and writes
/// its camera to `write_camera` unless that is empty. Throws InputError that names what is wrong.
void convertPose(const PoseToConvert& o, const std::string& file, int frame, XaAngleSigns angle_signs,
                 const std::string& out, const std::string& write_camera);

/// Adds --write-urdf of the option `file`.
void addUrdfOption(cli::Command& app, std::string& out, const cli::Option* file);

/// Writes the C-arm of a C-arm file as a robot description, with the limits of a typical machine, and says on stderr
/// what a URDF cannot say of it. Throws InputError that names what is wrong.
void writeUrdf(const std::string& carm_file, const std::string& out);

}  // namespace angio::apps
