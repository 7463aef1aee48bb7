// SPDX-License-Identifier: GPL-2.0-or-later
// angio-register: one tree, one X-ray image or centreline (or one of each view), one pose.
#include <cstdio>
#include <iostream>

#include "angio/base/stopwatch.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/case_run.hpp"
#include "angio/evaluation/overlay.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/case_files.hpp"
#include "angio/io/centerline_files.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "program_settings.hpp"

namespace angio {
namespace {

struct Options {
  std::string tree, initial_pose, method = OrientedKernelSettings::kName, settings, out, overlay;
  std::vector<std::string> cameras, view_poses, centerlines, images;  // In the order of the views.
  std::string polarity = "dark";
  int starts = 0;
  double search_rotation_deg = 0, search_translation_mm = 0;
  bool nonrigid = false;
};

// One view as its files say it.
struct SeenView {
  XrayCamera camera;
  Pose T_view_first = Pose::Identity();
  cv::Mat image;  // Empty when none is given.
  Centerline2d centerline;
};

// What the command line can say wrongly of the views: there is one of each kind for each camera.
void checkViews(const Options& o) {
  const std::size_t views = o.cameras.size();
  const auto check = [](const char* option, std::size_t given, std::size_t wanted, const char* rule) {
    if (given == wanted) return;
    throw CLI::ValidationError(option,
                               std::to_string(given) + " given, must be " + std::to_string(wanted) + ": " + rule);
  };
  if (!o.centerlines.empty()) check("--centerline", o.centerlines.size(), views, "one for each camera");
  if (!o.images.empty()) check("--image", o.images.size(), views, "one for each camera");
  check("--view-pose", o.view_poses.size(), views - 1, "one for each camera but the first");
}

std::vector<SeenView> readViews(const Options& o, CenterlineExtractor& extractor, CaseOutcome& outcome) {
  std::vector<SeenView> views;
  for (std::size_t v = 0; v < o.cameras.size(); ++v) {
    SeenView view{readCamera(o.cameras[v]), Pose::Identity(), {}, {}};
    if (v > 0) view.T_view_first = readViewPose(o.view_poses[v - 1]);
    if (!o.images.empty()) view.image = readXrayImage(o.images[v], view.camera);
    if (o.centerlines.empty()) {
      const Stopwatch stage;
      view.centerline = extractor.extract(view.image);
      outcome.image_s += stage.seconds();
    } else {
      view.centerline = readCenterline(o.centerlines[v]);
    }
    views.push_back(std::move(view));
  }
  return views;
}

std::string captionOf(const CaseOutcome& outcome) {
  const RegistrationResult& r = outcome.result;
  char text[200];
  std::snprintf(text, sizeof text, "%s   model to image %.2f px, image to model %.2f px   %.1f ms",
                statusName(r.status).c_str(), r.agreement.model_residual_px, r.agreement.image_residual_px,
                1e3 * (outcome.image_s + r.times.total_s));
  return text;
}

cv::Mat pictureOf(const std::vector<SeenView>& views, const VesselTree& tree, const Pose& initial,
                  const CaseOutcome& outcome) {
  std::vector<cv::Mat> pictures;
  for (const SeenView& view : views) {
    const RegistrationResult& r = outcome.result;
    OverlayScene scene;
    scene.image = view.image;
    scene.centerline = &view.centerline;
    scene.trees.push_back({view.T_view_first * initial, {}, kStartColour, "tree at the initial pose"});
    scene.trees.push_back(
        {view.T_view_first * r.T_camera_model, r.displacements_m, kModelColour, "tree as registered"});
    if (pictures.empty()) scene.caption = captionOf(outcome);
    pictures.push_back(drawOverlay(scene, tree, view.camera));
  }
  return sideBySide(pictures);
}

RegistrationResult searched(Registration& registration, const std::vector<SeenView>& seen, const Pose& initial,
                            const StartSettings& starts) {
  XrayViews views;
  for (const SeenView& view : seen) views.push_back({view.centerline, view.camera, view.T_view_first});
  constexpr int kSteps = 1000;
  ProgressBar bar("searching", kSteps);
  return registration.search(views, {initial, {}}, starts,
                             [&](double share_done) { bar.show(static_cast<int>(kSteps * share_done)); });
}

int registerOne(const Options& o) {
  ProgramSettings settings;
  if (!o.settings.empty()) settings = readSettings(o.settings, settings);
  if (o.starts > 0) settings.starts.count = o.starts;
  if (o.search_rotation_deg > 0) settings.starts.box_rotation_deg = o.search_rotation_deg;
  if (o.search_translation_mm > 0) settings.starts.box_translation_mm = o.search_translation_mm;
  if (o.polarity == "bright") settings.otsu.polarity = Polarity::kBright;
  const auto method = settings.of(o.method, o.nonrigid ? std::optional(Deformation::kNonrigid) : std::nullopt);

  const VesselTree tree = readVesselTree(o.tree);
  const Pose initial = readPose(o.initial_pose).T_camera_model;
  CaseOutcome outcome;
  outcome.name = o.tree;
  const auto views = readViews(o, *makeExtractor(settings.otsu), outcome);
  outcome.result = searched(*makeRegistration(method, tree), views, initial, settings.starts);

  nlohmann::ordered_json json = {{"method", o.method}};
  json.update(caseAsJson(outcome));
  json["settings"] = methodAsJson(method);
  json["settings"]["starts"] = settingsAsJson(settings.starts);
  json["settings"][OtsuSettings::kName] = settingsAsJson(settings.otsu);
  json["machine"] = machineAsJson();
  if (!o.overlay.empty()) writeImage(o.overlay, pictureOf(views, tree, initial, outcome));
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
  // Each may be given again for a further view; each takes one file at a time.
  const auto addViews = [](CLI::App& to, const char* name, std::vector<std::string>& files, const char* help) {
    return to.add_option(name, files, help)->allow_extra_args(false);
  };
  addViews(app, "--camera", o.cameras, "X-ray camera (.yaml, ViSP .xml); once for each view")->required();
  addViews(app, "--view-pose", o.view_poses, "Where the camera of view 2, 3, ... stands: T_view_first (.yaml)");
  auto* seen = app.add_option_group("What is seen", "At least one of them")->require_option(1, 2);
  seen->option_defaults()->always_capture_default();
  addViews(*seen, "--centerline", o.centerlines,
           "2D centreline (.csv) of each view; with --image the image is only shown");
  addViews(*seen, "--image", o.images, "X-ray image (.png, .tif) of each view");
  app.add_option("--initial-pose", o.initial_pose, "Pose to start from (.yaml)")->required();
  app.add_option("--method", o.method, "Registration method");
  app.add_flag("--nonrigid", o.nonrigid, "Let the tree deform after the rigid registration");
  app.add_option("--starts", o.starts, "Starts drawn around the initial pose; 0 takes the settings' count")
      ->check(CLI::Range(0, 10000));
  app.add_option("--search-rotation-deg", o.search_rotation_deg,
                 "Search all poses turned by up to so much about each axis; 0 takes the settings' box")
      ->check(angio::between(0, 180));
  app.add_option("--search-translation-mm", o.search_translation_mm, "The same for shifts along each axis")
      ->check(angio::between(0, 1000));
  app.add_option("--polarity", o.polarity, "How vessels stand out of the image")
      ->check(CLI::IsMember({"dark", "bright"}));
  app.add_option("--settings", o.settings, "Settings (.yaml), sections by method, starts, otsu");
  app.add_option("--out", o.out, "Result (.json); stdout when not given");
  app.add_option("--overlay", o.overlay, "Picture of the result (.png, .jpg)");
  app.parse_complete_callback([&] { angio::checkViews(o); });
  return angio::runProgram(app, argc, argv, [&] { return angio::registerOne(o); });
}
