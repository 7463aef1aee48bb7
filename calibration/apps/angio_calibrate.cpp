// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate: K, the C-arm's geometry and T_dsa_cb, each with its uncertainty.
#include "angio/cli/program.hpp"
#include "calibrate.hpp"

int main(int argc, char** argv) {
  CLI::App app("Calibrates an X-ray C-arm: camera, geometry, and where the pre-operative model lies in it.",
               "angio-calibrate");
  angio::describeProgram(
      app,
      "angio-calibrate simulate --out calibration\n"
      "  angio-calibrate camera calibration/camera/views.yaml --out camera.yaml\n"
      "  angio-calibrate geometry calibration/geometry/views.yaml --camera camera.yaml --out carm.yaml\n"
      "  angio-calibrate hand-eye calibration/hand-eye/poses.yaml --carm carm.yaml --out lab.yaml\n"
      "  angio-calibrate registration cases.yaml --carm carm.yaml --out lab.yaml");
  app.require_subcommand(1);
  angio::Work work;
  angio::addCalibrateCamera(app, work);
  angio::addCalibrateGeometry(app, work);
  angio::addCalibrateHandEye(app, work);
  angio::addCalibrateRegistration(app, work);
  angio::addCalibrateSimulate(app, work);
  return angio::runProgram(app, argc, argv, [&] { return work(); });
}
