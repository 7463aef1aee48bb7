// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/bead_phantom.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "angio/base/errors.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/yaml.hpp"

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

// Another bead that stands where a bead comes to stand when the phantom is turned or mirrored onto itself.
struct BeadSymmetry {
  int bead = 0, image = 0;
  bool mirrors = false;
};

using Triple = std::array<int, 3>;

// A right-handed frame on three points, or a left-handed one.
Eigen::Isometry3d frameOn(const BeadPhantom& phantom, const Triple& t) {
  const auto at = [&](int i) { return phantom.beads[t[i]].position_m; };
  const Eigen::Vector3d x = (at(1) - at(0)).normalized(), z = x.cross(at(2) - at(0)).normalized();
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
  frame.linear() << x, z.cross(x), z;
  frame.translation() = at(0);
  return frame;
}

// Looks for the first movement, or mirroring, that puts every bead within a tolerance of one of its size; there is none
// if nothing does but to leave the phantom where it is.
class SymmetrySearch {
 public:
  SymmetrySearch(const BeadPhantom& phantom, double tolerance_m) : phantom_(phantom), tolerance_m_(tolerance_m) {}

  std::optional<BeadSymmetry> find() const {
    const Triple base = baseTriple();
    const Eigen::Isometry3d from = frameOn(phantom_, base);
    const double d01 = distance(base[0], base[1]), d02 = distance(base[0], base[2]), d12 = distance(base[1], base[2]);
    const int count = static_cast<int>(phantom_.beads.size());
    for (int i = 0; i < count; ++i) {
      if (!sameSize(i, base[0])) continue;
      for (int j = 0; j < count; ++j) {
        if (j == i || !sameSize(j, base[1]) || !near(distance(i, j), d01)) continue;
        for (int k = 0; k < count; ++k) {
          if (k == i || k == j || !sameSize(k, base[2])) continue;
          if (!near(distance(i, k), d02) || !near(distance(j, k), d12)) continue;
          const Eigen::Isometry3d to = frameOn(phantom_, {i, j, k});
          for (const bool mirrors : {false, true}) {
            if (!mirrors && i == base[0] && j == base[1] && k == base[2]) continue;
            Eigen::Matrix3d flip = Eigen::Matrix3d::Identity();
            if (mirrors) flip(2, 2) = -1;
            const Eigen::Matrix3d A = to.linear() * flip * from.linear().transpose();
            if (const auto found = movedOnto(A, to.translation() - A * from.translation(), mirrors)) return found;
          }
        }
      }
    }
    return std::nullopt;
  }

 private:
  // Three beads far from each other and from a line, so that their place says where all others are.
  Triple baseTriple() const {
    const int count = static_cast<int>(phantom_.beads.size());
    const auto farthest = [&](const auto& measure) {
      int best = 0;
      for (int i = 1; i < count; ++i) {
        if (measure(i) > measure(best)) best = i;
      }
      return best;
    };
    Triple base{};
    base[0] = farthest([&](int i) { return (position(i) - phantom_.center_m()).norm(); });
    base[1] = farthest([&](int i) { return distance(i, base[0]); });
    const Eigen::Vector3d axis = (position(base[1]) - position(base[0])).normalized();
    base[2] = farthest([&](int i) { return axis.cross(position(i) - position(base[0])).norm(); });
    return base;
  }

  const Eigen::Vector3d& position(int i) const { return phantom_.beads[i].position_m; }
  double distance(int i, int j) const { return (position(i) - position(j)).norm(); }
  bool near(double a, double b) const { return std::abs(a - b) < 2 * tolerance_m_; }
  bool sameSize(int i, int j) const {
    const double a = phantom_.beads[i].radius_m;
    const double b = phantom_.beads[j].radius_m;
    return std::abs(a - b) <= 0.2 * std::max(a, b);  // What an image cannot tell apart for sure.
  }

  // Where the movement puts each bead onto one of its size, and some bead onto another.
  std::optional<BeadSymmetry> movedOnto(const Eigen::Matrix3d& A, const Eigen::Vector3d& t, bool mirrors) const {
    const int count = static_cast<int>(phantom_.beads.size());
    std::optional<BeadSymmetry> moved;
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3d p = A * position(i) + t;
      int image = -1;
      for (int j = 0; j < count && image < 0; ++j) {
        if ((position(j) - p).squaredNorm() < tolerance_m_ * tolerance_m_ && sameSize(i, j)) image = j;
      }
      if (image < 0) return std::nullopt;
      if (image != i && !moved) moved = BeadSymmetry{i, image, mirrors};
    }
    return moved;
  }

  const BeadPhantom& phantom_;
  double tolerance_m_;
};

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
  const auto symmetry = SymmetrySearch(phantom, kIndistinct_m).find();
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
