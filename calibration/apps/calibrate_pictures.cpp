// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate camera with pictures: cameras from raw pictures of an undistortion grid and of equal beads.
#include "calibrate_pictures.hpp"

#include <algorithm>
#include <array>
#include <iostream>
#include <map>
#include <opencv2/core.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/calibration/grid_distortion.hpp"
#include "angio/calibration/grid_pictures.hpp"
#include "angio/calibration/picture_views.hpp"
#include "angio/calibration/plated_cameras.hpp"
#include "angio/calibration/view_set.hpp"
#include "angio/cli/further_options.hpp"
#include "angio/cli/program.hpp"
#include "angio/evaluation/report_html.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/mayacam_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::apps {
namespace {

const std::map<std::string, double> kLengthUnits_m = {{"mm", 1e-3}, {"cm", 1e-2}, {"m", 1}, {"in", 0.0254}};

// One camera with its pictures, and what came of them.
struct PictureCamera {
  std::vector<std::size_t> pictures;  // Among those of the command line.
  std::string grid_path;              // Empty: none.
  std::optional<HoleGrid> grid;
  std::optional<GridDistortion> distortion;
  cv::Mat grid_image;
  std::vector<cv::Mat> images;
  std::vector<PictureView> views;
  CameraViews seen;
  std::optional<CameraCalibration> result;
};

// All cameras of the command line.
struct PictureCameras {
  std::vector<PictureCamera> cameras;
  std::vector<BuildTrial> trials;  // Ways to put the phantom together that were tried.
  PhantomBuild build = PhantomBuild::kOnePiece;
};

constexpr std::array<std::pair<PhantomBuild, const char*>, 4> kBuilds{{{PhantomBuild::kOnePiece, "none"},
                                                                       {PhantomBuild::kPlatesAlongX, "x"},
                                                                       {PhantomBuild::kPlatesAlongY, "y"},
                                                                       {PhantomBuild::kPlatesAlongZ, "z"}}};

std::optional<PhantomBuild> buildNamed(const std::string& name) {
  for (const auto& [build, word] : kBuilds) {
    if (name == word) return build;
  }
  return std::nullopt;
}

cv::Mat readPictureFile(const std::string& path, bool mirrored) {
  cv::Mat image = readXrayImage(path);
  if (mirrored) cv::flip(image, image, 1);
  return image;
}

std::optional<double> phantomUnit_m(const PictureOptions& o) {
  return o.phantom_unit.empty() ? std::nullopt : std::optional(kLengthUnits_m.at(o.phantom_unit));
}

PictureHint hintOf(const PictureOptions& o, std::size_t picture) {
  PictureHint hint;
  hint.any_reading = o.any_reading;
  if (!o.known_beads.empty()) {
    hint.known_beads = readBeadTable(o.known_beads[picture]);
    if (!hint.known_beads.front().bead) {
      throw InputError(o.known_beads[picture], "bead", "", "is missing: each row must say which bead it is");
    }
  }
  if (o.near.empty()) return hint;
  const std::string& path = o.near[picture];
  const bool maya = hasExtension(path, ".txt") || hasExtension(path, ".csv");
  hint.T_near = maya ? readMayaCam(path, phantomUnit_m(o).value_or(kMayaCamUnit_m)).T_camera_world
                     : readPose(path).T_camera_model;
  return hint;
}

void seeGrid(const PictureOptions& o, PictureCamera& camera) {
  if (camera.grid_path.empty()) return;
  camera.grid_image = readPictureFile(camera.grid_path, o.mirrored);
  const GridShape shape = o.grid_shape == "square" ? GridShape::kSquare : GridShape::kHexagonal;
  camera.grid = findHoleGrid(camera.grid_path, camera.grid_image, shape);
  camera.distortion = fitGridDistortion(camera.grid_path, *camera.grid);
}

void see(const PictureOptions& o, const CameraSections& settings, const BeadPhantom& phantom, PictureCamera& camera) {
  seeGrid(o, camera);
  DetectorOfViews& detector = camera.seen.detector;
  if (camera.distortion) {
    detector = {camera.grid->width_px,
                camera.grid->height_px,
                {},
                camera.distortion->distortion,
                camera.distortion->term_covariance_px2,
                true};
  }
  const BeadDetectionSettings shadows =
      camera.distortion ? settings.detection.throughIntensifier() : settings.detection;
  for (const std::size_t p : camera.pictures) {
    const std::string& path = o.pictures[p];
    camera.images.push_back(readPictureFile(path, o.mirrored));
    const cv::Mat& image = camera.images.back();
    if (detector.width_px == 0) std::tie(detector.width_px, detector.height_px) = std::pair(image.cols, image.rows);
    if (image.cols != detector.width_px || image.rows != detector.height_px) {
      throw InputError(
          path, "image size", std::to_string(image.cols) + " x " + std::to_string(image.rows),
          formatted("must be %d x %d, as the camera's other pictures", detector.width_px, detector.height_px));
    }
    camera.views.push_back(readPicture(path, image, phantom, detector.distortion, shadows, hintOf(o, p)));
    camera.seen.views.push_back(camera.views.back().view);
  }
}

PictureCameras calibrated(const PictureOptions& o, const CameraSections& settings, const BeadPhantom& phantom,
                          std::vector<PictureCamera> cameras) {
  std::vector<CameraViews> seen;
  for (PictureCamera& camera : cameras) {
    see(o, settings, phantom, camera);
    seen.push_back(camera.seen);
  }
  // Readings that are any of those that fit do not name the plates of several pictures alike.
  const bool one_frame = !o.any_reading;
  const bool one_piece = o.any_reading && std::any_of(seen.begin(), seen.end(), [](const CameraViews& camera) {
                           return camera.views.size() > 1;
                         });
  const auto build = one_piece ? std::optional(PhantomBuild::kOnePiece) : buildNamed(o.plates);
  PlatedCameras found = calibrateCameras(phantom, seen, settings.camera, build, o.plate_tolerance_mm, one_frame);
  for (std::size_t c = 0; c < cameras.size(); ++c) cameras[c].result = std::move(found.cameras[c]);
  return {std::move(cameras), found.trials, found.build};
}

std::string buildText(const PictureCameras& all) {
  std::vector<std::vector<std::string>> rows{
      {"plates along", "rms px", "beads left out, rms px", "with the other camera's shifts, rms px", ""}};
  for (const BuildTrial& trial : all.trials) {
    const auto name =
        std::find_if(kBuilds.begin(), kBuilds.end(), [&](const auto& b) { return b.first == trial.build; });
    rows.push_back({name->second, formatted("%.3f", trial.rms_px), formatted("%.3f", trial.left_out_rms_px),
                    trial.other_rms_px > 0 ? formatted("%.3f", trial.other_rms_px) : "-",
                    trial.build == all.build ? "taken" : ""});
  }
  return markdownTable(rows);
}

std::string gridTable(const PictureCamera& camera) {
  const GridDistortion& d = *camera.distortion;
  std::string text = formatted("grid %s: %d holes with a place, %d fitted, %zu outliers, pitch about %.2f px\n",
                               camera.grid_path.c_str(), d.found, d.used, d.outliers.size(), camera.grid->pitch_px);
  text += formatted(
      "distortion: %.2f px rms, %.1f at most; polynomial of order %d; residual %.3f px rms; %d holes held "
      "out %.3f px rms, %.2f at most; chosen by others:",
      d.displacement_rms_px, d.displacement_max_px, d.order, d.residual_rms_px, d.held_out, d.held_out_rms_px,
      d.held_out_max_px);
  for (std::size_t k = 2; k < d.choice_rms_px.size(); ++k) text += formatted(" %zu: %.3f", k + 1, d.choice_rms_px[k]);
  return text +
         "\nthe grid tells neither scale, turn nor shift of the pinhole image: it is the one nearest to the picture\n";
}

std::string viewsText(const PictureCamera& camera) {
  std::string text;
  for (std::size_t v = 0; v < camera.views.size(); ++v) {
    const PictureView& view = camera.views[v];
    text += formatted(
        "%s: %zu detections, %zu beads named, %d more in the open field not seen; readings that fit "
        "equally well: %zu\n",
        view.view.name.c_str(), view.detections.size(), view.view.beads.size(), view.reading.unseen, view.readings);
    const CalibratedView& calibrated = camera.result->views[v];
    if (calibrated.covariance) {
      text += transformRow("T_camera_phantom", calibrated.T_camera_phantom, *calibrated.covariance);
    }
  }
  return text;
}

std::string cameraText(const PictureCamera& camera) {
  const std::string grid = camera.distortion ? gridTable(camera) : "";
  return grid + cameraTable(*camera.result) + viewsText(camera);
}

void writeCamera(const PictureOptions& o, std::size_t number, const PictureCamera& camera) {
  const CameraCalibration& result = *camera.result;
  if (!o.out.empty()) {
    std::vector<CalibrationInput> inputs = {hashedInput(o.phantom)};
    if (!camera.grid_path.empty()) inputs.push_back(hashedInput(camera.grid_path));
    for (const std::size_t p : camera.pictures) inputs.push_back(hashedInput(o.pictures[p]));
    writeCalibratedCamera(o.out[number], result, "", inputs);
  }
  for (std::size_t v = 0; v < camera.pictures.size(); ++v) {
    const CalibratedView& view = result.views[v];
    if (!o.out_poses.empty()) writePose(o.out_poses[camera.pictures[v]], {view.T_camera_phantom, view.covariance});
    if (!o.mayacam.empty()) {
      writeMayaCam(o.mayacam[camera.pictures[v]], {result.camera.camera, view.T_camera_phantom},
                   phantomUnit_m(o).value_or(kMayaCamUnit_m));
    }
  }
}

std::string relativeText(const PictureOptions& o, const std::vector<PictureCamera>& cameras) {
  if (cameras.size() != 2 || o.any_reading) return "";
  const CalibratedView &first = cameras[0].result->views[0], &second = cameras[1].result->views[0];
  if (!first.covariance || !second.covariance) return "";
  const RelativePose relative = relativePose(first, second, cameras[0].result->plates);
  if (!o.relative.empty()) writePose(o.relative, {relative.T_second_first, relative.covariance});
  const Pose& T = relative.T_second_first;
  return transformRow("T_second_first", T, relative.covariance) +
         formatted("sources %.2f mm apart, turned by %.3f deg\n", 1e3 * T.translation().norm(),
                   radToDeg(rotationAngle(T.linear())));
}

void writePictureReport(const PictureOptions& o, const std::vector<PictureCamera>& cameras) {
  std::vector<ReportSection> all;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const PictureCamera& camera = cameras[c];
    const std::string prefix = cameras.size() > 1 ? formatted("camera-%zu-", c + 1) : "";
    if (camera.distortion) {
      all.push_back(
          {"Grid " + camera.grid_path,
           printed(gridTable(camera)),
           {{prefix + "grid.png", "Holes, and from each the way to its place in the regular grid; red: outliers",
             gridOverlay(*camera.grid, *camera.distortion, camera.grid_image), c == 0}}});
    }
    std::vector<ReportSection> sections = cameraSections(*camera.result, camera.images, prefix);
    sections[1].text_html += printed(viewsText(camera));
    all.insert(all.end(), sections.begin(), sections.end());
  }
  writeReport(o.report, "Camera calibration", o.phantom, all);
}

std::vector<PictureCamera> camerasOf(const PictureOptions& o) {
  const bool each = o.grids.size() > 1;
  std::vector<PictureCamera> cameras(each ? o.pictures.size() : 1);
  for (std::size_t p = 0; p < o.pictures.size(); ++p) cameras[each ? p : 0].pictures.push_back(p);
  for (std::size_t c = 0; c < o.grids.size(); ++c) cameras[c].grid_path = o.grids[c];
  return cameras;
}

}  // namespace

void addPictureOptions(cli::Command& command, PictureOptions& o) {
  command.addOption("--phantom", o.phantom,
                    "Of pictures: the beads (.csv: x_mm,y_mm,z_mm, or x,y,z in --phantom-unit)");
  command.addOption("--phantom-unit", o.phantom_unit, "Unit of a phantom's x,y,z")
      ->check(cli::oneOf({"mm", "cm", "m", "in"}));
  const auto addEach = [&](const char* name, std::vector<std::string>& files, const char* help) {
    return command.addOption(name, files, help)->oneAtATime();
  };
  addEach("--grid", o.grids, "Picture of the undistortion grid; one for each picture: a camera of each");
  command.addOption("--grid-shape", o.grid_shape, "Of the grid's holes")
      ->check(cli::oneOf({"hexagonal", "square"}))
      ->group(cli::kFurtherOptions);
  addEach("--known-beads", o.known_beads, "Beads that are known (.csv: x_px,y_px,bead), one file for each picture");
  addEach("--near", o.near, "The phantom's pose, roughly (pose .yaml, MayaCam .txt, .csv), one for each picture")
      ->group(cli::kFurtherOptions);
  command.addFlag("--any-reading", o.any_reading, "K alone is wanted: of readings that fit equally well take any");
  command
      .addOption("--phantom-plates", o.plates,
                 "Axis along which the phantom is stacked of plates, which may be shifted; found: what explains "
                 "beads that are left out best")
      ->check(cli::oneOf({"found", "none", "x", "y", "z"}))
      ->group(cli::kFurtherOptions);
  command
      .addOption("--plate-tolerance-mm", o.plate_tolerance_mm, "Standard deviation of a plate's shift along each axis")
      ->check(between(0.001, 10))
      ->group(cli::kFurtherOptions);
  command.addFlag("--mirrored", o.mirrored, "The pictures are mirrored: flip them, left to right, first");
  addEach("--out-pose", o.out_poses, "The phantom's pose with its covariance (.yaml), one for each picture");
  addEach("--mayacam", o.mayacam,
          "Camera and pose for XMALab and Autoscoper (.txt: MayaCam 2.0, .csv: 1.0), in the "
          "phantom's unit, one for each picture")
      ->group(cli::kFurtherOptions);
  command.addOption("--relative", o.relative, "Of two cameras: pose of the first's frame in the second's (.yaml)");
}

void checkPictureOptions(const PictureOptions& o, const std::vector<std::string>& pictures,
                         const std::vector<std::string>& out) {
  if (o.phantom.empty()) cli::refuseWithout("--phantom");
  const std::size_t cameras = o.grids.size() > 1 ? o.grids.size() : 1;
  const auto check = [](const char* option, std::size_t given, std::size_t wanted) {
    if (given == 0 || given == wanted) return;
    cli::refuseValue(option, std::to_string(given) + " given, must be " + std::to_string(wanted));
  };
  if (cameras > 1) check("--grid", cameras, pictures.size());
  check("--out", out.size(), cameras);
  for (const auto& [option, files] : {std::pair("--known-beads", &o.known_beads), std::pair("--near", &o.near),
                                      std::pair("--out-pose", &o.out_poses), std::pair("--mayacam", &o.mayacam)}) {
    check(option, files->size(), pictures.size());
  }
  if (!o.relative.empty() && cameras != 2) cli::refuseValue("--relative", "needs two cameras: two pictures, two grids");
  if (!o.relative.empty() && o.any_reading) cli::refuseBoth("--relative", "--any-reading");
}

int runPictures(const PictureOptions& o, const CameraSections& settings) {
  const ClaimedOutputs claimed(o.relative, o.report);
  for (const auto* files : {&o.out, &o.out_poses, &o.mayacam}) {
    for (const std::string& file : *files) requireFolderOf(file);
  }
  const BeadPhantom phantom = readPointPhantom(o.phantom, phantomUnit_m(o));
  Stopwatch watch;
  const PictureCameras all = calibrated(o, settings, phantom, camerasOf(o));
  const std::vector<PictureCamera>& cameras = all.cameras;
  const double all_s = watch.seconds();
  for (std::size_t c = 0; c < cameras.size(); ++c) writeCamera(o, c, cameras[c]);
  if (!o.report.empty()) writePictureReport(o, cameras);
  for (const PictureCamera& camera : cameras) std::cout << cameraText(camera) << "\n";
  std::cout << buildText(all) << "\n" << relativeText(o, cameras) << formatted("time: %.2f s\n", all_s);
  return 0;
}

}  // namespace angio::apps
