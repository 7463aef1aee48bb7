// SPDX-License-Identifier: GPL-2.0-or-later
// How do I get ViSP's cMo when the start is only roughly known, and know whether to trust it? By the default methods.
//
// usage: example-09-search tree.csv camera.yaml image.png start.yaml
#include <iostream>
#include <stdexcept>

#include "angio/geometry/visp.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/registration/registration.hpp"

int main(int argc, char** argv) try {
  if (argc != 5) return std::cerr << "usage: " << argv[0] << " tree camera image start\n", 2;

  using namespace angio;
  const vessel::VesselTree tree = io::readVesselTree(argv[1]);
  const geometry::XrayCamera camera = io::readCamera(argv[2]);
  const cv::Mat image = io::readXrayImage(argv[3]);
  const geometry::Pose start = io::readPose(argv[4]).T_camera_model;

  const auto extractor = imaging::makeExtractor(imaging::RidgeSettings{});  // Once per stream of images.
  const auto method = registration::makeRegistration(registration::OrientedKernelSettings{}, tree);  // Once per tree.

  const registration::RegistrationResult seen =  // Once per frame.
      method->search(extractor->extract(image), camera, {start, {}}, registration::StartSettings{});
  if (seen.status != registration::RegistrationStatus::kConverged) throw std::runtime_error(seen.reason);

  const vpHomogeneousMatrix cMo = geometry::toVisp(seen.T_camera_model);  // From here on it is ViSP.
  std::cout << cMo << "\n";
  return 0;
} catch (const std::exception& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
