// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/phantom_plates.hpp"

#include <algorithm>
#include <numeric>

#include "angio/geometry/decompositions.hpp"

namespace angio::calibration {
namespace {

constexpr double kSamePlate_m = 2e-3;  // Beads of one plate along the stack's axis; plates are thicker.
constexpr Eigen::Index kMinPlates = 2, kMaxPlates = 8;
constexpr int kMinBeadsOfPlate = 4;

}  // namespace

PhantomPlates platesAlong(const BeadPhantom& phantom, int axis, double tolerance_mm) {
  const Eigen::Matrix3Xd points_m = phantom.positions_m();
  std::vector<std::size_t> order(phantom.beads.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto along = [&](std::size_t bead) { return points_m(axis, static_cast<Eigen::Index>(bead)); };
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return along(a) < along(b); });
  PhantomPlates plates;
  plates.plate_of_bead.resize(order.size());
  std::vector<int> beads;
  for (std::size_t k = 0; k < order.size(); ++k) {
    if (k == 0 || along(order[k]) - along(order[k - 1]) > kSamePlate_m) beads.push_back(0);
    ++beads.back();
    plates.plate_of_bead[order[k]] = static_cast<int>(beads.size()) - 1;
  }
  plates.count = static_cast<Eigen::Index>(beads.size());
  const bool stacked = plates.count >= kMinPlates && plates.count <= kMaxPlates &&
                       *std::min_element(beads.begin(), beads.end()) >= kMinBeadsOfPlate;
  if (!stacked) return {};
  const Eigen::Index numbers = 3 * plates.count;
  plates.known.mean_mm = Eigen::VectorXd::Zero(numbers);
  plates.known.covariance_mm2 = tolerance_mm * tolerance_mm * Eigen::MatrixXd::Identity(numbers, numbers);
  return plates;
}

PlateShifts jointShifts(const PlateShifts& known, const PlateShifts& one, const PlateShifts& other) {
  // Normal densities multiply: informations add, and what both have from before counts once.
  Eigen::MatrixXd information = -inverseOfSymmetric(known.covariance_mm2);
  Eigen::VectorXd weighted = information * known.mean_mm;
  for (const PlateShifts* shifts : {&one, &other}) {
    const Eigen::MatrixXd own = inverseOfSymmetric(shifts->covariance_mm2);
    information += own;
    weighted += own * shifts->mean_mm;
  }
  PlateShifts joint;
  joint.covariance_mm2 = inverseOfSymmetric(information);
  joint.mean_mm = joint.covariance_mm2 * weighted;
  return joint;
}

}  // namespace angio::calibration
