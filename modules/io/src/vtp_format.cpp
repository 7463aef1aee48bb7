// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/errors.hpp"
#include "angio/io/surface_files.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/xml.hpp"
#include "tree_formats.hpp"
#include "trunk_merge.hpp"

namespace angio::io {
namespace {

constexpr std::size_t kMaxVtpFile = std::size_t{64} << 20;
constexpr int kMaxPolygons = 4'000'000;
constexpr const char* kVmtkRadiusName = "MaximumInscribedSphereRadius";

const XmlElement& child(const XmlDocument& document, const XmlElement& parent, const char* name) {
  const XmlElement* const found = parent.child(name);
  if (!found) throw InputError(document.placeOf(parent), name, "", "is missing");
  return *found;
}

const XmlElement* findArray(const XmlElement& parent, const char* name) {
  for (const XmlElement* element : parent.childrenOf("DataArray")) {
    const std::string* const its_name = element->attribute("Name");
    if (its_name && *its_name == name) return element;
  }
  return nullptr;
}

const XmlElement& needArray(const XmlDocument& document, const XmlElement& parent, const char* name) {
  const XmlElement* const found = findArray(parent, name);
  if (!found) throw InputError(document.placeOf(parent), name, "", "is missing");
  return *found;
}

// What a file may still hold: many pieces can name the same few bytes.
struct Budget {
  int points = kMaxPoints;
  int cells = kMaxVtkLines;
  int indices = kMaxPoints;
};

int readCount(const XmlDocument& document, const XmlElement& piece, const char* name, int& budget) {
  const int count = parseInteger(document.placeOf(piece), name, document.need(piece, name));
  requireBetween(document.placeOf(piece), name, count, 0, budget);
  budget -= count;
  return count;
}

// Connectivity and offsets of a piece's cells ("Lines", "Polys", "Strips"), held against the number of points.
std::vector<std::vector<std::size_t>> readCells(const XmlDocument& document, const XmlElement& piece,
                                                const std::string& kind, int points, Budget& budget) {
  const int count = readCount(document, piece, ("NumberOf" + kind).c_str(), budget.cells);
  if (count == 0) return {};
  const XmlElement& lines = child(document, piece, kind.c_str());
  const XmlElement& offsets_array = needArray(document, lines, "offsets");
  const auto offsets = readVtkArray(document, offsets_array, static_cast<std::size_t>(count));
  double before = 0;
  for (const double offset : offsets) {
    if (!(offset >= before && offset <= budget.indices)) {
      throw InputError(document.placeOf(offsets_array), "offsets", formatValue(offset),
                       "must not fall and not exceed " + std::to_string(budget.indices));
    }
    before = offset;
  }
  budget.indices -= static_cast<int>(before);
  const XmlElement& connectivity_array = needArray(document, lines, "connectivity");
  const auto connectivity = readVtkArray(document, connectivity_array, static_cast<std::size_t>(before));
  std::vector<std::vector<std::size_t>> result;
  std::size_t i = 0;
  for (const double offset : offsets) {
    auto& line = result.emplace_back();
    for (; i < static_cast<std::size_t>(offset); ++i) {
      if (!(connectivity[i] >= 0 && connectivity[i] < points)) {
        throw InputError(document.placeOf(connectivity_array), "connectivity", formatValue(connectivity[i]),
                         "must be a point, 0 to " + std::to_string(points - 1));
      }
      line.push_back(static_cast<std::size_t>(connectivity[i]));
    }
  }
  return result;
}

std::vector<Eigen::Vector3d> readVtpPoints(const XmlDocument& document, const XmlElement& piece, int count) {
  const XmlElement& points_array = child(document, child(document, piece, "Points"), "DataArray");
  const auto numbers = readVtkArray(document, points_array, 3 * static_cast<std::size_t>(count));
  std::vector<Eigen::Vector3d> points_mm;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    const Eigen::Vector3d& point_mm = points_mm.emplace_back(numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]);
    if ((point_mm.array().abs() <= 1e4).all()) continue;  // The line of an error is looked for only when there is one.
    static const char* const kAxis[3] = {"x_mm", "y_mm", "z_mm"};
    for (int k = 0; k < 3; ++k) {
      requireBetween(document.placeOf(points_array), "point " + std::to_string(i) + ", " + kAxis[k], point_mm[k], -1e4,
                     1e4);
    }
  }
  return points_mm;
}

std::vector<std::optional<double>> readVtpRadii(const XmlDocument& document, const XmlElement& piece, int count) {
  std::vector<std::optional<double>> radii_mm(static_cast<std::size_t>(count));
  const XmlElement* const point_data = piece.child("PointData");
  const XmlElement* const radius_array = point_data ? findArray(*point_data, kVmtkRadiusName) : nullptr;
  if (!radius_array) return radii_mm;
  const auto numbers = readVtkArray(document, *radius_array, radii_mm.size());
  for (std::size_t i = 0; i < radii_mm.size(); ++i) {
    if (!(numbers[i] >= 0 && numbers[i] <= 999)) {
      requireBetween(document.placeOf(*radius_array), "point " + std::to_string(i) + ", " + kVmtkRadiusName, numbers[i],
                     0, 999);
    }
    radii_mm[i] = knownRadius(numbers[i]);
  }
  return radii_mm;
}

void addPiece(const XmlDocument& document, const XmlElement& piece, Budget& budget, TrunkMerge& tree) {
  const int count = readCount(document, piece, "NumberOfPoints", budget.points);
  if (count == 0) return;
  const auto points_mm = readVtpPoints(document, piece, count);
  const auto radii_mm = readVtpRadii(document, piece, count);
  for (const auto& indices : readCells(document, piece, "Lines", count, budget)) {
    std::vector<Eigen::Vector3d> line_mm;
    std::vector<std::optional<double>> line_radii_mm;
    for (const std::size_t i : indices) {
      line_mm.push_back(points_mm[i]);
      line_radii_mm.push_back(radii_mm[i]);
    }
    tree.addLine(line_mm, line_radii_mm);
  }
}

// The element that holds the pieces.
const XmlElement& polyDataIn(const XmlDocument& document) {
  const XmlElement& root = document.root();
  if (root.name != "VTKFile" || document.need(root, "type") != "PolyData") {
    throw InputError(document.placeOf(root), "", root.name, "must be a VTKFile of type PolyData");
  }
  return child(document, root, "PolyData");
}

}  // namespace

VesselTree readVtpTree(const std::string& path) {
  const XmlDocument document(path, readWholeFile(path, kMaxVtpFile));
  const XmlElement& data = polyDataIn(document);
  Budget budget;
  TrunkMerge tree;
  for (const XmlElement* piece : data.childrenOf("Piece")) addPiece(document, *piece, budget, tree);
  if (tree.rows().size() < 2) {
    throw InputError(document.placeOf(data), "Lines", "", "must hold a line of at least two different points");
  }
  return treeOfRows(path, tree.rows());
}

Surface readVtpSurface(const std::string& path) {
  const XmlDocument document(path, readWholeFile(path, kMaxVtpFile));
  Budget budget{kMaxPoints, kMaxPolygons, 4 * kMaxPolygons};
  std::vector<Eigen::Vector3d> points_mm;
  Surface surface;
  for (const XmlElement* piece : polyDataIn(document).childrenOf("Piece")) {
    const int count = readCount(document, *piece, "NumberOfPoints", budget.points);
    if (count == 0) continue;
    const std::size_t first = points_mm.size();
    const auto its_points_mm = readVtpPoints(document, *piece, count);
    points_mm.insert(points_mm.end(), its_points_mm.begin(), its_points_mm.end());
    const auto add = [&](const auto from, const auto to) {
      std::vector<int>& polygon = surface.polygons.emplace_back();
      for (auto i = from; i != to; ++i) polygon.push_back(static_cast<int>(first + *i));
    };
    for (const auto& corners : readCells(document, *piece, "Polys", count, budget)) {
      if (corners.size() >= 3) add(corners.begin(), corners.end());
    }
    for (const auto& strip : readCells(document, *piece, "Strips", count, budget)) {
      for (std::size_t i = 0; i + 3 <= strip.size(); ++i) add(&strip[i], &strip[i] + 3);
    }
  }
  surface.points_mm.resize(3, points_mm.size());
  for (std::size_t i = 0; i < points_mm.size(); ++i) surface.points_mm.col(i) = points_mm[i];
  return surface;
}

void writeVtpTree(const std::string& path, const VesselTree& tree, std::optional<PatientFrame>) {
  // Points stand once; lines that share a trunk name them again, as VMTK's copy them.
  std::string points, radii, connectivity, offsets;
  std::size_t indices = 0, lines = 0;
  for (int i = 0; i < tree.size(); ++i) {
    for (int k = 0; k < 3; ++k) points += exactMillimetres(tree.points()(k, i)) + (k < 2 ? " " : "\n");
    const auto& radius = tree.radii()[i];
    radii += (radius ? exactMillimetres(*radius) : "0") + "\n";
    if (!tree.children()[i].empty() || tree.parents()[i] < 0) continue;
    std::vector<int> line;
    for (int at = i; at >= 0; at = tree.parents()[at]) line.push_back(at);
    indices += line.size();
    if (indices > static_cast<std::size_t>(kMaxPoints) || ++lines > static_cast<std::size_t>(kMaxVtkLines)) {
      throw InputError(path, "lines", "", "from the root to " + std::to_string(lines) + " ends are too many for .vtp");
    }
    for (std::size_t k = line.size(); k-- > 0;) connectivity += std::to_string(line[k]) + (k > 0 ? " " : "\n");
    offsets += std::to_string(indices) + "\n";
  }
  const auto array = [](const std::string& attributes, const std::string& numbers) {
    return "<DataArray " + attributes + " format=\"ascii\">\n" + numbers + "</DataArray>\n";
  };
  writeWholeFile(
      path,
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\">\n"
      "<PolyData>\n<Piece NumberOfPoints=\"" +
          std::to_string(tree.size()) + "\" NumberOfVerts=\"0\" NumberOfLines=\"" + std::to_string(lines) +
          "\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n<PointData Scalars=\"" + kVmtkRadiusName + "\">\n" +
          array("type=\"Float64\" Name=\"" + std::string(kVmtkRadiusName) + "\"", radii) + "</PointData>\n<Points>\n" +
          array("type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\"", points) + "</Points>\n<Lines>\n" +
          array("type=\"Int64\" Name=\"connectivity\"", connectivity) +
          array("type=\"Int64\" Name=\"offsets\"", offsets) + "</Lines>\n</Piece>\n</PolyData>\n</VTKFile>\n");
}

}  // namespace angio::io
