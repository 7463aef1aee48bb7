// SPDX-License-Identifier: GPL-2.0-or-later
// angio-inspect: what a file holds, in a person's words.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/xa_files.hpp"
#include "angio/vessel/model_id.hpp"

namespace angio::apps {
namespace {

using Json = nlohmann::ordered_json;

// One thing a person wants to know of a file: for people a label and words, for programs a key with its unit and a
// value.
struct Finding {
  std::string label;
  std::string words;
  std::string key;
  nlohmann::ordered_json value;
};

// A number for people: four digits behind the point at most, and the unit after a blank.
std::string inWords(double number, const std::string& unit) {
  char text[64];
  std::snprintf(text, sizeof text, "%.4f", number == 0 ? 0.0 : number);
  std::string digits = text;
  digits.erase(digits.find_last_not_of('0') + 1);
  if (digits.back() == '.') digits.pop_back();
  return (digits == "-0" ? "0" : digits) + (unit.empty() ? "" : " " + unit);
}

const std::string kUnknown = "not said";

std::string orUnknown(const std::string& text) { return text.empty() ? kUnknown : text; }

Finding length(const std::string& label, const std::string& key, const std::optional<double>& length_m) {
  if (!length_m) return {label, kUnknown, key, nullptr};
  return {label, inWords(*length_m * 1e3, "mm"), key, *length_m * 1e3};
}

// "31.3 LAO": DICOM's signs in the words of the trade.
std::string beamInWords(double primary_rad, double secondary_rad, const char* const (&names)[4]) {
  const double primary_deg = radToDeg(primary_rad), secondary_deg = radToDeg(secondary_rad);
  return inWords(std::abs(primary_deg), names[primary_deg < 0]) + ", " +
         inWords(std::abs(secondary_deg), names[2 + (secondary_deg < 0)]);
}

void addPixels(const XaHeader& header, std::vector<Finding>& found) {
  const auto text = [&](const char* label, const char* key, const std::string& value) {
    found.push_back({label, orUnknown(value), key, value.empty() ? Json(nullptr) : Json(value)});
  };
  text("modality", "modality", header.modality);
  text("maker", "manufacturer", header.manufacturer);
  text("model", "model", header.model);
  found.push_back({"frames", std::to_string(header.frames), "frames", header.frames});
  found.push_back({"size",
                   std::to_string(header.width_px) + " x " + std::to_string(header.height_px) + " px",
                   "image_size_px",
                   {header.width_px, header.height_px}});
  found.push_back({"bits",
                   std::to_string(header.bits_stored) + " of " + std::to_string(header.bits_allocated) +
                       (header.is_signed ? ", signed" : ""),
                   "bits_stored", header.bits_stored});
  text("transfer syntax", "transfer_syntax", header.transfer_syntax);
  text("photometric", "photometric", header.photometric);
  text("grey level", "intensity_relationship", header.intensity_relationship);
  found.push_back({"frame rate", header.frame_rate_hz ? inWords(*header.frame_rate_hz, "Hz") : kUnknown,
                   "frame_rate_hz", header.frame_rate_hz ? Json(*header.frame_rate_hz) : Json(nullptr)});
  text("patient", "patient_position", header.patient_position);
  text("positioner", "positioner_motion", header.positioner_motion);
  text("table", "table_motion", header.table_motion);
}

void addMasks(const XaRun& run, std::vector<Finding>& found) {
  Json masks = Json::array();
  std::string words;
  for (const XaMask& mask : run.masks()) {
    masks.push_back({{"operation", mask.operation}, {"frames", mask.mask_frames}});
    words += (words.empty() ? "" : "; ") + mask.operation;
    for (const int frame : mask.mask_frames) words += " " + std::to_string(frame);
  }
  found.push_back({"mask frames", words.empty() ? "none" : words, "masks", masks});
}

void addAngles(const XaGeometry& g, std::vector<Finding>& found) {
  Finding patient{"patient-based", kUnknown, "patient_angles_deg", nullptr};
  if (g.patient_angles) {
    patient.words = beamInWords(g.patient_angles->primary_rad, g.patient_angles->secondary_rad,
                                {"deg LAO", "deg RAO", "deg CRA", "deg CAU"});
    patient.value = {radToDeg(g.patient_angles->primary_rad), radToDeg(g.patient_angles->secondary_rad)};
  }
  Finding isocenter{"isocentre-based", kUnknown, "isocentre_angles_deg", nullptr};
  if (g.isocenter_angles) {
    const IsocenterAngles& a = *g.isocenter_angles;
    isocenter.words = inWords(radToDeg(a.primary_rad), "deg") + ", " + inWords(radToDeg(a.secondary_rad), "deg") +
                      ", detector " + inWords(radToDeg(a.detector_rotation_rad), "deg");
    isocenter.value = {radToDeg(a.primary_rad), radToDeg(a.secondary_rad), radToDeg(a.detector_rotation_rad)};
  }
  found.push_back(patient);
  found.push_back(isocenter);
}

void addGeometry(const XaHeader& header, const XaGeometry& g, std::vector<Finding>& found) {
  found.push_back(
      {"time", g.time_s ? inWords(*g.time_s, "s") : kUnknown, "time_s", g.time_s ? Json(*g.time_s) : Json(nullptr)});
  addAngles(g, found);
  found.push_back(length("source-detector", "source_detector_distance_mm", g.source_detector_distance_m));
  found.push_back(length("source-isocentre", "source_isocentre_distance_mm", g.source_isocenter_distance_m));
  const XrayCamera::Parameters& p = g.camera.parameters();
  const double u_mm = g.source_detector_distance_m / p.fx_px * 1e3, v_mm = g.source_detector_distance_m / p.fy_px * 1e3;
  found.push_back(
      {"pixel", inWords(u_mm, "x ") + inWords(v_mm, "mm, by " + g.spacing_from), "pixel_spacing_mm", {u_mm, v_mm}});
  found.push_back({"focal length",
                   inWords(p.fx_px, "px") + (p.fx_px == p.fy_px ? "" : ", " + inWords(p.fy_px, "px")),
                   "focal_length_px",
                   {p.fx_px, p.fy_px}});
  if (g.source_isocenter_distance_m) {
    const double magnification = g.source_detector_distance_m / *g.source_isocenter_distance_m;
    const double width_mm = p.width_px * u_mm / magnification, height_mm = p.height_px * v_mm / magnification;
    found.push_back(
        {"magnification",
         inWords(magnification, "") +
             (header.magnification ? ", in the file " + inWords(*header.magnification, "") : ", not in the file"),
         "magnification", magnification});
    found.push_back({"field",
                     inWords(width_mm, "x ") + inWords(height_mm, "mm at the isocentre"),
                     "field_at_isocentre_mm",
                     {width_mm, height_mm}});
  }
  const Eigen::Vector3d shift_mm = 1e3 * g.table_shift_m;
  found.push_back({"table moved",
                   inWords(shift_mm.x(), "mm L, ") + inWords(shift_mm.y(), "mm P, ") + inWords(shift_mm.z(), "mm S"),
                   "table_shift_lps_mm",
                   {shift_mm.x(), shift_mm.y(), shift_mm.z()}});
  found.push_back({"stored image",
                   g.stored_mirrored ? "seen from the detector: mirrored for the camera"
                                     : "seen from the source: as the camera sees it",
                   "stored_mirrored", g.stored_mirrored});
}

// What a DICOM run says of itself and of one frame; no name or number of a patient.
std::vector<Finding> inspectRun(const std::string& path, int frame) {
  const XaRun run(path);
  const XaGeometry geometry = run.geometry(frame);
  std::vector<Finding> found;
  addPixels(run.header(), found);
  addMasks(run, found);
  found.push_back({"frame", std::to_string(frame), "frame", frame});
  addGeometry(run.header(), geometry, found);
  for (const std::string& line : geometry.assumed) found.push_back({"assumed", line, "assumed", line});
  return found;
}

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
