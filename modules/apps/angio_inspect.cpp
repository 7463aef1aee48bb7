// SPDX-License-Identifier: GPL-2.0-or-later
// angio-inspect: what a file holds, in a person's words.
#include <algorithm>
#include <iostream>
#include <set>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/xa_files.hpp"
#include "angio/vessel/model_id.hpp"
#include "inspect.hpp"

namespace angio::apps {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string file, out;
  int frame = 0;
  bool json = false;
};

std::vector<Finding> inspectImage(const std::string& path, int frame) {
  const XrayFrames frames(path);
  const cv::Mat image = frames.frame(frame);
  const int bits = 8 * static_cast<int>(image.elemSize());
  return {{"frames", std::to_string(frames.count()), "frames", frames.count()},
          {"size",
           std::to_string(image.cols) + " x " + std::to_string(image.rows) + " px",
           "image_size_px",
           {image.cols, image.rows}},
          {"bits", std::to_string(bits), "bits_stored", bits}};
}

std::vector<Finding> inspectTree(const std::string& path) {
  const VesselTree tree = readVesselTree(path);
  const Eigen::Vector3d low_mm = 1e3 * tree.points().rowwise().minCoeff();
  const Eigen::Vector3d high_mm = 1e3 * tree.points().rowwise().maxCoeff();
  const auto known =
      std::count_if(tree.radii().begin(), tree.radii().end(), [](const auto& r) { return r.has_value(); });
  std::vector<Finding> found = {
      {"points", std::to_string(tree.size()), "points", tree.size()},
      {"branches", std::to_string(tree.branches().size()), "branches", tree.branches().size()},
      {"length", inWords(1e3 * tree.length(), "mm"), "length_mm", 1e3 * tree.length()},
      {"radii", std::to_string(known) + " known", "known_radii", known}};
  const auto id = static_cast<std::int64_t>(modelId(tree));
  found.push_back({"model id", std::to_string(id) + " in messages", "model_id", id});
  for (const int axis : {0, 1, 2}) {
    const std::string name(1, "xyz"[axis]);
    found.push_back({name,
                     inWords(low_mm[axis], "to ") + inWords(high_mm[axis], "mm"),
                     name + "_mm",
                     {low_mm[axis], high_mm[axis]}});
  }
  return found;
}

std::vector<Finding> inspectCamera(const std::string& path) {
  const XrayCamera::Parameters p = readCamera(path).parameters();
  std::vector<Finding> found = {
      {"size",
       std::to_string(p.width_px) + " x " + std::to_string(p.height_px) + " px",
       "image_size_px",
       {p.width_px, p.height_px}},
      {"focal length", inWords(p.fx_px, "px, ") + inWords(p.fy_px, "px"), "focal_length_px", {p.fx_px, p.fy_px}},
      {"principal point", inWords(p.cx_px, "px, ") + inWords(p.cy_px, "px"), "principal_point_px", {p.cx_px, p.cy_px}}};
  const auto add = [&](const char* label, const char* key, const std::optional<double>& length_m) {
    if (length_m) found.push_back({label, inWords(1e3 * *length_m, "mm"), key, 1e3 * *length_m});
  };
  add("pixel", "pixel_spacing_mm", p.pixel_spacing_m);
  add("source-detector", "source_detector_distance_mm", p.source_detector_distance_m);
  return found;
}

std::string endingOf(const std::string& path) {
  const auto dot = path.find_last_of('.');
  std::string ending = dot == std::string::npos || path.find('/', dot) != std::string::npos ? "" : path.substr(dot + 1);
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return ending;
}

// Trees and cameras go by their names, as everywhere; pictures and runs by what they hold.
std::vector<Finding> inspectFile(const Options& o) {
  const std::string ending = endingOf(o.file);
  const bool camera = ending == "yaml" || ending == "yml" || ending == "xml";
  const bool tree = std::set<std::string>{"csv", "swc", "vtp", "vtk", "txt"}.count(ending) > 0;
  if ((camera || tree) && !o.out.empty()) throw InputError(o.file, "--out", o.out, "there is no picture in this file");
  if (camera) return inspectCamera(o.file);
  if (tree) return inspectTree(o.file);
  auto found = isDicom(o.file) ? inspectRun(o.file, o.frame) : inspectImage(o.file, o.frame);
  if (!o.out.empty()) writeImage(o.out, readXrayImage(o.file, o.frame));
  return found;
}

void printJson(const std::vector<Finding>& found) {
  Json json;
  Json assumed = Json::array();
  for (const Finding& one : found) {
    if (one.key == "assumed") {
      assumed.push_back(one.value);
    } else {
      json[one.key] = one.value;
    }
  }
  json["assumed"] = assumed;
  // A file's letters need not be UTF-8.
  std::cout << json.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
}

void printTable(const std::vector<Finding>& found) {
  std::size_t width = 0;
  for (const Finding& one : found) width = std::max(width, one.label.size());
  for (const Finding& one : found) {
    std::string words = one.words;
    std::replace_if(
        words.begin(), words.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
    std::cout << one.label << std::string(width + 2 - one.label.size(), ' ') << words << "\n";
  }
}

int inspect(const Options& o) {
  const std::vector<Finding> found = inspectFile(o);
  if (o.json) {
    printJson(found);
  } else {
    printTable(found);
  }
  return 0;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  CLI::App app("Says what a DICOM run, an X-ray image, a vessel tree or a camera file holds.", "angio-inspect");
  angio::apps::describeProgram(app, "angio-inspect run.dcm --frame 12 --out frame.png");
  angio::apps::Options o;
  app.add_option("file", o.file, "DICOM run, .png, .tif; tree (.csv, .swc, .vtp, .vtk, HMM .txt); camera (.yaml, .xml)")
      ->required();
  app.add_option("--frame", o.frame, "Frame of a run or of a TIFF, from 0")->check(CLI::Range(0, 1000000));
  app.add_flag("--json", o.json, "JSON instead of columns");
  app.add_option("--out", o.out, "Picture of the frame (.png, .tif, .jpg), as the camera sees it");
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::inspect(o); });
}
