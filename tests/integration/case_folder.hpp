// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <gtest/gtest.h>

#include "angio/io/camera_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/program.hpp"
#include "angio/vessel/projection.hpp"

namespace angio::test {

/// The files of one clean case, for the programs: tree.csv, camera.yaml, centerline.csv, start.yaml and cases.yaml.
class CaseFolder : public testing::Test {
 protected:
  CaseFolder() {
    writeVesselTree(folder_.path("tree.csv"), tree_);
    writeCamera(folder_.path("camera.yaml"), camera_);
    writePose(folder_.path("start.yaml"), {perturbed(truth_, tree_, random_.twist(0.002, degToRad(1))), {}});
    writePose(folder_.path("truth.yaml"), {truth_, {}});
    writeCenterline(folder_.path("centerline.csv"), projectedCenterline(tree_, camera_, truth_));
    folder_.write("cases.yaml",
                  "tree: tree.csv\ncamera: camera.yaml\ncases:\n"
                  "  - {name: \"0001\", centerline: centerline.csv, initial_pose: start.yaml, truth_pose: truth.yaml}\n"
                  "  - {name: \"0002\", centerline: centerline.csv, initial_pose: truth.yaml}\n");
  }

  /// Arguments of angio-register for this case.
  std::vector<std::string> registerArguments() const {
    return {"--tree",         folder_.path("tree.csv"),    "--camera",     folder_.path("camera.yaml"),
            "--initial-pose", folder_.path("start.yaml"),  "--centerline", folder_.path("centerline.csv"),
            "--out",          folder_.path("result.json"), "--overlay",    folder_.path("overlay.png")};
  }

  TemporaryFolder folder_;
  Random random_{7};
  VesselTree tree_ = branchingTree(4);
  XrayCamera camera_ = clinicalCamera();
  Pose truth_ = viewOf(tree_, random_);
};

}  // namespace angio::test
