// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate: K, the C-arm's geometry and T_dsa_cb, each with its uncertainty.
#include "angio/campaign/program.hpp"
#include "calibrate.hpp"

int main(int argc, char** argv) {
  return angio::campaign::runCampaignProgram(
      {"angio-calibrate", "Calibrates an X-ray C-arm: camera, geometry, and where the pre-operative model lies in it.",
       "angio-calibrate simulate --out calibration\n"
       "  angio-calibrate camera calibration/camera/views.yaml --out camera.yaml\n"
       "  angio-calibrate geometry calibration/geometry/views.yaml --camera camera.yaml --out carm.yaml\n"
       "  angio-calibrate hand-eye calibration/hand-eye/poses.yaml --carm carm.yaml --out lab.yaml\n"
       "  angio-calibrate registration cases.yaml --carm carm.yaml --out lab.yaml",
       angio::apps::addCalibrateSimulate,
       [](auto& app, auto& work) {
         angio::apps::addCalibrateCamera(app, work);
         angio::apps::addCalibrateGeometry(app, work);
         angio::apps::addCalibrateHandEye(app, work);
         angio::apps::addCalibrateRegistration(app, work);
       }},
      argc, argv);
}
