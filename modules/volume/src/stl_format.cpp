// SPDX-License-Identifier: GPL-2.0-or-later
#include "stl_format.hpp"

#include <vtkCellArray.h>
#include <vtkNew.h>
#include <vtkPoints.h>

#include <array>
#include <charconv>
#include <cstring>
#include <map>
#include <string_view>

#include "angio/base/errors.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::volume {
namespace {

constexpr std::size_t kMaxStl = std::size_t{256} << 20;
constexpr std::size_t kHeader = 84, kTriangle = 50;  // Bytes.

using Corner = std::array<float, 3>;

class Surface {
 public:
  void add(const std::array<Corner, 3>& triangle) {
    vtkIdType corners[3];
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [place, fresh] = point_at_.emplace(triangle[k], points_->GetNumberOfPoints());
      if (fresh) points_->InsertNextPoint(triangle[k].data());
      corners[k] = place->second;
    }
    triangles_->InsertNextCell(3, corners);
  }

  vtkSmartPointer<vtkPolyData> done() {
    const auto result = vtkSmartPointer<vtkPolyData>::New();
    result->SetPoints(points_);
    result->SetPolys(triangles_);
    return result;
  }

 private:
  vtkNew<vtkPoints> points_;
  vtkNew<vtkCellArray> triangles_;
  std::map<Corner, vtkIdType> point_at_;
};

// The number behind a word of the text, which moves on.
float nextNumber(const std::string& path, std::string_view& text) {
  constexpr const char* kBlanks = " \t\r\n";
  text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
  const std::string_view word = text.substr(0, text.find_first_of(kBlanks));
  float value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) {
    throw InputError(path, "vertex", std::string(word.substr(0, 40)), "must be a number");
  }
  text.remove_prefix(word.size());
  return value;
}

void readText(const std::string& path, std::string_view text, Surface& surface) {
  std::array<Corner, 3> triangle;
  std::size_t corners = 0;
  for (auto at = text.find("vertex"); at != std::string_view::npos; at = text.find("vertex")) {
    text.remove_prefix(at + 6);
    for (float& x : triangle[corners % 3]) x = nextNumber(path, text);
    if (++corners % 3 == 0) surface.add(triangle);
  }
  if (corners % 3 != 0 || text.find("endsolid") == std::string_view::npos) {
    throw InputError(path, "triangles", std::to_string(corners / 3), "the file ends within them");
  }
}

}  // namespace

vtkSmartPointer<vtkPolyData> readStl(const std::string& path) {
  const std::string content = readWholeFile(path, kMaxStl);
  Surface surface;
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
      surface.add(triangle);
    }
  } else if (content.compare(0, 5, "solid") == 0) {
    readText(path, content, surface);
  } else {
    throw InputError(path, "bytes", std::to_string(content.size()),
                     "must be those of the triangles that the header counts");
  }
  return surface.done();
}

}  // namespace angio::volume
