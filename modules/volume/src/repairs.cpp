// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/repairs.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "angio/base/formatted.hpp"
#include "angio/base/joined.hpp"

namespace angio::volume {
namespace {

struct FlawName {
  Flaw flaw;
  const char *key, *plural;
  const char* length;  // What of it the length is; empty where there is none.
};

constexpr FlawName kFlawNames[] = {{Flaw::kCycle, "cycle", "cycles", "round"},
                                   {Flaw::kSelfTouch, "self_touch", "vessels that touch themselves", "round"},
                                   {Flaw::kKissing, "kissing", "kissing vessels", "apart"},
                                   {Flaw::kStub, "stub", "stubs", "long"},
                                   {Flaw::kSmallTree, "small_tree", "small trees", "long"},
                                   {Flaw::kSmallPiece, "small_piece", "small pieces", ""},
                                   {Flaw::kOpenEnd, "open_end", "open ends", "round"},
                                   {Flaw::kJoinedPoints, "duplicate_points", "nearly equal points", "moved"},
                                   {Flaw::kDoubleTriangle, "duplicate_triangles", "triangles given twice", ""},
                                   {Flaw::kShell, "shell", "shells", "long"},
                                   {Flaw::kInwardNormals, "inward_normals", "shells turned inside out", ""},
                                   {Flaw::kMixedNormals, "mixed_normals", "edges with mixed normals", ""},
                                   {Flaw::kInnerWall, "inner_wall", "edges of inner walls", ""}};

const FlawName& nameOf(Flaw flaw) {
  return *std::find_if(std::begin(kFlawNames), std::end(kFlawNames), [&](const auto& n) { return n.flaw == flaw; });
}

Eigen::Vector3d inFrame_mm(const Eigen::Vector3d& at_m, PatientFrame frame) {
  const Eigen::Vector3d signs = frame == PatientFrame::kRas ? Eigen::Vector3d(-1, -1, 1) : Eigen::Vector3d(1, 1, 1);
  return 1e3 * signs.cwiseProduct(at_m);
}

}  // namespace

std::string repairPlace(const Repair& repair, PatientFrame frame) {
  const Eigen::Vector3d at_mm = inFrame_mm(repair.at_m, frame);
  std::string text = formatted("%.1f,%.1f,%.1f", at_mm.x(), at_mm.y(), at_mm.z());
  const char* const what = nameOf(repair.flaw).length;
  if (*what == '\0') return text;
  text += formatted(" (%.3g mm %s", 1e3 * repair.length_m, what);
  if (repair.radius_m > 0) text += formatted(", radius %.2g mm", 1e3 * repair.radius_m);
  return text + ")";
}

std::vector<std::string> repairLines(const std::vector<Repair>& repairs, PatientFrame frame, std::size_t most) {
  std::vector<std::string> lines;
  for (const FlawName& name : kFlawNames) {
    int count = 0;
    std::vector<std::string> places, done;
    for (const Repair& repair : repairs) {
      if (repair.flaw != name.flaw) continue;
      count += repair.count;
      places.push_back(repairPlace(repair, frame));
      if (std::find(done.begin(), done.end(), repair.done) == done.end()) done.push_back(repair.done);
    }
    if (count == 0) continue;
    lines.push_back(std::string(name.plural) + ": " + std::to_string(count) + ", " + joined(done, 3, "; ") + ": at " +
                    joined(places, most, "; "));
  }
  return lines;
}

nlohmann::ordered_json repairsAsJson(const std::vector<Repair>& repairs, PatientFrame frame) {
  const auto rounded = [](double value_mm) { return std::round(1e3 * value_mm) / 1e3; };
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (const Repair& repair : repairs) {
    const Eigen::Vector3d at_mm = inFrame_mm(repair.at_m, frame);
    all.push_back({{"kind", nameOf(repair.flaw).key},
                   {"count", repair.count},
                   {"at_mm", {rounded(at_mm.x()), rounded(at_mm.y()), rounded(at_mm.z())}},
                   {"length_mm", rounded(1e3 * repair.length_m)},
                   {"radius_mm", rounded(1e3 * repair.radius_m)},
                   {"done", repair.done}});
  }
  return all;
}

}  // namespace angio::volume
