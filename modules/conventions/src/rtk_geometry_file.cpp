// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/rtk_geometry_file.hpp"

#include <algorithm>
#include <array>

#include "angio/base/errors.hpp"
#include "angio/base/joined.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/xml.hpp"

namespace angio::conventions {
namespace {

constexpr const char* kRoot = "RTKThreeDCircularGeometry";
constexpr std::size_t kMaxGeometryFile = std::size_t{64} << 20;
constexpr XmlBounds kGeometryBounds{500000, "<!DOCTYPE RTKGEOMETRY>"};

struct RtkNumber {
  const char* name;
  double& (*of)(RtkProjection& p);
};

// GantryAngle is every projection's own in RTK's files, and stands first.
const std::array<RtkNumber, 9> kNumbers = {
    {{"GantryAngle", [](RtkProjection& p) -> double& { return p.gantry_deg; }},
     {"SourceToIsocenterDistance", [](RtkProjection& p) -> double& { return p.source_to_isocenter_mm; }},
     {"SourceToDetectorDistance", [](RtkProjection& p) -> double& { return p.source_to_detector_mm; }},
     {"SourceOffsetX", [](RtkProjection& p) -> double& { return p.source_offset_mm.x(); }},
     {"SourceOffsetY", [](RtkProjection& p) -> double& { return p.source_offset_mm.y(); }},
     {"ProjectionOffsetX", [](RtkProjection& p) -> double& { return p.projection_offset_mm.x(); }},
     {"ProjectionOffsetY", [](RtkProjection& p) -> double& { return p.projection_offset_mm.y(); }},
     {"InPlaneAngle", [](RtkProjection& p) -> double& { return p.in_plane_deg; }},
     {"OutOfPlaneAngle", [](RtkProjection& p) -> double& { return p.out_of_plane_deg; }}}};

class GeometryReader {
 public:
  explicit GeometryReader(const std::string& path)
      : document_(path, readWholeFile(path, kMaxGeometryFile), kGeometryBounds) {}

  std::vector<RtkProjection> read() {
    const XmlElement& root = document_.root();
    if (root.name != kRoot) refuse("root", root.name, std::string("must be ") + kRoot);
    const std::string version = document_.need(root, "version");
    if (version != "2" && version != "3") refuse("version", version, "must be 2 or 3");
    for (const XmlElement& element : root.children) {
      if (element.name != "Projection") {
        readElement(element);
        continue;
      }
      for (const XmlElement& inner : element.children) readElement(inner);
      check(element);
      projections_.push_back(now_);
    }
    if (projections_.empty()) refuse("Projection", "", "is missing");
    return projections_;
  }

 private:
  [[noreturn]] void refuse(const std::string& field, const std::string& value, const std::string& rule) const {
    throw InputError(place(), field, value, rule);
  }

  // The line would be counted anew for each of thousands of numbers.
  std::string place() const { return document_.path() + ": projection " + std::to_string(projections_.size()); }

  double number(const XmlElement& element) const {
    return parseNumber(place(), element.name, trimmed(document_.textOf(element)));
  }

  void readElement(const XmlElement& element) {
    if (element.name == "Matrix" || element.name.rfind("Collimation", 0) == 0) return;
    if (element.name == "RadiusCylindricalDetector") {
      if (number(element) != 0) refuse(element.name, formatValue(number(element)), "must be 0: a flat detector");
      return;
    }
    const std::string name = element.name == "Angle" ? "GantryAngle" : element.name;  // As in files of version 2.
    std::vector<std::string> known;
    for (const RtkNumber& one : kNumbers) {
      if (name == one.name) {
        one.of(now_) = number(element);
        return;
      }
      known.emplace_back(one.name);
    }
    refuse(element.name, "", "must be one of " + joined(known) + ", Matrix, RadiusCylindricalDetector, Collimation...");
  }

  void check(const XmlElement& projection) const {
    requirePositive(place(), "SourceToIsocenterDistance", now_.source_to_isocenter_mm);
    requirePositive(place(), "SourceToDetectorDistance", now_.source_to_detector_mm);
    const XmlElement* matrix = projection.child("Matrix");
    if (!matrix) return;
    std::vector<std::string_view> words;
    splitAtBlanks(document_.textOf(*matrix), words);
    if (words.size() != 12) refuse("Matrix", std::to_string(words.size()) + " numbers", "must be 12");
    const RtkMatrix own = rtkMatrix(now_);
    for (Eigen::Index k = 0; k < 12; ++k) {
      const double entry = parseNumber(place(), "Matrix", words[k]), expected = own(k / 4, k % 4);
      if (std::abs(entry - expected) <= 1e-3) continue;
      refuse("Matrix[" + std::to_string(k) + "]", formatValue(entry),
             "must be that of the projection's numbers, " + formatValue(expected));
    }
  }

  XmlDocument document_;
  RtkProjection now_;
  std::vector<RtkProjection> projections_;
};

std::string element(const char* name, double value) {
  return "    <" + std::string(name) + ">" + exact(value) + "</" + name + ">\n";
}

std::string matrixElement(const RtkMatrix& matrix) {
  std::string text = "    <Matrix>\n";
  for (Eigen::Index row = 0; row < 3; ++row) {
    text += "     ";
    for (Eigen::Index column = 0; column < 4; ++column) text += " " + exact(matrix(row, column));
    text += "\n";
  }
  return text + "    </Matrix>\n";
}

}  // namespace

std::vector<RtkProjection> readRtkGeometry(const std::string& path) { return GeometryReader(path).read(); }

void writeRtkGeometry(const std::string& path, const std::vector<RtkProjection>& projections) {
  if (projections.empty()) throw InputError(path, "projections", "0", "must be one or more");
  std::vector<RtkProjection> all = projections;
  std::array<bool, kNumbers.size()> shared{};
  std::string text = "<?xml version=\"1.0\"?>\n<!DOCTYPE RTKGEOMETRY>\n<RTKThreeDCircularGeometry version=\"3\">\n";
  for (std::size_t k = 0; k < kNumbers.size(); ++k) {
    const auto of = kNumbers[k].of;
    const double first = of(all.front());
    for (RtkProjection& p : all) requireFinite(path, kNumbers[k].name, of(p));
    shared[k] = k > 0 && std::all_of(all.begin(), all.end(), [&](RtkProjection& p) { return of(p) == first; });
    if (shared[k] && first != 0) text += element(kNumbers[k].name, first).substr(2);
  }
  for (RtkProjection& p : all) {
    text += "  <Projection>\n";
    for (std::size_t k = 0; k < kNumbers.size(); ++k) {
      if (!shared[k]) text += element(kNumbers[k].name, kNumbers[k].of(p));
    }
    text += matrixElement(rtkMatrix(p)) + "  </Projection>\n";
  }
  writeWholeFile(path, text + "</RTKThreeDCircularGeometry>\n");
}

}  // namespace angio::conventions
