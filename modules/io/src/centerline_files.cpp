// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/centerline_files.hpp"

#include <algorithm>
#include <numeric>
#include <unordered_map>

#include "angio/base/errors.hpp"
#include "angio/io/whole_file.hpp"
#include "table.hpp"
#include "text.hpp"

namespace angio {
namespace {

// Twice the widest detector in each direction; beyond it a number is a mistake, not a pixel.
constexpr double kLargestPixel = 65536;

struct CenterlineRow {
  double x_px = 0, y_px = 0;
  int branch = 0;
  double tangent_rad = 0, radius_px = 0;
};

// Brings the points of each branch together, branches in the order in which they first appear.
void groupByBranch(std::vector<CenterlineRow>& rows) {
  std::unordered_map<int, int> rank;
  for (const auto& row : rows) rank.emplace(row.branch, static_cast<int>(rank.size()));
  std::stable_sort(rows.begin(), rows.end(), [&](const CenterlineRow& a, const CenterlineRow& b) {
    return rank.find(a.branch)->second < rank.find(b.branch)->second;
  });
}

}  // namespace

Centerline2d readCenterline(const std::string& path) {
  std::vector<CenterlineRow> rows;
  bool has_branch = false, has_tangent = false, has_radius = false;
  readTable(path, {{"x_px", "y_px"}, {"branch", "tangent_rad", "radius_px"}}, [&](const TableRow& from) {
    has_branch = from.has("branch");
    has_tangent = from.has("tangent_rad");
    has_radius = from.has("radius_px");
    CenterlineRow row;
    row.x_px = requireBetween(from.place(), "x_px", from.number("x_px"), -kLargestPixel, kLargestPixel);
    row.y_px = requireBetween(from.place(), "y_px", from.number("y_px"), -kLargestPixel, kLargestPixel);
    if (has_branch) row.branch = from.integer("branch");
    if (has_tangent)
      row.tangent_rad = requireBetween(from.place(), "tangent_rad", from.number("tangent_rad"), -1e3, 1e3);
    if (has_radius) row.radius_px = requirePositive(from.place(), "radius_px", from.number("radius_px"));
    rows.push_back(row);
  });
  if (has_branch) groupByBranch(rows);

  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::Matrix2Xd points_px(2, n);
  Eigen::VectorXd tangent_rad(has_tangent ? n : 0), radius_px(has_radius ? n : 0);
  std::vector<int> branch;
  for (Eigen::Index i = 0; i < n; ++i) {
    const CenterlineRow& row = rows[static_cast<std::size_t>(i)];
    points_px.col(i) << row.x_px, row.y_px;
    if (has_branch) branch.push_back(row.branch);
    if (has_tangent) tangent_rad[i] = undirected(row.tangent_rad);
    if (has_radius) radius_px[i] = row.radius_px;
  }
  Centerline2d result = makeCenterline(std::move(points_px), std::move(branch), std::move(radius_px));
  if (has_tangent) result.tangent_rad = std::move(tangent_rad);
  return result;
}

void writeCenterline(const std::string& path, const Centerline2d& centerline) {
  if (centerline.size() == 0) throw InputError(path, "points", "0", "a centreline file has at least one");
  const bool has_tangent = centerline.tangent_rad.size() == centerline.size();
  const bool has_radius = centerline.radius_px.size() == centerline.size();
  std::string content = "x_px,y_px";
  content += centerline.ordered() ? ",branch" : "";
  content += has_tangent ? ",tangent_rad" : "";
  content += has_radius ? ",radius_px" : "";
  content += "\n";
  for (int i = 0; i < centerline.size(); ++i) {
    content += exact(centerline.points_px(0, i)) + "," + exact(centerline.points_px(1, i));
    if (centerline.ordered()) content += "," + std::to_string(centerline.branch[static_cast<std::size_t>(i)]);
    if (has_tangent) content += "," + exact(centerline.tangent_rad[i]);
    if (has_radius) content += "," + exact(centerline.radius_px[i]);
    content += "\n";
  }
  writeWholeFile(path, content);
}

}  // namespace angio
