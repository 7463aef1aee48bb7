// SPDX-License-Identifier: GPL-2.0-or-later
#include "centered_option.hpp"

#include <iostream>

#include "angio/calibration_records/centered_carm.hpp"
#include "angio/cli/program.hpp"

namespace angio::apps {

cli::Option* addCenteredOption(cli::Command& app, std::string& t_dsa_cb) {
  return app
      .addOption("--t-dsa-cb", t_dsa_cb,
                 "centre: of --calibration only the C-arm is taken. The tree's x, y, z are L, P, S of a patient head "
                 "first supine, its centroid is at the isocentre")
      ->check(cli::oneOf({kCentered}));
}

CArmCalibration readCalibration(const std::string& program, const std::string& file, const std::string& t_dsa_cb,
                                const VesselTree& tree) {
  if (t_dsa_cb.empty()) return readCArmCalibration(file, tree);
  std::cerr << program << ": assumed: " << kCenteredAssumption << "\n";
  return readCenteredCArm(file, tree.centroid());
}

}  // namespace angio::apps
