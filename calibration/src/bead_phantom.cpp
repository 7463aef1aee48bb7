// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/bead_phantom.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "angio/base/errors.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/yaml.hpp"
#include "bead_symmetry.hpp"

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
  for (std::size_t i = 0; i < beads.size(); ++i) positions.col(i) = beads[i].position_m;
  return positions;
}

Eigen::Vector3d BeadPhantom::center_m() const { return positions_m().rowwise().mean(); }

bool BeadPhantom::isPlanar() const {
  const Eigen::Matrix3Xd centered = positions_m().colwise() - center_m();
  const Eigen::Vector3d spread = eigenOfSymmetric(centered * centered.transpose()).values;
  return spread[0] < 1e-6 * spread[2];
}

BeadPhantom helixPhantom(const HelixPhantomSettings& settings) {
  BeadPhantom phantom;
  phantom.name = "helix";
  for (int i = 0; i < settings.beads; ++i) {
    const double part = static_cast<double>(i) / (settings.beads - 1);
    const double angle_rad = 2 * kPi * settings.turns * part, r_m = 1e-3 * settings.radius_mm;
    const double diameter_mm = kCode[i] == 'L' ? settings.large_diameter_mm : settings.small_diameter_mm;
    phantom.beads.push_back(
        {{r_m * std::cos(angle_rad), r_m * std::sin(angle_rad), 1e-3 * settings.height_mm * (part - 0.5)},
         0.5e-3 * diameter_mm});
  }
  return phantom;
}

namespace {

constexpr std::size_t kMinPhantomBeads = 8, kMinPoints = 4, kMaxBeads = 2000;
constexpr double kFarthest_mm = 1000, kMinExtent_mm = 10;
constexpr double kThinnest_mm = 0.2, kThickest_mm = 20;
constexpr double kIndistinct_m = 0.5e-3;

void requireOwnPlaces(const YamlField& list, const BeadPhantom& phantom) {
  const Eigen::Matrix3Xd centered = phantom.positions_m().colwise() - phantom.center_m();
  if (1e3 * centered.colwise().norm().maxCoeff() < kMinExtent_mm) {
    list.refuse("must spread over more than 10 mm: are these metres?");
  }
  for (std::size_t i = 0; i < phantom.beads.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const Bead &a = phantom.beads[j], &b = phantom.beads[i];
      if ((a.position_m - b.position_m).norm() > a.radius_m + b.radius_m) continue;
      list.item(i).refuse(phantom.isCoded() ? "must not touch bead " + std::to_string(j)
                                            : "must not be the place of point " + std::to_string(j));
    }
  }
}

void requireDistinct(const YamlField& list, const BeadPhantom& phantom) {
  if (phantom.isPlanar()) list.refuse("must not lie in one plane: its images do not tell front from back");
  const std::vector<PhantomSymmetry> symmetries = symmetriesOf(phantom, kIndistinct_m, 2);
  if (symmetries.size() < 2) return;
  const PhantomSymmetry& symmetry = symmetries[1];
  int bead = 0;
  while (symmetry.image[bead] == bead) ++bead;
  list.refuse("must tell its beads apart: " + std::string(symmetry.mirrors ? "mirrored" : "turned") + ", bead " +
              std::to_string(bead) + " stands where bead " + std::to_string(symmetry.image[bead]) + " stood");
}

}  // namespace

BeadPhantom readBeadPhantom(const std::string& path) {
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "phantom");
  BeadPhantom phantom;
  phantom.name = map.need("name").text();
  const auto points = map.find("points");
  const YamlField list = points ? *points : map.need("beads");
  map.refuseOthers();
  const std::size_t fewest = points ? kMinPoints : kMinPhantomBeads;
  const std::string rule = "must be a list of " + std::to_string(fewest) + " to " + std::to_string(kMaxBeads);
  for (const YamlField& item : list.items(rule, fewest, kMaxBeads)) {
    const std::vector<double> mm = item.numbers(points ? 3 : 4);
    for (int k = 0; k < 3; ++k) requireBetween(item.place(), item.key, mm[k], -kFarthest_mm, kFarthest_mm);
    if (!points) requireBetween(item.place(), item.key + " diameter_mm", mm[3], kThinnest_mm, kThickest_mm);
    phantom.beads.push_back({1e-3 * Eigen::Vector3d(mm[0], mm[1], mm[2]), points ? 0 : 0.5e-3 * mm[3]});
  }
  requireOwnPlaces(list, phantom);
  if (!points) requireDistinct(list, phantom);
  return phantom;
}

void writeBeadPhantom(const std::string& path, const BeadPhantom& phantom) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Bead& bead : phantom.beads) {
    nlohmann::ordered_json row = {1e3 * bead.position_m.x(), 1e3 * bead.position_m.y(), 1e3 * bead.position_m.z()};
    if (phantom.isCoded()) row.push_back(2e3 * bead.radius_m);
    list.push_back(row);
  }
  writeWholeFile(path, asYaml({{"name", phantom.name}, {phantom.isCoded() ? "beads" : "points", list}}));
}

}  // namespace angio::calibration
