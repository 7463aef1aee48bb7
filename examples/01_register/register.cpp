// SPDX-License-Identifier: GPL-2.0-or-later
// How do I get ViSP's cMo from an X-ray image and a vessel tree?
//
// usage: example-01-register tree.csv camera.yaml image.png start.yaml
#include <cstdio>

#include "angio/geometry/visp.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/registration/registration.hpp"

int main(int argc, char** argv) try {
  if (argc != 5) return std::fprintf(stderr, "usage: %s tree camera image start\n", argv[0]), 2;
  const angio::vessel::VesselTree tree = angio::io::readVesselTree(argv[1]);
  const angio::geometry::XrayCamera camera = angio::io::readCamera(argv[2]);
  const cv::Mat image = angio::io::readXrayImage(argv[3]);
  const angio::geometry::Pose start = angio::io::readPose(argv[4]).T_camera_model;

  // Once per stream of images, and once per tree.
  const auto extractor = angio::imaging::makeExtractor(angio::imaging::OtsuSettings{});
  angio::registration::IterativePnpSettings method;
  method.prior = angio::registration::PriorForm::kCovariance;  // The start is known to 2 deg and 5 mm, not more.
  const auto registration = angio::registration::makeRegistration(method, tree);

  // Once per frame.
  const angio::registration::RegistrationResult seen =
      registration->align(extractor->extract(image), camera, {start, {}});
  std::printf("%s %s\n", angio::registration::statusName(seen.status).c_str(), seen.reason.c_str());
  if (seen.status != angio::registration::RegistrationStatus::kConverged) return 1;

  // From here on it is ViSP.
  const vpHomogeneousMatrix cMo = angio::geometry::toVisp(seen.T_camera_model);
  const vpCameraParameters cam = angio::geometry::toVisp(camera);
  std::printf("cMo =\n");
  for (unsigned r = 0; r < 4; ++r)
    std::printf("%10.6f %10.6f %10.6f %10.6f\n", cMo[r][0], cMo[r][1], cMo[r][2], cMo[r][3]);
  std::printf("px = %.3f, u0 = %.3f\n", cam.get_px(), cam.get_u0());
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
