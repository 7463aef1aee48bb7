// SPDX-License-Identifier: GPL-2.0-or-later
#include "surface_formats.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "angio/base/big_endian.hpp"
#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::volume {
namespace {

constexpr std::size_t kMaxStl = std::size_t{256} << 20;
constexpr std::size_t kHeader = 84, kTriangle = 50;  // Bytes.

using Corner = std::array<float, 3>;
using Triangles = std::vector<std::array<Corner, 3>>;

template <typename Number>
bool parsesWhole(std::string_view word, Number& value) {
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc() && end == word.data() + word.size();
}

void readText(const std::string& path, std::string_view text, Triangles& triangles) {
  std::array<Corner, 3> triangle;
  std::size_t corners = 0;
  for (auto at = text.find("vertex"); at != std::string_view::npos; at = text.find("vertex")) {
    text.remove_prefix(at + 6);
    for (float& x : triangle[corners % 3]) {
      const std::string_view word = nextWord(text);
      if (!parsesWhole(word, x)) throw InputError(path, "vertex", std::string(word.substr(0, 40)), "must be a number");
    }
    if (++corners % 3 == 0) triangles.push_back(triangle);
  }
  if (corners % 3 != 0 || text.find("endsolid") == std::string_view::npos) {
    throw InputError(path, "triangles", std::to_string(corners / 3), "the file ends within them");
  }
}

// VTK User's Guide, "Simple Legacy Formats": four lines of header, then keywords, each with its numbers. Version 5
// keeps cells as two arrays, offsets and connectivity, where the earlier ones put the number of corners before each
// cell.

constexpr std::size_t kMaxVtk = std::size_t{256} << 20;
constexpr double kMaxNumbers = 1 << 24;

struct NumberType {
  const char* name;
  std::size_t bytes;
  double (*value)(const char* bytes);
};

template <typename T>
double valueOf(const char* bytes) {
  return static_cast<double>(bigEndian<T>(bytes));
}

constexpr NumberType kTypes[] = {{"float", 4, valueOf<float>},
                                 {"double", 8, valueOf<double>},
                                 {"int", 4, valueOf<std::int32_t>},
                                 {"vtktypeint32", 4, valueOf<std::int32_t>},
                                 {"vtktypeint64", 8, valueOf<std::int64_t>}};

class LegacyText {
 public:
  // Reads the header.
  LegacyText(const std::string& path, std::string_view content) : path_(path), rest_(content), content_(content) {
    constexpr std::string_view kFirst = "# vtk DataFile Version ";
    const std::string_view first = line();
    if (first.substr(0, kFirst.size()) != kFirst) refuse("first line", "", "must begin " + std::string(kFirst));
    const std::string_view version = first.substr(kFirst.size());
    std::from_chars(version.data(), version.data() + version.size(), version_);
    if (!(version_ >= 1 && version_ < 6)) refuse("version", version, "must be 1 to 5");
    line();  // The title.
    const std::string_view coding = line();
    if (coding != "ASCII" && coding != "BINARY") refuse("coding", coding, "must be ASCII or BINARY");
    binary_ = coding == "BINARY";
    if (word() != "DATASET" || word() != "POLYDATA") refuse("dataset", "", "must be DATASET POLYDATA");
  }

  double version() const { return version_; }

  [[noreturn]] void refuse(const std::string& field, std::string_view value, const std::string& rule) const {
    const auto done = content_.substr(0, content_.size() - rest_.size());
    const auto line = 1 + std::count(done.begin(), done.end(), '\n');
    throw InputError(path_ + ":" + std::to_string(line), field, std::string(value.substr(0, 40)), rule);
  }

  std::string_view line() {
    const auto end = rest_.find('\n');
    std::string_view text = rest_.substr(0, end);
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    while (!text.empty() && (text.back() == '\r' || text.back() == ' ')) text.remove_suffix(1);
    return text;
  }

  std::string_view word() { return nextWord(rest_); }

  double number(const std::string& field, double low, double high) {
    const std::string_view text = word();
    double value = 0;
    if (!parsesWhole(text, value)) refuse(field, text, "must be a number");
    if (!(value >= low && value <= high)) {
      refuse(field, text, "must lie between " + formatValue(low) + " and " + formatValue(high));
    }
    return value;
  }

  std::size_t count(const std::string& field) {
    const double value = number(field, 0, kMaxNumbers);
    if (value != std::floor(value)) refuse(field, formatValue(value), "must be an integer");
    return static_cast<std::size_t>(value);
  }

  // The numbers behind a keyword's line, each within [low, high].
  std::vector<double> numbers(const std::string& field, std::size_t count, std::string_view type, double low,
                              double high) {
    std::vector<double> values;
    if (!binary_) {
      while (values.size() < count) values.push_back(number(field, low, high));  // The count may lie.
      return values;
    }
    const auto* found =
        std::find_if(std::begin(kTypes), std::end(kTypes), [&](const auto& t) { return type == t.name; });
    if (found == std::end(kTypes)) refuse("type", type, "must be float, double, int, vtktypeint32 or vtktypeint64");
    line();  // What is left of the keyword's.
    if (count > rest_.size() / found->bytes) refuse(field, std::to_string(count), "the file ends within them");
    values.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      values.push_back(found->value(&rest_[i * found->bytes]));
      if (!(values.back() >= low && values.back() <= high)) {
        refuse(field, formatValue(values.back()), "must lie between " + formatValue(low) + " and " + formatValue(high));
      }
    }
    rest_.remove_prefix(count * found->bytes);
    return values;
  }

 private:
  const std::string& path_;
  std::string_view rest_, content_;
  bool binary_ = false;
  double version_ = 0;
};

std::vector<std::vector<int>> readCells(LegacyText& text, std::size_t points) {
  const std::size_t first = text.count("cells"), second = text.count("size");
  const double last_point = static_cast<double>(points) - 1;
  std::vector<std::vector<int>> cells;
  const auto add = [&](const std::vector<double>& numbers, std::size_t from, std::size_t to) {
    if (to < from || to > numbers.size())
      text.refuse("cell", std::to_string(cells.size()), "must not fall or end beyond all");
    auto& cell = cells.emplace_back();
    for (std::size_t i = from; i < to; ++i) {
      if (!(numbers[i] >= 0 && numbers[i] <= last_point && numbers[i] == std::floor(numbers[i]))) {
        text.refuse("point of cell " + std::to_string(cells.size() - 1), formatValue(numbers[i]),
                    "must be one of the file");
      }
      cell.push_back(static_cast<int>(numbers[i]));
    }
  };
  if (text.version() < 5) {
    const auto numbers = text.numbers("cells", second, "int", 0, kMaxNumbers);
    std::size_t at = 0;
    for (std::size_t i = 0; i < first; ++i) {
      if (at == numbers.size()) text.refuse("cells", std::to_string(i), "must be " + std::to_string(first));
      const auto corners = static_cast<std::size_t>(numbers[at]);
      add(numbers, at + 1, at + 1 + corners);
      at += 1 + corners;
    }
    return cells;
  }
  if (text.word() != "OFFSETS") text.refuse("keyword", "", "must be OFFSETS");
  const auto offsets = text.numbers("offsets", first, text.word(), 0, kMaxNumbers);
  if (text.word() != "CONNECTIVITY") text.refuse("keyword", "", "must be CONNECTIVITY");
  const auto corners = text.numbers("connectivity", second, text.word(), 0, kMaxNumbers);
  for (std::size_t i = 1; i < offsets.size(); ++i) {
    add(corners, static_cast<std::size_t>(offsets[i - 1]), static_cast<std::size_t>(offsets[i]));
  }
  return cells;
}

}  // namespace

Surface readStlSurface(const std::string& path) {
  const std::string content = readWholeFile(path, kMaxStl);
  Triangles triangles;
  std::uint32_t count = 0;
  if (content.size() >= kHeader)
    std::memcpy(&count, &content[kHeader - 4], 4);  // All machines we know are little endian.
  if (content.size() >= kHeader && content.size() == kHeader + kTriangle * count) {
    for (std::size_t i = 0; i < count; ++i) {
      std::array<Corner, 3> triangle;  // Behind its normal.
      std::memcpy(&triangle, &content[kHeader + kTriangle * i + 12], sizeof triangle);
      for (const Corner& corner : triangle) {
        for (const float x : corner) requireFinite(path, "triangle " + std::to_string(i), x);
      }
      triangles.push_back(triangle);
    }
  } else if (content.compare(0, 5, "solid") == 0) {
    readText(path, content, triangles);
  } else {
    throw InputError(path, "bytes", std::to_string(content.size()),
                     "must be those of the triangles that the header counts");
  }
  Surface surface;
  surface.points_mm.resize(3, 3 * triangles.size());
  for (int i = 0; i < static_cast<int>(triangles.size()); ++i) {
    for (int k = 0; k < 3; ++k) {
      surface.points_mm.col(3 * i + k) = Eigen::Map<const Eigen::Vector3f>(triangles[i][k].data()).cast<double>();
    }
    surface.polygons.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return surface;
}

Surface readVtkSurface(const std::string& path) {
  const std::string content = readWholeFile(path, kMaxVtk);
  LegacyText text(path, content);
  Surface surface;
  for (std::string_view key = text.word(); !key.empty(); key = text.word()) {
    if (key == "POINT_DATA" || key == "CELL_DATA") break;
    if (key == "METADATA") {
      text.line();
      while (!text.line().empty()) continue;  // Ends with a blank line.
    } else if (key == "POINTS") {
      if (surface.points_mm.cols() > 0) text.refuse("POINTS", "", "must not be given twice");
      const std::size_t count = text.count("points");
      const auto numbers = text.numbers("position_mm", 3 * count, text.word(), -1e4, 1e4);
      surface.points_mm = Eigen::Map<const Eigen::Matrix3Xd>(numbers.data(), 3, count);
    } else if (key == "VERTICES" || key == "LINES" || key == "POLYGONS" || key == "TRIANGLE_STRIPS") {
      for (const auto& cell : readCells(text, surface.points_mm.cols())) {
        if (key == "POLYGONS" && cell.size() >= 3) surface.polygons.push_back(cell);
        for (std::size_t i = 0; key == "TRIANGLE_STRIPS" && i + 3 <= cell.size(); ++i) {
          surface.polygons.emplace_back(&cell[i], &cell[i] + 3);
        }
      }
    } else {
      text.refuse("keyword", key, "must be POINTS, VERTICES, LINES, POLYGONS or TRIANGLE_STRIPS");
    }
  }
  return surface;
}

}  // namespace angio::volume
