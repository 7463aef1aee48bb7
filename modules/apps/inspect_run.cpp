// SPDX-License-Identifier: GPL-2.0-or-later
#include <cmath>
#include <cstdio>

#include "angio/apps/namespace.hpp"
#include "angio/io/xa_files.hpp"
#include "inspect.hpp"

namespace angio::apps {
namespace {

using Json = nlohmann::ordered_json;

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

}  // namespace

std::string inWords(double number, const std::string& unit) {
  char text[64];
  std::snprintf(text, sizeof text, "%.4f", number == 0 ? 0.0 : number);
  std::string digits = text;
  digits.erase(digits.find_last_not_of('0') + 1);
  if (digits.back() == '.') digits.pop_back();
  return (digits == "-0" ? "0" : digits) + (unit.empty() ? "" : " " + unit);
}

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

}  // namespace angio::apps
