// SPDX-License-Identifier: GPL-2.0-or-later
// What each line found in an image shows, before any is dropped, for fit_line_evidence.py.
#include <algorithm>

#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/whole_file.hpp"
#include "line_evidence.hpp"
#include "make_extractors.hpp"

namespace angio::apps {
namespace {

// A row for every point of a line that is no device.
std::string tableOf(const std::vector<CentreLine>& lines, const WorkingGrid& grid) {
  std::string table = "line,x_px,y_px";
  for (const std::string_view term : kEvidenceTerms) table += "," + std::string(term);
  table += "\n";
  const float side = static_cast<float>(std::min(grid.size.width, grid.size.height));
  const std::vector<LineEvidence> evidence = evidenceOf(lines, side);
  for (std::size_t l = 0; l < lines.size(); ++l) {
    if (lines[l].kind == CurveKind::kDevice) continue;
    std::string terms;
    for (const float term : evidence[l].terms) terms += formatted(",%.4f", term);
    for (const cv::Point2f& p : lines[l].line) {
      const cv::Point2f at = grid.toImage(p);
      table += formatted("%zu,%.2f,%.2f", l, at.x, at.y) + terms + "\n";
    }
  }
  return table;
}

int writeTable(const std::string& image, const std::string& out) {
  std::string table;
  const auto extractor =
      imaging::make(RidgeSettings{}, [&](const auto& lines, const WorkingGrid& grid) { table = tableOf(lines, grid); });
  requireFolderOf(out);
  extractor->extract(readXrayImage(image));
  writeWholeFile(out, table);
  return 0;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app("Writes what each line found in an X-ray image shows, before any is dropped.",
                          "angio-line-evidence");
  angio::apps::describeProgram(app, "angio-line-evidence image.png --out evidence.csv");
  std::string image, out;
  app.addOption("image", image, "X-ray image (.png, .tif, .jpg)")->required();
  app.addOption("--out", out, "A row for each point (.csv): line, x_px, y_px, and the terms of the line's evidence")
      ->required();
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::writeTable(image, out); });
}
