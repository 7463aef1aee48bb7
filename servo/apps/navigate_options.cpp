// SPDX-License-Identifier: GPL-2.0-or-later
#include "navigate_options.hpp"
#include "angio/cli/program.hpp"

#include "angio/base/errors.hpp"
#include "angio/io/settings_files.hpp"

namespace angio::apps {

TreeLocation placeOf(const TreeTopology& map, const std::string& name, int branch, double mm) {
  if (branch < 0 || branch >= map.branchCount()) {
    throw InputError("--" + name + "-branch", "", std::to_string(branch),
                     "must be one of the tree's " + std::to_string(map.branchCount()) + " branches, from 0 on");
  }
  requireBetween("--" + name + "-mm", "of branch " + std::to_string(branch), mm, 0, 1e3 * map.length_m(branch));
  return {branch, 1e-3 * mm};
}

void NavigateSettings::visit(SettingsVisitor& v) {
  controller.visit(v);
  v.section("limits", [this](SettingsVisitor& s) { limits.visit(s); });
}

CArmSetup NavigateSettings::stage(const CArmCalibration& calibration) const {
  const CArmGeometry& carm = calibration.carm;
  return {carm, limits.limits(carm.source_detector_distance_m - carm.source_isocenter_distance_m), calibration.T_dsa_cb,
          calibration.R_lps_model};
}

NavigateSettings readNavigateSettings(const std::string& path) {
  NavigateSettings settings;
  if (path.empty()) return settings;
  settings = readSettings(path, settings);
  try {
    settings.limits.check();
  } catch (const InputError& error) {
    throw error.within(path);
  }
  return settings;
}

std::string navigateSettingsAsYaml(const std::string& path) { return settingsAsYaml(readNavigateSettings(path)); }

cli::Option* RouteOptions::addTo(cli::Command& app) {
  app.addOption("--from-branch", from_branch, "The branch that the catheter's tip is in at first")
      ->check(cli::wholeBetween(0, 1000000));
  app.addOption("--from-mm", from_mm, "How far into it, to a few millimetres")->check(between(0, 1500));
  app.addOption("--to-mm", to_mm, "How far into the branch to go to")->check(between(0, 1500));
  return app
      .addOption("--to-branch", to_branch, "The branch to go to; angio-inspect TREE --picture FILE shows the numbers")
      ->check(cli::wholeBetween(0, 1000000));
}

TreeLocation RouteOptions::start(const TreeTopology& map) const { return placeOf(map, "from", from_branch, from_mm); }

TreeLocation RouteOptions::target(const TreeTopology& map) const {
  if (!to_branch) throw InputError("command line", "--to-branch", "", "is needed");
  return placeOf(map, "to", *to_branch, to_mm);
}

}  // namespace angio::apps
