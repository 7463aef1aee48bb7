// SPDX-License-Identifier: GPL-2.0-or-later
// angio-register: one tree, one X-ray image or centreline, one pose.
#include <cstdio>
#include <iostream>

#include "angio/base/stopwatch.hpp"
#include "angio/cli/program.hpp"
#include "angio/evaluation/case_run.hpp"
#include "angio/evaluation/overlay.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "program_settings.hpp"

namespace angio {
namespace {

struct Options {
  std::string tree, camera, centerline, image, initial_pose, method = IterativePnpSettings::kName, settings, out,
                                                             overlay;
  std::string polarity = "dark";
  int starts = 0;
  bool nonrigid = false;
};

std::string captionOf(const CaseOutcome& outcome) {
  const RegistrationResult& r = outcome.result;
  char text[200];
  std::snprintf(text, sizeof text, "%s   model to image %.2f px, image to model %.2f px   %.1f ms",
                statusName(r.status).c_str(), r.agreement.model_residual_px, r.agreement.image_residual_px,
                1e3 * (outcome.image_s + r.times.total_s));
  return text;
}

int registerOne(const Options& o) {
  ProgramSettings settings;
  if (!o.settings.empty()) settings = readSettings(o.settings, settings);
  if (o.starts > 0) settings.starts.count = o.starts;
  if (o.polarity == "bright") settings.otsu.polarity = Polarity::kBright;
  const auto method = settings.of(o.method, o.nonrigid ? std::optional(Deformation::kNonrigid) : std::nullopt);

  const VesselTree tree = readVesselTree(o.tree);
  const XrayCamera camera = readCamera(o.camera);
  const Pose initial = readPose(o.initial_pose).T_camera_model;
  CaseOutcome outcome;
  outcome.name = o.tree;
  cv::Mat image;
  Centerline2d centerline;
  if (!o.image.empty()) image = readXrayImage(o.image, camera);
  if (o.centerline.empty()) {
    const auto extractor = makeExtractor(settings.otsu);
    const Stopwatch stage;
    centerline = extractor->extract(image);
    outcome.image_s = stage.seconds();
  } else {
    centerline = readCenterline(o.centerline);
  }

  const auto registration = makeRegistration(method, tree);
  outcome.result = registration->search(centerline, camera, {initial, {}}, settings.starts);

  nlohmann::ordered_json json = {{"method", o.method}};
  json.update(caseAsJson(outcome));
  json["settings"] = methodAsJson(method);
  json["settings"]["starts"] = settingsAsJson(settings.starts);
  json["settings"][OtsuSettings::kName] = settingsAsJson(settings.otsu);
  json["machine"] = machineAsJson();
  if (!o.overlay.empty()) {
    OverlayScene scene;
    scene.image = image;
    scene.centerline = &centerline;
    scene.trees.push_back({initial, {}, kStartColour, "tree at the initial pose"});
    scene.trees.push_back(
        {outcome.result.T_camera_model, outcome.result.displacements_m, kModelColour, "tree as registered"});
    scene.caption = captionOf(outcome);
    writeImage(o.overlay, drawOverlay(scene, tree, camera));
  }
  if (o.out.empty()) {
    std::cout << json.dump(2) << "\n";
  } else {
    writeWholeFile(o.out, json.dump(2) + "\n");
    std::cout << captionOf(outcome) << "\n";
  }
  return 0;
}

}  // namespace
}  // namespace angio

int main(int argc, char** argv) {
  CLI::App app("Finds the pose of a pre-operative vessel tree in one X-ray image.", "angio-register");
  angio::describeProgram(
      app,
      "angio-register --tree tree.csv --camera camera.yaml --image frame.png --initial-pose start.yaml "
      "--out result.json --overlay picture.png");
  angio::Options o;
  app.add_option("--tree", o.tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt)")->required();
  app.add_option("--camera", o.camera, "X-ray camera (.yaml, ViSP .xml)")->required();
  auto* seen = app.add_option_group("What is seen", "At least one of them")->require_option(1, 2);
  seen->option_defaults()->always_capture_default();
  seen->add_option("--centerline", o.centerline, "2D centreline (.csv); with --image the image is only shown");
  seen->add_option("--image", o.image, "X-ray image (.png, .tif)");
  app.add_option("--initial-pose", o.initial_pose, "Pose to start from (.yaml)")->required();
  app.add_option("--method", o.method, "Registration method");
  app.add_flag("--nonrigid", o.nonrigid, "Let the tree deform after the rigid registration");
  app.add_option("--starts", o.starts, "Starts drawn around the initial pose; 0 takes the settings' count")
      ->check(CLI::Range(0, 10000));
  app.add_option("--polarity", o.polarity, "How vessels stand out of the image")
      ->check(CLI::IsMember({"dark", "bright"}));
  app.add_option("--settings", o.settings, "Settings (.yaml), sections by method, starts, otsu");
  app.add_option("--out", o.out, "Result (.json); stdout when not given");
  app.add_option("--overlay", o.overlay, "Picture of the result (.png, .jpg)");
  return angio::runProgram(app, argc, argv, [&] { return angio::registerOne(o); });
}
