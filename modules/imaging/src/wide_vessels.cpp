// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/wide_vessels.hpp"

#include <algorithm>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"

namespace angio::imaging {
namespace {

constexpr std::size_t kListed = 8;

struct WideBranch {
  std::size_t number = 0;
  double radius_px = 0;
};

// The mean radius of a branch in the image [px]; 0 where none is known. A branch's first point is as wide as the vessel
// that it leaves.
double radiusInImage(const VesselTree& tree, const std::vector<int>& branch, const XrayCamera& camera,
                     const Pose& T_camera_model) {
  double sum_px = 0;
  int count = 0;
  for (std::size_t i = 1; i < branch.size(); ++i) {
    const auto& radius_m = tree.radii()[static_cast<std::size_t>(branch[i])];
    const double z_m = (T_camera_model * tree.points().col(branch[i])).z();
    if (!radius_m || z_m <= 0) continue;
    sum_px += camera.parameters().fx_px * *radius_m / z_m;
    ++count;
  }
  return count > 0 ? sum_px / count : 0;
}

}  // namespace

std::optional<std::string> tooWideVessels(const VesselTree& tree, const XrayCamera& camera, const Pose& T_camera_model,
                                          const ExtractorSettings& extractor) {
  const auto* const ridge = std::get_if<RidgeSettings>(&extractor);
  if (!ridge) return std::nullopt;
  std::vector<WideBranch> wide;
  for (std::size_t b = 0; b < tree.branches().size(); ++b) {
    const double radius_px = radiusInImage(tree, tree.branches()[b], camera, T_camera_model);
    if (radius_px > ridge->max_radius_px) wide.push_back({b, radius_px});
  }
  if (wide.empty()) return std::nullopt;
  std::stable_sort(wide.begin(), wide.end(), [](const auto& a, const auto& b) { return a.radius_px > b.radius_px; });
  std::string list;
  for (std::size_t i = 0; i < std::min(wide.size(), kListed); ++i) {
    list += (i > 0 ? ", " : "") + std::to_string(wide[i].number) + formatted(" (%.0f px)", wide[i].radius_px);
  }
  if (wide.size() > kListed) list += " and " + std::to_string(wide.size() - kListed) + " more";
  return formatted("%zu of %zu branches of the tree have a larger radius in the image than ridge.max_radius_px = ",
                   wide.size(), tree.branches().size()) +
         formatValue(ridge->max_radius_px) + " and may not be seen: " + list + "; " +
         formatted("in --settings, ridge: {max_radius_px: %.0f} finds them", 1.2 * wide.front().radius_px + 1);
}

}  // namespace angio::imaging
