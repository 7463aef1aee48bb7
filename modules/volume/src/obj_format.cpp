// SPDX-License-Identifier: GPL-2.0-or-later
// Wavefront OBJ: a keyword a line; "v x y z" is a point, "f" a polygon of numbers of points from 1, or from -1, the
// last one before it. A corner's texture and normal stand behind its point and a slash.
#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "surface_formats.hpp"

namespace angio::volume {
namespace {

constexpr double kMaxObj_mm = 1e4;

int cornerOf(const std::string& place, std::string_view word, std::size_t points) {
  const int number = parseInteger(place, "corner", word.substr(0, word.find('/')));
  const auto last = static_cast<int>(points);
  const int corner = number > 0 ? number - 1 : last + number;
  if (number == 0 || corner < 0 || corner >= last) {
    throw InputError(place, "corner", std::to_string(number), "must be a point above it, of " + std::to_string(last));
  }
  return corner;
}

}  // namespace

Surface readObjSurface(const std::string& path) {
  const std::string content = readWholeFile(path, kMaxTextFile);
  std::vector<Eigen::Vector3d> points_mm;
  Surface surface;
  for (TextLines lines(path, content); lines.next();) {
    std::string_view rest = lines.text();
    const std::string_view keyword = nextWord(rest);
    if (keyword == "v") {
      Eigen::Vector3d& p_mm = points_mm.emplace_back();
      for (double& x : p_mm) {
        x = requireBetween(lines.place(), "position_mm", parseNumber(lines.place(), "position_mm", nextWord(rest)),
                           -kMaxObj_mm, kMaxObj_mm);
      }
    } else if (keyword == "f") {
      std::vector<int>& polygon = surface.polygons.emplace_back();
      for (std::string_view word = nextWord(rest); !word.empty(); word = nextWord(rest)) {
        polygon.push_back(cornerOf(lines.place(), word, points_mm.size()));
      }
      if (polygon.size() < 3) {
        throw InputError(lines.place(), "corners", std::to_string(polygon.size()), "must be at least 3");
      }
    }
    if (points_mm.size() > static_cast<std::size_t>(kMaxPoints)) {
      throw InputError(lines.place(), "points", std::to_string(points_mm.size()),
                       "must be at most " + std::to_string(kMaxPoints));
    }
  }
  surface.points_mm.resize(3, static_cast<Eigen::Index>(points_mm.size()));
  for (std::size_t i = 0; i < points_mm.size(); ++i) surface.points_mm.col(static_cast<Eigen::Index>(i)) = points_mm[i];
  return surface;
}

}  // namespace angio::volume
