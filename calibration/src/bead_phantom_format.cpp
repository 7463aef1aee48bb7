// SPDX-License-Identifier: GPL-2.0-or-later
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/calibration/bead_phantom.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/yaml.hpp"
#include "bead_symmetry.hpp"

namespace angio::calibration {
namespace {

constexpr std::size_t kFewestBeads = 8, kFewestPoints = 4, kMaxBeads = 2000;
constexpr double kFarthest_mm = 1000, kSmallest_mm = 10;
constexpr double kThinnest_mm = 0.2, kThickest_mm = 20;
constexpr double kIndistinct_m = 0.5e-3;

void requireOwnPlaces(const YamlField& list, const BeadPhantom& phantom) {
  const Eigen::Matrix3Xd centered = phantom.positions_m().colwise() - phantom.center_m();
  if (1e3 * centered.colwise().norm().maxCoeff() < kSmallest_mm) {
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
  const auto symmetry = symmetryOf(phantom, kIndistinct_m);
  if (!symmetry) return;
  list.refuse("must tell its beads apart: " + std::string(symmetry->mirrors ? "mirrored" : "turned") + ", bead " +
              std::to_string(symmetry->bead) + " stands where bead " + std::to_string(symmetry->image) + " stood");
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
  const std::size_t fewest = points ? kFewestPoints : kFewestBeads;
  if (list.node->kind != YamlNode::Kind::kSequence || list.node->items.size() < fewest ||
      list.node->items.size() > kMaxBeads) {
    list.refuse("must be a list of " + std::to_string(fewest) + " to " + std::to_string(kMaxBeads));
  }
  for (std::size_t i = 0; i < list.node->items.size(); ++i) {
    const YamlField item = list.item(i);
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
