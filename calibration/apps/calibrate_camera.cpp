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
#include "angio/io/settings_files.hpp"
#include "calibrate.hpp"
#include "outputs.hpp"

namespace angio::apps {
namespace {

struct CameraOptions {
  std::string views, settings, out, report, distortion;
  bool square_pixels = false, skew = false;
  double noise_px = 0;
};

struct CameraSections {
  CameraCalibrationSettings camera;
  BeadDetectionSettings detection;

  void visit(SettingsVisitor& v) {
    v.section("camera", [this](SettingsVisitor& s) { camera.visit(s); });
    v.section("bead_detection", [this](SettingsVisitor& s) { detection.visit(s); });
  }
};

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

int calibrate(const CameraOptions& o) {
  const CameraSections settings = settingsOf(o);
  const ViewSet set = readViewSet(o.views);
  const BeadPhantom phantom = readBeadPhantom(set.phantom_path);
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
      throw error.within(o.views);
    }
  }();
  const double solved_s = watch.seconds();
  if (!o.out.empty()) writeCalibratedCamera(o.out, result, set, seen.inputs);
  if (!o.report.empty()) writeCameraReport(o.report, result, set);
  std::cout << cameraTable(result)
            << formatted("time: beads %.2f s, calibration of %zu views %.3f s\n", seen_s, result.views.size(),
                         solved_s);
  return 0;
}

}  // namespace

void addCalibrateCamera(CLI::App& app, Work& work) {
  const auto o = std::make_shared<CameraOptions>();
  auto* command = app.add_subcommand("camera", "K, distortion and their uncertainty, from views of beads or of a grid");
  command->option_defaults()->always_capture_default();
  command->footer(
      "Example:\n  angio-calibrate camera views.yaml --distortion intensifier --out camera.yaml --report report");
  command->add_option("views", o->views, "View set (.yaml): X-ray images, or tables of beads")->required();
  command->add_option("--distortion", o->distortion, "Of the detector; the settings' choice (none) when not given")
      ->check(CLI::IsMember({"none", "radial", "intensifier"}));
  command->add_flag("--square-pixels", o->square_pixels, "One focal length for both axes");
  command->add_flag("--skew", o->skew, "Let the detector's columns lean");
  command->add_option("--noise-px", o->noise_px, "Known error of a bead's centre per axis; 0: by the residuals")
      ->check(between(0, 100));
  command->add_option("--settings", o->settings, "Settings (.yaml), sections camera and bead_detection");
  command->add_option("--out", o->out, "The camera with its record (.yaml)");
  command->add_option("--report", o->report, "Folder for pictures and a page (index.html)");
  command->callback([o, &work] { work = [o] { return calibrate(*o); }; });
}

}  // namespace angio::apps
