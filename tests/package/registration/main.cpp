// SPDX-License-Identifier: GPL-2.0-or-later
// Registers points of a vessel ("x,y,z" [m] a line) with points in an X-ray image ("x,y" [px] a line) and prints the
// pose.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iterator>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/registration/registration.hpp"
#include "angio/vessel/centerline2d.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace {

template <int kRows>
Eigen::Matrix<double, kRows, Eigen::Dynamic> readPoints(const char* path) {
  std::ifstream file(path);
  std::string text{std::istreambuf_iterator<char>(file), {}};
  std::replace(text.begin(), text.end(), ',', ' ');
  std::istringstream words(text);
  const std::vector<double> numbers{std::istream_iterator<double>(words), {}};
  if (numbers.empty() || numbers.size() % kRows != 0) throw std::runtime_error(std::string("no points in ") + path);
  return Eigen::Map<const Eigen::Matrix<double, kRows, Eigen::Dynamic>>(numbers.data(), kRows,
                                                                        static_cast<int>(numbers.size() / kRows));
}

// One vessel: each point's parent is the one before it.
angio::vessel::VesselTree readTree(const char* path) {
  Eigen::Matrix3Xd points_m = readPoints<3>(path);
  std::vector<int> parents(static_cast<std::size_t>(points_m.cols()));
  std::iota(parents.begin(), parents.end(), -1);
  return {std::move(points_m), std::move(parents)};
}

angio::vessel::Centerline2d readCenterline(const char* path) {
  Eigen::Matrix2Xd points_px = readPoints<2>(path);
  std::vector<int> branch(static_cast<std::size_t>(points_px.cols()), 0);
  return angio::vessel::makeCenterline(std::move(points_px), std::move(branch));
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 3) return std::fprintf(stderr, "usage: %s tree.txt image.txt\n", argv[0]), 2;
  const angio::vessel::VesselTree tree = readTree(argv[1]);
  const angio::vessel::Centerline2d seen = readCenterline(argv[2]);
  const angio::geometry::XrayCamera camera = angio::geometry::XrayCamera::centered(1024, 1024, 0.0004, 1.0);
  angio::registration::PosePrior prior;
  prior.T_camera_model.translation().z() = 0.75;

  const auto registration = angio::registration::makeRegistration(angio::registration::OrientedKernelSettings{}, tree);
  const angio::registration::RegistrationResult result = registration->search(seen, camera, prior, {});
  const Eigen::Vector3d t_mm = 1e3 * result.T_camera_model.translation();
  const Eigen::Vector3d w_deg = angio::geometry::logSO3(result.T_camera_model.linear()) * angio::geometry::radToDeg(1);
  std::printf("%s: %.2f %.2f %.2f mm, %.3f %.3f %.3f deg\n", angio::registration::statusName(result.status).c_str(),
              t_mm.x(), t_mm.y(), t_mm.z(), w_deg.x(), w_deg.y(), w_deg.z());
  // The pose that image.txt was projected with, to 0.01 px. One view says least about depth.
  const Eigen::Vector3d wrong_mm = t_mm - Eigen::Vector3d(4, -3, 750);
  const Eigen::Vector3d wrong_deg = w_deg - Eigen::Vector3d(2, -3, 4);
  const bool right = wrong_mm.head<2>().norm() < 0.1 && std::abs(wrong_mm.z()) < 2 && wrong_deg.norm() < 0.1;
  return result.status == angio::registration::RegistrationStatus::kConverged && right ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
