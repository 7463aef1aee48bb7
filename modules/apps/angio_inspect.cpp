// SPDX-License-Identifier: GPL-2.0-or-later
// angio-inspect: what a file holds, in a person's words.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/cli/bus_help.hpp"
#include "angio/cli/further_options.hpp"
#include "angio/cli/program.hpp"
#include "angio/conventions/xray_projection.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/xa_files.hpp"
#include "angio/io/yaml.hpp"
#include "angle_signs_option.hpp"
#include "findings.hpp"
#include "inspect_bus.hpp"
#include "inspect_conversion.hpp"
#include "inspect_tree.hpp"

namespace angio::apps {
namespace {

void addPixels(const XaHeader& header, Findings& found) {
  found.text("modality", "modality", header.modality);
  found.text("maker", "manufacturer", header.manufacturer);
  found.text("model", "model", header.model);
  found.count("frames", "frames", header.frames);
  found.size(header.width_px, header.height_px);
  const std::string of = " of " + std::to_string(header.bits_allocated) + (header.is_signed ? ", signed" : "");
  found.count("bits", "bits_stored", header.bits_stored, of.c_str());
  found.text("transfer syntax", "transfer_syntax", header.transfer_syntax);
  found.text("photometric", "photometric", header.photometric);
  found.text("grey level", "intensity_relationship", header.intensity_relationship);
  found.number("frame rate", "frame_rate_hz", header.frame_rate_hz, "Hz");
  found.text("patient", "patient_position", header.patient_position);
  found.text("positioner", "positioner_motion", header.positioner_motion);
  found.text("table", "table_motion", header.table_motion);
}

void addMasks(const XaRun& run, Findings& found) {
  Json masks = Json::array();
  std::string words;
  for (const XaMask& mask : run.masks()) {
    masks.push_back({{"operation", mask.operation}, {"frames", mask.mask_frames}});
    words += (words.empty() ? "" : "; ") + mask.operation;
    for (const int frame : mask.mask_frames) words += " " + std::to_string(frame);
  }
  found.add("mask frames", words.empty() ? "none" : words, "masks", masks);
}

void addAngles(const XaGeometry& g, Findings& found) {
  Finding patient{"patient-based", kUnknown, "patient_angles_deg", nullptr};
  if (const auto& a = g.patient_angles) {
    const double primary_deg = radToDeg(a->primary_rad), secondary_deg = radToDeg(a->secondary_rad);
    patient.words = beamInWords(primary_deg, secondary_deg);
    patient.value = {primary_deg, secondary_deg};
  }
  Finding isocenter{"isocentre-based", kUnknown, "isocentre_angles_deg", nullptr};
  if (const auto& a = g.isocenter_angles) {
    isocenter.words = inWords(radToDeg(a->primary_rad), "deg") + ", " + inWords(radToDeg(a->secondary_rad), "deg") +
                      ", detector " + inWords(radToDeg(a->detector_rotation_rad), "deg");
    isocenter.value = {radToDeg(a->primary_rad), radToDeg(a->secondary_rad), radToDeg(a->detector_rotation_rad)};
  }
  found.push_back(patient);
  found.push_back(isocenter);
}

void addGeometry(const XaHeader& header, const XaGeometry& g, Findings& found) {
  found.number("time", "time_s", g.time_s, "s");
  addAngles(g, found);
  found.length("source-detector", "source_detector_distance_mm", g.source_detector_distance_m);
  found.length("source-isocentre", "source_isocentre_distance_mm", g.source_isocenter_distance_m);
  const XrayCamera::Parameters& p = g.camera.parameters();
  const double u_mm = g.source_detector_distance_m / p.fx_px * 1e3, v_mm = g.source_detector_distance_m / p.fy_px * 1e3;
  found.add("pixel", inWords(u_mm, "x ") + inWords(v_mm, "mm, by " + g.spacing_from), "pixel_spacing_mm", {u_mm, v_mm});
  found.add("focal length", inWords(p.fx_px, "px") + (p.fx_px == p.fy_px ? "" : ", " + inWords(p.fy_px, "px")),
            "focal_length_px", {p.fx_px, p.fy_px});
  if (g.source_isocenter_distance_m) {
    const double magnification = g.source_detector_distance_m / *g.source_isocenter_distance_m;
    const double width_mm = p.width_px * u_mm / magnification, height_mm = p.height_px * v_mm / magnification;
    const std::string in_file =
        header.magnification ? ", in the file " + inWords(*header.magnification, "") : ", not in the file";
    found.add("magnification", inWords(magnification, "") + in_file, "magnification", magnification);
    found.add("field", inWords(width_mm, "x ") + inWords(height_mm, "mm at the isocentre"), "field_at_isocentre_mm",
              {width_mm, height_mm});
  }
  const Eigen::Vector3d shift_mm = 1e3 * g.table_shift_m;
  found.add("table moved",
            inWords(shift_mm.x(), "mm L, ") + inWords(shift_mm.y(), "mm P, ") + inWords(shift_mm.z(), "mm S"),
            "table_shift_lps_mm", {shift_mm.x(), shift_mm.y(), shift_mm.z()});
  found.add("stored image",
            g.stored_mirrored ? "seen from the detector: mirrored for the camera"
                              : "seen from the source: as the camera sees it",
            "stored_mirrored", g.stored_mirrored);
}

// Where source and detector are, in the patient's axes from the isocentre.
void addPlaces(const XrayProjection& projection, Findings& found) {
  const Eigen::Vector3d source_mm = 1e3 * sourceInModel(projection);
  found.add("source",
            inWords(source_mm.x(), "mm L, ") + inWords(source_mm.y(), "mm P, ") + inWords(source_mm.z(), "mm S"),
            "source_lps_mm", {source_mm.x(), source_mm.y(), source_mm.z()});
  Eigen::Matrix4d detector_mm = detectorInModel(projection);
  for (const int column : {0, 1, 3}) detector_mm.col(column).head<3>() *= 1e3;  // The third is a direction.
  Json rows = Json::array();
  for (int row = 0; row < 4; ++row) {
    rows.push_back({detector_mm(row, 0), detector_mm(row, 1), detector_mm(row, 2), detector_mm(row, 3)});
  }
  const Eigen::Vector3d corner_mm = detector_mm.topRightCorner<3, 1>();
  found.add("first pixel",
            inWords(corner_mm.x(), "mm L, ") + inWords(corner_mm.y(), "mm P, ") + inWords(corner_mm.z(), "mm S"),
            "detector_matrix_lps_mm", rows);
}

// A camera of one frame, which says where it comes from and what was assumed.
void writeRunCamera(const std::string& path, const std::string& run, int frame, const XaGeometry& geometry) {
  std::string said = "# Of " + withoutControls(std::filesystem::path(run).filename().string()) + ", frame " +
                     std::to_string(frame) + ", by its DICOM attributes; the image as angio-inspect --out writes it.\n";
  for (const std::string& line : geometry.assumed) said += "# Assumed: " + withoutControls(line) + "\n";
  writeWholeFile(path, said + asYaml(cameraAsJson({geometry.camera, {}, {}})));
}

// What a DICOM run says of itself and of one frame; no name or number of a patient.
Findings inspectRun(const std::string& path, int frame, const std::string& camera, XaAngleSigns signs) {
  const XaRun run(path, signs);
  const XaGeometry geometry = run.geometry(frame);
  Findings found;
  addPixels(run.header(), found);
  addMasks(run, found);
  found.count("frame", "frame", frame);
  addGeometry(run.header(), geometry, found);
  if (geometry.T_camera_patient) addPlaces({*geometry.T_camera_patient, geometry.camera}, found);
  for (const std::string& line : geometry.assumed) found.add("assumed", line, "assumed", line);
  if (!camera.empty()) writeRunCamera(camera, path, frame, geometry);
  return found;
}

struct Options {
  std::string file, out, write_camera, picture, calibration, write_urdf;
  int frame = 0;
  XaAngleSigns angle_signs = XaAngleSigns::kLaoCra;
  bool json = false;
  BusToInspect live;
  PoseToConvert conversion;
};

Findings inspectImage(const std::string& path, int frame) {
  const XrayFrames frames(path);
  const cv::Mat image = frames.frame(frame);
  Findings found;
  found.count("frames", "frames", frames.count());
  found.size(image.cols, image.rows);
  found.count("bits", "bits_stored", 8 * static_cast<int>(image.elemSize()));
  return found;
}

Findings inspectCamera(const std::string& path) {
  const XrayCamera::Parameters p = readCamera(path).parameters();
  Findings found;
  found.size(p.width_px, p.height_px);
  found.add("focal length", inWords(p.fx_px, "px, ") + inWords(p.fy_px, "px"), "focal_length_px", {p.fx_px, p.fy_px});
  found.add("principal point", inWords(p.cx_px, "px, ") + inWords(p.cy_px, "px"), "principal_point_px",
            {p.cx_px, p.cy_px});
  if (p.pixel_spacing_m) found.length("pixel", "pixel_spacing_mm", p.pixel_spacing_m);
  if (p.source_detector_distance_m) {
    found.length("source-detector", "source_detector_distance_mm", p.source_detector_distance_m);
  }
  return found;
}

std::string endingOf(const std::string& path) {
  const auto dot = path.find_last_of('.');
  std::string ending = dot == std::string::npos || path.find('/', dot) != std::string::npos ? "" : path.substr(dot + 1);
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return ending;
}

// Trees and cameras go by their names, as everywhere; pictures and runs by what they hold.
Inspected inspectFile(const Options& o) {
  const std::string ending = endingOf(o.file);
  const bool camera = ending == "yaml" || ending == "yml" || ending == "xml";
  const bool tree = std::set<std::string>{"csv", "swc", "vtp", "vtk", "txt", "tre", "json"}.count(ending) > 0 ||
                    std::filesystem::is_directory(o.file);
  if (!tree && !o.picture.empty()) throw InputError(o.file, "--picture", o.picture, "is of a vessel tree or of a bus");
  if (o.picture.empty() && !o.calibration.empty()) {
    throw InputError(o.file, "--calibration", o.calibration, "is for --picture of a vessel tree, or for --bus");
  }
  if ((camera || tree) && !o.out.empty()) throw InputError(o.file, "--out", o.out, "there is no picture in this file");
  if (!o.write_camera.empty() && (camera || tree || !isDicom(o.file))) {
    throw InputError(o.file, "--write-camera", o.write_camera,
                     "is of a DICOM run: other files do not say their camera");
  }
  if (camera) return {inspectCamera(o.file)};
  if (tree) return inspectTree({o.file, o.picture, o.calibration, o.json});
  auto found =
      isDicom(o.file) ? inspectRun(o.file, o.frame, o.write_camera, o.angle_signs) : inspectImage(o.file, o.frame);
  if (!o.out.empty()) writeImage(o.out, readXrayImage(o.file, o.frame));
  return {found};
}

void printJson(const Findings& found) {
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

void printTable(const Findings& found) {
  std::size_t width = 0;
  for (const Finding& one : found) width = std::max(width, one.label.size());
  for (const Finding& one : found) {
    std::cout << one.label << std::string(width + 2 - one.label.size(), ' ') << withoutControls(one.words) << "\n";
  }
}

int inspect(const Options& o) {
  for (const auto& path : {o.write_camera, o.picture, o.write_urdf}) requireFolderOf(path);
  if (!o.conversion.convention.empty()) {
    convertPose(o.conversion, o.file, o.frame, o.angle_signs, o.out, o.write_camera);
    return 0;
  }
  if (!o.write_urdf.empty()) {
    writeUrdf(o.file, o.write_urdf);
    return 0;
  }
  requireImagePath(o.out);
  BusToInspect live = o.live;
  live.calibration = o.calibration;
  live.picture = o.picture;
  const Inspected told = live.bus.empty() ? inspectFile(o) : Inspected{inspectBus(live)};
  if (o.json) {
    printJson(told.found);
  } else {
    printTable(told.found);
    std::cout << told.table;
  }
  return 0;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app(
      "Says what a DICOM run, an X-ray image, a vessel tree, a camera file or a bus's newest frame holds.",
      "angio-inspect");
  angio::apps::describeProgram(app, "angio-inspect run.dcm --frame 12 --out frame.png");
  angio::apps::Options o;
  auto* file = app.addOption(
      "file", o.file,
      "DICOM run, .png, .tif, .jpg; tree (.csv, .swc, .vtp, .vtk, .mrk.json or a folder of them, .tre, HMM "
      ".txt); camera (.yaml, .xml); with --convert-pose a pose or a projection (.yaml), an RTK geometry "
      "(.xml), an ITK transform (.tfm) or a DICOM run");
  app.addOption("--frame", o.frame, "Frame of a run or of a TIFF, projection of an RTK geometry, from 0")
      ->check(angio::cli::wholeBetween(0, 1000000))
      ->needs(file);
  app.addFlag("--json", o.json, "JSON instead of columns");
  app.addOption("--out", o.out,
                "Picture of the frame (.png, .tif, .jpg), as the camera sees it; what --convert-pose makes")
      ->needs(file);
  app.addOption("--write-camera", o.write_camera,
                "Camera of a DICOM run's frame (.yaml): K, pixel and source-detector distance, and what is assumed; "
                "with --convert-pose the camera of the projection")
      ->needs(file);
  angio::apps::addAngleSignsOption(app, o.angle_signs)->needs(file)->group(angio::cli::kFurtherOptions);
  auto* bus =
      app.addOption("--bus", o.live.bus,
                    angio::cli::busHelp("Newest X-ray frame of a bus") + "; file://name.lcm?speed=0: a log's last one")
          ->excludes(file);
  auto* tree = app.addOption("--tree", o.live.tree, "With --bus: vessel tree")->needs(bus);
  auto* calibration =
      app.addOption("--calibration", o.calibration,
                    "C-arm geometry and T_dsa_cb (.yaml); for a tree's picture how the patient lies (R_lps_model)");
  bus->needs(tree)->needs(calibration);
  app.addOption("--picture", o.picture,
                "Of a tree: its branches from the front and from the side with the numbers that --to-branch takes "
                "(.svg, .png), and a table of them. With --bus: the frame with the tree by joints and calibration, and "
                "where in the patient its edges should be");
  app.addOption("--wait-s", o.live.wait_s, "With --bus: for a frame and joints, at most")
      ->check(angio::apps::between(0.01, 3600))
      ->needs(bus);
  angio::apps::addConversionOptions(app, o.conversion, file);
  angio::apps::addUrdfOption(app, o.write_urdf, file);
  app.onRead([&] {
    if (o.file.empty() && o.live.bus.empty()) angio::cli::refuseWithout("file or --bus");
  });
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::inspect(o); });
}
