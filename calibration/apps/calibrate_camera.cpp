// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate camera: K, and distortion, from views of a phantom or a grid.
#include <iostream>
#include <memory>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/calibration/camera_calibration.hpp"
#include "angio/calibration/view_set.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/text.hpp"
#include "calibrate.hpp"
#include "calibrate_pictures.hpp"
#include "camera_tables.hpp"
#include "outputs.hpp"

namespace angio::apps {
namespace {

struct CameraOptions {
  std::vector<std::string> views, out;
  std::string settings, report, distortion;
  bool square_pixels = false, skew = false;
  double noise_px = 0;
  PictureOptions pictures;
};

bool isViewSet(const std::string& path) { return hasExtension(path, ".yaml") || hasExtension(path, ".yml"); }

CameraSections settingsOf(const CameraOptions& o) {
  CameraSections sections;
  if (!o.settings.empty()) sections = readSettings(o.settings, sections);
  CameraCalibrationSettings& camera = sections.camera;
  if (o.distortion == "none") camera.distortion = LensKind::kNone;
  if (o.distortion == "radial") camera.distortion = LensKind::kRadial;
  if (o.distortion == "intensifier") camera.distortion = LensKind::kIntensifier;
  if (camera.distortion == LensKind::kIntensifier) sections.detection = sections.detection.throughIntensifier();
  camera.square_pixels |= o.square_pixels;
  camera.skew |= o.skew;
  if (o.noise_px > 0) camera.noise_px = o.noise_px;
  return sections;
}

// The image behind a view's overlay; nothing for a table.
cv::Mat imageBehind(const PhantomView& view) { return view.is_table ? cv::Mat() : readXrayImage(view.path); }

void writeViewSetReport(const std::string& folder, const CameraCalibration& result, const ViewSet& set) {
  std::vector<cv::Mat> images;
  for (const PhantomView& view : set.views) images.push_back(imageBehind(view));
  writeReport(folder, "Camera calibration", set.path, cameraSections(result, images));
}

std::vector<CalibrationInput> inputsOf(const ViewSet& set, const std::vector<CalibrationInput>& views) {
  std::vector<CalibrationInput> inputs = {hashedInput(set.path)};
  if (!set.phantom_path.empty()) inputs.push_back(hashedInput(set.phantom_path));
  inputs.insert(inputs.end(), views.begin(), views.end());
  return inputs;
}

int runViewSet(const CameraOptions& o) {
  const std::string out = o.out.empty() ? "" : o.out.front(), &views = o.views.front();
  const ClaimedOutputs claimed(out, o.report);
  const CameraSections settings = settingsOf(o);
  const ViewSet set = readViewSet(views);
  const BeadPhantom phantom = phantomOf(set);
  Stopwatch watch;
  SeenViewSet seen;
  {
    ProgressBar bar("finding beads", static_cast<int>(set.views.size()));
    seen = seenViews(set, phantom, settings.detection, [&](int done) { bar.show(done); });
  }
  const double seen_s = watch.seconds();
  watch = {};
  const CameraCalibration result = [&] {
    try {
      return calibrateCamera(phantom, seen.detector, seen.views, settings.camera);
    } catch (const InputError& error) {
      throw error.within(views);
    }
  }();
  const double solved_s = watch.seconds();
  if (!out.empty()) writeCalibratedCamera(out, result, set.machine, inputsOf(set, seen.inputs));
  if (!o.report.empty()) writeViewSetReport(o.report, result, set);
  std::cout << cameraTable(result)
            << formatted("time: beads %.2f s, calibration of %zu views %.3f s\n", seen_s, result.views.size(),
                         solved_s);
  return 0;
}

int runCamera(const CameraOptions& o) {
  if (isViewSet(o.views.front())) return runViewSet(o);
  PictureOptions pictures = o.pictures;
  pictures.pictures = o.views;
  pictures.out = o.out;
  pictures.report = o.report;
  return runPictures(pictures, settingsOf(o));
}

void checkOptions(const CameraOptions& o) {
  if (!isViewSet(o.views.front())) return checkPictureOptions(o.pictures, o.views, o.out);
  if (o.views.size() > 1) cli::refuseValue("views", "one view set, or pictures of a phantom of equal beads");
  if (o.out.size() > 1) cli::refuseValue("--out", "one file: a view set is of one camera");
}

}  // namespace

void addCalibrateCamera(cli::Command& app, Work& work) {
  const auto o = std::make_shared<CameraOptions>();
  auto* command = app.addSubcommand("camera", "K, distortion and their uncertainty, from views of beads or of a grid");
  command->footer(
      "Example:\n  angio-calibrate camera views.yaml --distortion intensifier --out camera.yaml --report report\n"
      "  angio-calibrate camera cube.jpg --phantom beads.csv --grid grid.jpg --out camera.yaml --report report");
  command
      ->addOption("views", o->views,
                  "View set (.yaml): images of beads, of a chessboard or of a circle grid, or tables; or pictures of a "
                  "phantom of equal beads (--phantom)")
      ->required();
  command->addOption("--distortion", o->distortion, "Of the detector; the settings' choice (none) when not given")
      ->check(cli::oneOf({"none", "radial", "intensifier"}));
  command->addFlag("--square-pixels", o->square_pixels, "One focal length for both axes");
  command->addFlag("--skew", o->skew, "Let the detector's columns lean");
  command->addOption("--noise-px", o->noise_px, "Known error of a bead's centre per axis; 0: by the residuals")
      ->check(between(0, 100));
  addSettingsOptions(*command, o->settings, "Settings (.yaml), sections camera and bead_detection",
                     settingsInForce<CameraSections>);
  command->addOption("--out", o->out, "The camera with its record (.yaml); again for each further camera")
      ->oneAtATime();
  command->addOption("--report", o->report, "Folder for pictures and a page (index.html)");
  addPictureOptions(*command, o->pictures);
  command->onRead([o] { checkOptions(*o); });
  command->onChosen([o, &work] { work = [o] { return runCamera(*o); }; });
}

}  // namespace angio::apps
