// SPDX-License-Identifier: GPL-2.0-or-later
#include <cmath>
#include <cstring>

#include "angio/base/errors.hpp"
#include "angio/io/whole_file.hpp"
#include "text.hpp"
#include "tree_formats.hpp"
#include "trunk_merge.hpp"
#include "vtk_array.hpp"
#include "xml.hpp"

namespace angio {
namespace {

constexpr std::size_t kLargestVtpFile = std::size_t{64} << 20;
// Outlets of a vessel tree are some dozens; comparing the beginnings of lines is quadratic in their number.
constexpr int kMostLines = 10'000;
constexpr const char* kRadiusName = "MaximumInscribedSphereRadius";

vtkXMLDataElement& child(const XmlDocument& document, vtkXMLDataElement& parent, const char* name) {
  vtkXMLDataElement* const found = parent.FindNestedElementWithName(name);
  if (!found) throw InputError(document.placeOf(parent), name, "", "is missing");
  return *found;
}

vtkXMLDataElement* findArray(vtkXMLDataElement& parent, const char* name) {
  for (int i = 0; i < parent.GetNumberOfNestedElements(); ++i) {
    vtkXMLDataElement* const element = parent.GetNestedElement(i);
    const char* const its_name = element->GetAttribute("Name");
    if (std::strcmp(element->GetName(), "DataArray") == 0 && its_name && std::strcmp(its_name, name) == 0)
      return element;
  }
  return nullptr;
}

vtkXMLDataElement& needArray(const XmlDocument& document, vtkXMLDataElement& parent, const char* name) {
  vtkXMLDataElement* const found = findArray(parent, name);
  if (!found) throw InputError(document.placeOf(parent), name, "", "is missing");
  return *found;
}

// What a file may still hold: many pieces can name the same few bytes.
struct Budget {
  int points = kMostPoints;
  int lines = kMostLines;
  int indices = kMostPoints;
};

int readCount(const XmlDocument& document, vtkXMLDataElement& piece, const char* name, int& budget) {
  const int count = parseInteger(document.placeOf(piece), name, document.need(piece, name));
  requireBetween(document.placeOf(piece), name, count, 0, budget);
  budget -= count;
  return count;
}

// Connectivity and offsets of a piece's polylines, held against the number of points.
std::vector<std::vector<std::size_t>> readLines(const XmlDocument& document, vtkXMLDataElement& piece, int points,
                                                Budget& budget) {
  const int count = readCount(document, piece, "NumberOfLines", budget.lines);
  if (count == 0) return {};
  vtkXMLDataElement& lines = child(document, piece, "Lines");
  vtkXMLDataElement& offsets_array = needArray(document, lines, "offsets");
  const auto offsets = readVtkArray(document, offsets_array, static_cast<std::size_t>(count));
  double before = 0;
  for (const double offset : offsets) {
    if (!(offset >= before && offset <= budget.indices)) {
      throw InputError(document.placeOf(offsets_array), "offsets", shown(offset),
                       "must not fall and not exceed " + std::to_string(budget.indices));
    }
    before = offset;
  }
  budget.indices -= static_cast<int>(before);
  vtkXMLDataElement& connectivity_array = needArray(document, lines, "connectivity");
  const auto connectivity = readVtkArray(document, connectivity_array, static_cast<std::size_t>(before));
  std::vector<std::vector<std::size_t>> result;
  std::size_t i = 0;
  for (const double offset : offsets) {
    auto& line = result.emplace_back();
    for (; i < static_cast<std::size_t>(offset); ++i) {
      if (!(connectivity[i] >= 0 && connectivity[i] < points)) {
        throw InputError(document.placeOf(connectivity_array), "connectivity", shown(connectivity[i]),
                         "must be a point, 0 to " + std::to_string(points - 1));
      }
      line.push_back(static_cast<std::size_t>(connectivity[i]));
    }
  }
  return result;
}

struct PiecePoints {
  std::vector<Eigen::Vector3d> points_mm;
  std::vector<std::optional<double>> radii_mm;
};

PiecePoints readPoints(const XmlDocument& document, vtkXMLDataElement& piece, int count) {
  const auto n = static_cast<std::size_t>(count);
  vtkXMLDataElement& points_array = child(document, child(document, piece, "Points"), "DataArray");
  const auto numbers = readVtkArray(document, points_array, 3 * n);
  vtkXMLDataElement* const point_data = piece.FindNestedElementWithName("PointData");
  vtkXMLDataElement* const radius_array = point_data ? findArray(*point_data, kRadiusName) : nullptr;
  const auto radii = radius_array ? readVtkArray(document, *radius_array, n) : std::vector<double>(n, 0.0);
  PiecePoints result;
  for (std::size_t i = 0; i < n; ++i) {
    static const char* const kAxis[3] = {"x_mm", "y_mm", "z_mm"};
    const std::string field = "point " + std::to_string(i) + ", ";
    for (std::size_t k = 0; k < 3; ++k) {
      requireBetween(document.placeOf(points_array), field + kAxis[k], numbers[3 * i + k], -1e4, 1e4);
    }
    if (radius_array) requireBetween(document.placeOf(*radius_array), field + kRadiusName, radii[i], 0, 999);
    result.points_mm.emplace_back(numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]);
    result.radii_mm.push_back(knownRadius(radii[i]));
  }
  return result;
}

void addPiece(const XmlDocument& document, vtkXMLDataElement& piece, Budget& budget, TrunkMerge& tree) {
  const int count = readCount(document, piece, "NumberOfPoints", budget.points);
  if (count == 0) return;
  const PiecePoints points = readPoints(document, piece, count);
  for (const auto& indices : readLines(document, piece, count, budget)) {
    std::vector<Eigen::Vector3d> line_mm;
    std::vector<std::optional<double>> radii_mm;
    for (const std::size_t i : indices) {
      line_mm.push_back(points.points_mm[i]);
      radii_mm.push_back(points.radii_mm[i]);
    }
    tree.addLine(line_mm, radii_mm);
  }
}

}  // namespace

VesselTree readVtpTree(const std::string& path) {
  const XmlDocument document(path, readWholeFile(path, kLargestVtpFile));
  vtkXMLDataElement& root = document.root();
  if (std::strcmp(root.GetName(), "VTKFile") != 0 || document.need(root, "type") != "PolyData") {
    throw InputError(document.placeOf(root), "", root.GetName(), "must be a VTKFile of type PolyData");
  }
  vtkXMLDataElement& data = child(document, root, "PolyData");
  Budget budget;
  TrunkMerge tree;
  for (int i = 0; i < data.GetNumberOfNestedElements(); ++i) {
    vtkXMLDataElement* const piece = data.GetNestedElement(i);
    if (std::strcmp(piece->GetName(), "Piece") == 0) addPiece(document, *piece, budget, tree);
  }
  if (tree.rows().size() < 2) {
    throw InputError(document.placeOf(data), "Lines", "", "must hold a line of at least two different points");
  }
  return treeOfRows(path, tree.rows());
}

}  // namespace angio
