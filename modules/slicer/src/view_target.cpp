// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/slicer/view_target.hpp"

#include <array>
#include <cmath>
#include <cstdlib>
#include <sstream>

#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::slicer {
namespace {

struct Word {
  const char* name;
  std::size_t place;  // LAO, CRA, L, P, S.
  double sign, most;
};

constexpr double kMaxAngle_deg = 180, kMaxPlace_mm = 10'000;
constexpr Word kWords[] = {{"lao_deg", 0, 1, kMaxAngle_deg}, {"rao_deg", 0, -1, kMaxAngle_deg},
                           {"cra_deg", 1, 1, kMaxAngle_deg}, {"cau_deg", 1, -1, kMaxAngle_deg},
                           {"l_mm", 2, 1, kMaxPlace_mm},     {"r_mm", 2, -1, kMaxPlace_mm},
                           {"p_mm", 3, 1, kMaxPlace_mm},     {"a_mm", 3, -1, kMaxPlace_mm},
                           {"s_mm", 4, 1, kMaxPlace_mm},     {"i_mm", 4, -1, kMaxPlace_mm}};

const Word* wordOf(const std::string& name) {
  for (const Word& word : kWords) {
    if (name == word.name) return &word;
  }
  return nullptr;
}

}  // namespace

std::variant<ViewTarget, std::string> readViewTarget(const std::string& text) {
  std::array<std::optional<double>, 5> values;
  std::istringstream words(text);
  std::string name, number;
  while (words >> name) {
    const Word* word = wordOf(name);
    if (!word) return name + ": must be one of lao_deg, rao_deg, cra_deg, cau_deg, r_mm, l_mm, a_mm, p_mm, s_mm, i_mm";
    if (!(words >> number)) return name + ": needs a number";
    char* end = nullptr;
    const double value = std::strtod(number.c_str(), &end);
    if (end != number.c_str() + number.size() || !(std::abs(value) <= word->most)) {
      return name + " = " + number + ": must be a number of at most " + formatValue(word->most);
    }
    if (values[word->place]) return name + ": is said twice";
    values[word->place] = word->sign * value;
  }
  ViewTarget target;
  if (values[0].has_value() != values[1].has_value()) return "angles: must be both or none";
  if (values[0]) target.angles = ViewAngles{degToRad(*values[0]), degToRad(*values[1])};
  const int coordinates = values[2].has_value() + values[3].has_value() + values[4].has_value();
  if (coordinates != 0 && coordinates != 3) return "coordinates: must be all three or none";
  if (coordinates == 3) target.target_lps_m = 1e-3 * Eigen::Vector3d(*values[2], *values[3], *values[4]);
  if (!target.angles && !target.target_lps_m) return "a view: must have angles or coordinates";
  return target;
}

}  // namespace angio::slicer
