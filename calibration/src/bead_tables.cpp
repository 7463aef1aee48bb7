// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/bead_tables.hpp"

#include <algorithm>

#include "angio/base/errors.hpp"
#include "angio/io/table.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::calibration {
namespace {

constexpr double kLargest_px = 32768;
constexpr int kMaxBeads = 2000;

std::optional<double> positiveIn(const TableRow& row, const char* column) {
  if (!row.has(column)) return std::nullopt;
  const auto value = row.numberOrBlank(column);
  if (value) requirePositive(row.place(), column, *value);
  return value;
}

}  // namespace

std::vector<BeadDetection> readBeadTable(const std::string& path) {
  std::vector<BeadDetection> beads;
  readTable(path, {{"x_px", "y_px"}, {"sigma_px", "radius_px", "contrast", "bead"}}, [&](const TableRow& row) {
    BeadDetection seen;
    const auto position = [&](const char* column) {
      return requireBetween(row.place(), column, row.number(column), -0.5, kLargest_px);
    };
    seen.center_px = {position("x_px"), position("y_px")};
    seen.std_px = positiveIn(row, "sigma_px").value_or(1);
    seen.radius_px = positiveIn(row, "radius_px");
    seen.contrast = positiveIn(row, "contrast");
    if (row.has("bead") && !row.text("bead").empty()) {
      seen.bead = row.integer("bead");
      requireBetween(row.place(), "bead", *seen.bead, 0, kMaxBeads - 1);
    }
    if (!beads.empty() && beads.front().bead.has_value() != seen.bead.has_value()) {
      throw InputError(row.place(), "bead", std::string(row.text("bead")), "must be given for all beads or for none");
    }
    if (beads.size() == kMaxBeads) throw InputError(row.place(), "", "", "there must not be more than 2000 beads");
    beads.push_back(seen);
  });
  return beads;
}

void writeBeadTable(const std::string& path, const std::vector<BeadDetection>& beads) {
  const auto any = [&](const auto& has) { return std::any_of(beads.begin(), beads.end(), has); };
  const bool radius = any([](const BeadDetection& b) { return b.radius_px.has_value(); });
  const bool contrast = any([](const BeadDetection& b) { return b.contrast.has_value(); });
  const bool bead = any([](const BeadDetection& b) { return b.bead.has_value(); });
  std::string text = std::string("x_px,y_px,sigma_px") + (radius ? ",radius_px" : "") + (contrast ? ",contrast" : "") +
                     (bead ? ",bead" : "") + "\n";
  const auto orBlank = [](const std::optional<double>& value) { return value ? exact(*value) : std::string(); };
  for (const BeadDetection& b : beads) {
    text += exact(b.center_px.x()) + "," + exact(b.center_px.y()) + "," + exact(b.std_px);
    if (radius) text += "," + orBlank(b.radius_px);
    if (contrast) text += "," + orBlank(b.contrast);
    if (bead) text += "," + (b.bead ? std::to_string(*b.bead) : std::string());
    text += "\n";
  }
  writeWholeFile(path, text);
}

}  // namespace angio::calibration
