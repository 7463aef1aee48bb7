// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/centerline_files.hpp"

#include <algorithm>
#include <array>
#include <unordered_map>

#include "angio/base/errors.hpp"
#include "angio/io/displacement_files.hpp"
#include "angio/io/table.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::io {
namespace {

// Twice the widest detector in each direction; beyond it a number is a mistake, not a pixel.
constexpr double kMaxPixel = 65536;

// Columns of numbers that a centreline may have beside points and branches.
struct NumberColumn {
  const char* name;
  Eigen::VectorXd Centerline2d::*values;
  double (*checked)(const std::string& place, const std::string& name, double value);
};

double modest(const std::string& place, const std::string& name, double value) {
  return requireBetween(place, name, value, -1e3, 1e3);
}

const NumberColumn kNumberColumns[] = {
    {"tangent_rad", &Centerline2d::tangent_rad, modest},
    {"radius_px", &Centerline2d::radius_px, requirePositive},
    {"sigma_px", &Centerline2d::std_px, requirePositive},
    {"contrast", &Centerline2d::contrast, modest},
};
constexpr std::size_t kNumberColumnCount = std::size(kNumberColumns);
constexpr const char* kKindNames[] = {"vessel", "device"};

struct CenterlineRow {
  double x_px = 0, y_px = 0;
  int branch = 0;
  CurveKind kind = CurveKind::kVessel;
  std::array<double, kNumberColumnCount> numbers{};
};

CurveKind kindIn(const TableRow& from) {
  const std::string_view text = from.text("kind");
  if (text == kKindNames[0]) return CurveKind::kVessel;
  if (text == kKindNames[1]) return CurveKind::kDevice;
  throw InputError(from.place(), "kind", std::string(text), "must be vessel or device");
}

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
  bool has_branch = false, has_kind = false;
  std::array<bool, kNumberColumnCount> has{};
  TableColumns columns{{"x_px", "y_px"}, {"branch", "kind"}};
  for (const NumberColumn& column : kNumberColumns) columns.optional.push_back(column.name);
  readTable(path, columns, [&](const TableRow& from) {
    has_branch = from.has("branch");
    has_kind = from.has("kind");
    CenterlineRow row;
    row.x_px = requireBetween(from.place(), "x_px", from.number("x_px"), -kMaxPixel, kMaxPixel);
    row.y_px = requireBetween(from.place(), "y_px", from.number("y_px"), -kMaxPixel, kMaxPixel);
    if (has_branch) row.branch = from.integer("branch");
    if (has_kind) row.kind = kindIn(from);
    for (std::size_t c = 0; c < kNumberColumnCount; ++c) {
      const NumberColumn& column = kNumberColumns[c];
      has[c] = from.has(column.name);
      if (has[c]) row.numbers[c] = column.checked(from.place(), column.name, from.number(column.name));
    }
    rows.push_back(row);
  });
  if (has_branch) groupByBranch(rows);

  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::Matrix2Xd points_px(2, n);
  std::vector<int> branch;
  std::vector<CurveKind> kind;
  std::array<Eigen::VectorXd, kNumberColumnCount> numbers;
  for (std::size_t c = 0; c < kNumberColumnCount; ++c) numbers[c].resize(has[c] ? n : 0);
  for (Eigen::Index i = 0; i < n; ++i) {
    const CenterlineRow& row = rows[i];
    points_px.col(i) << row.x_px, row.y_px;
    if (has_branch) branch.push_back(row.branch);
    if (has_kind) kind.push_back(row.kind);
    for (std::size_t c = 0; c < kNumberColumnCount; ++c) {
      if (has[c]) numbers[c][i] = row.numbers[c];
    }
  }
  Centerline2d result = makeCenterline(std::move(points_px), std::move(branch));
  result.kind = std::move(kind);
  for (std::size_t c = 0; c < kNumberColumnCount; ++c) {
    if (has[c]) result.*kNumberColumns[c].values = std::move(numbers[c]);
  }
  result.tangent_rad = result.tangent_rad.unaryExpr(&undirected);
  return result;
}

void writeCenterline(const std::string& path, const Centerline2d& centerline) {
  if (centerline.size() == 0) throw InputError(path, "points", "0", "a centreline file has at least one");
  std::vector<const NumberColumn*> numbers;
  for (const NumberColumn& column : kNumberColumns) {
    if ((centerline.*column.values).size() == centerline.size()) numbers.push_back(&column);
  }
  std::string content = "x_px,y_px";
  content += centerline.ordered() ? ",branch" : "";
  for (const NumberColumn* column : numbers) content += std::string(",") + column->name;
  content += centerline.kind.empty() ? "\n" : ",kind\n";
  for (int i = 0; i < centerline.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    content += exact(centerline.points_px(0, i)) + "," + exact(centerline.points_px(1, i));
    if (centerline.ordered()) content += "," + std::to_string(centerline.branch[at]);
    for (const NumberColumn* column : numbers) content += "," + exact((centerline.*column->values)[i]);
    if (!centerline.kind.empty()) content += std::string(",") + kKindNames[static_cast<int>(centerline.kind[at])];
    content += "\n";
  }
  writeWholeFile(path, content);
}

Eigen::Matrix3Xd readDisplacements(const std::string& path, int points) {
  Eigen::Matrix3Xd result(3, points);
  int rows = 0;
  readTable(path, {{"id", "dx_mm", "dy_mm", "dz_mm"}, {}}, [&](const TableRow& row) {
    const int id = row.integer("id");
    if (rows == points) {
      throw InputError(row.place(), "id", std::to_string(id),
                       "must be the last row: the tree has " + std::to_string(points) + " points");
    }
    const Eigen::Vector3d displacement_mm{row.number("dx_mm"), row.number("dy_mm"), row.number("dz_mm")};
    result.col(rows++) = displacement_mm / 1e3;
  });
  if (rows != points) {
    throw InputError(path, "rows", std::to_string(rows),
                     "must be as many as the tree's points, " + std::to_string(points));
  }
  return result;
}

void writeDisplacements(const std::string& path, const Eigen::Matrix3Xd& displacements_m) {
  std::string content = "id,dx_mm,dy_mm,dz_mm\n";
  for (Eigen::Index i = 0; i < displacements_m.cols(); ++i) {
    content += std::to_string(i);
    for (int k = 0; k < 3; ++k) content += "," + exactMillimetres(displacements_m(k, i));
    content += "\n";
  }
  writeWholeFile(path, content);
}

}  // namespace angio::io
