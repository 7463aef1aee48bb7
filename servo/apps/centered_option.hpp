// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/command_line_fwd.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::apps {

/// Adds --t-dsa-cb centre, for simulations of trees that nobody has calibrated.
cli::Option* addCenteredOption(cli::Command& app, std::string& t_dsa_cb);

/// The calibration of a file for this tree; with `t_dsa_cb` as addCenteredOption() fills it the tree's centroid is at
/// the isocentre, and a line on standard error says so. Throws InputError for a calibration of another tree.
CArmCalibration readCalibration(const std::string& program, const std::string& file, const std::string& t_dsa_cb,
                                const VesselTree& tree);

}  // namespace angio::apps
