// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/bead_phantom.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>
#include <string_view>

#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::calibration {
namespace {

// Large and small in an order in which no run of 8 stands twice, in either direction, nor reads the same both ways;
// found by search. There are 240 such runs, so that a row of them has 127 beads at most.
constexpr std::string_view kCode =
    "LLLLLLLsLLLsssLsLsLsLLssssLsLssLLsssLsssssLLLssLsLLLssLLsLLLsLsLLsLLsssLLLLsLsLssLssLLsLsssLssLLLLLsLsssssss";
static_assert(kCode.size() == kMaxHelixBeads);

}  // namespace

Eigen::Matrix3Xd BeadPhantom::positions_m() const {
  Eigen::Matrix3Xd positions(3, beads.size());
  for (std::size_t i = 0; i < beads.size(); ++i) positions.col(static_cast<Eigen::Index>(i)) = beads[i].position_m;
  return positions;
}

Eigen::Vector3d BeadPhantom::center_m() const { return positions_m().rowwise().mean(); }

bool BeadPhantom::isPlanar() const {
  const Eigen::Matrix3Xd centered = positions_m().colwise() - center_m();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> spread(centered * centered.transpose());
  return spread.eigenvalues()[0] < 1e-6 * spread.eigenvalues()[2];
}

BeadPhantom helixPhantom(const HelixPhantomSettings& settings) {
  checkSettings("helix", settings);
  BeadPhantom phantom;
  phantom.name = "helix";
  for (int i = 0; i < settings.beads; ++i) {
    const double part = static_cast<double>(i) / (settings.beads - 1);
    const double angle_rad = 2 * kPi * settings.turns * part, r_m = 1e-3 * settings.radius_mm;
    const double diameter_mm =
        kCode[static_cast<std::size_t>(i)] == 'L' ? settings.large_diameter_mm : settings.small_diameter_mm;
    phantom.beads.push_back(
        {{r_m * std::cos(angle_rad), r_m * std::sin(angle_rad), 1e-3 * settings.height_mm * (part - 0.5)},
         0.5e-3 * diameter_mm});
  }
  return phantom;
}

BeadPhantom platePhantom(const PlatePhantomSettings& settings) {
  checkSettings("plate", settings);
  BeadPhantom phantom;
  phantom.name = "plate";
  const int side = settings.beads_per_side;
  const double pitch_m = 1e-3 * settings.width_mm / (side - 1);
  std::mt19937 engine(1);
  for (const int plate : {0, 1}) {
    const int count = side - plate;
    for (int i = 0; i < count * count; ++i) {
      const double x = pitch_m * (i % count - 0.5 * (count - 1)), y = pitch_m * (i / count - 0.5 * (count - 1));
      const bool large = engine() & 1U;
      phantom.beads.push_back({{x, y, 1e-3 * settings.distance_mm * (plate - 0.5)},
                               0.5e-3 * (large ? settings.large_diameter_mm : settings.small_diameter_mm)});
    }
  }
  return phantom;
}

}  // namespace angio::calibration
