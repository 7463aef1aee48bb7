// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/command_line_fwd.hpp"
#include "angio/geometry/carm_limits_settings.hpp"
#include "angio/navigation/catheter_node.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::apps {

/// The place of a tree that two options --<name>-branch and --<name>-mm name. Throws InputError that names the option
/// when the tree has no such place.
TreeLocation placeOf(const TreeTopology& map, const std::string& name, int branch, double mm);

/// What a settings file may say: the controller's keys at the top, and the C-arm's limits.
struct NavigateSettings {
  CatheterControllerSettings controller;
  CArmLimitsSettings limits;

  void visit(SettingsVisitor& v);

  CArmSetup stage(const CArmCalibration& calibration) const;
};

/// A settings file's, or the usual ones when `path` is empty. Throws InputError that names the file.
NavigateSettings readNavigateSettings(const std::string& path);

/// The same as --print-settings prints them.
std::string navigateSettingsAsYaml(const std::string& path);

/// What a command line says of a catheter's way.
struct RouteOptions {
  int from_branch = 0;
  std::optional<int> to_branch;
  double from_mm = 30, to_mm = 10;

  /// Returns the option without which there is no way.
  cli::Option* addTo(cli::Command& app);

  /// Throw InputError that names the option when the tree has no such place, or the way has no end.
  TreeLocation start(const TreeTopology& map) const;
  TreeLocation target(const TreeTopology& map) const;
};

}  // namespace angio::apps
