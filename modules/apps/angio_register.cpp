// SPDX-License-Identifier: GPL-2.0-or-later
// angio-register: one tree, one X-ray image or centreline (or one of each view), one pose.
#include <algorithm>
#include <chrono>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration_records/centered_carm.hpp"
#include "angio/calibration_records/record.hpp"
#include "angio/cli/bus_help.hpp"
#include "angio/cli/further_options.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/imaging/wide_vessels.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/results/case_run.hpp"
#include "angio/results/experiment.hpp"
#include "angio/results/overlay.hpp"
#include "angio/vessel/model_id.hpp"
#include "program_settings.hpp"
#include "register_bus.hpp"
#include "register_dicom.hpp"
#include "register_summary.hpp"
#include "register_views.hpp"

namespace angio::apps {
namespace {

struct Options {
  std::string tree, method = OrientedKernelSettings::kName, settings, out, out_pose, overlay;
  DicomOutputs dicom;
  ViewFiles files;
  std::string extractor, polarity = "dark";
  int starts = 0;
  double search_rotation_deg = 0, search_translation_mm = 0;
  double max_age_days = RecordGate{}.max_age_days;
  bool nonrigid = false;
  bool certify = false, point_covariance = false, json = false;
  CertificateSettings certificate;  // But for the box, which is the search's when that has one.
  RegisterBusOptions live;          // Used when it names a bus.

  void checkLive() const {
    if (live.calibration.empty()) cli::refuseWithout("--calibration with --bus");
    if (!files.cameras.empty() || !files.centerlines.empty() || !files.images.empty()) {
      cli::refuseBoth("--bus", "files of a camera, a centreline or an image");
    }
    if (!settings.empty() || !out.empty() || !out_pose.empty() || !overlay.empty() || nonrigid || certify ||
        dicom.given()) {
      cli::refuseBoth("--bus", "--settings, --nonrigid, --certify, and files to write");
    }
  }

  void check() const {
    files.check();
    if (certify && nonrigid) cli::refuseBoth("--certify", "--nonrigid");
    if (certify && std::max(files.images.size(), files.centerlines.size()) > 1) {
      cli::refuseBoth("--certify", "a second view");
    }
  }
};

cv::Mat pictureOf(const std::vector<SeenView>& views, const VesselTree& tree, const Pose& initial,
                  const CaseOutcome& outcome) {
  std::vector<cv::Mat> pictures;
  for (const SeenView& view : views) {
    const RegistrationResult& r = outcome.result;
    OverlayScene scene;
    scene.image = view.image;
    scene.centerline = &view.centerline;
    scene.trees.push_back({view.T_view_first * initial, {}, kStartColor, "tree at the initial pose"});
    const StatusStyle style = statusStyle(r.status, outcome.usable_for);
    scene.trees.push_back({view.T_view_first * r.T_camera_model, r.displacements_m, style.color_bgr,
                           "tree as registered: " + style.words});
    scene.R_camera_lps = view.R_camera_lps;
    if (pictures.empty()) scene.caption = captionOf(outcome);
    pictures.push_back(drawOverlay(scene, tree, view.camera));
  }
  return sideBySide(pictures);
}

XrayView viewOf(const SeenView& seen) {
  return {seen.centerline, seen.camera, seen.T_view_first, seen.collimator_px,
          seen.image.empty() ? nullptr : &seen.image};
}

RegistrationResult searched(Registration& registration, const std::vector<SeenView>& seen, const Pose& initial,
                            const StartSettings& starts) {
  XrayViews views;
  for (const SeenView& view : seen) views.push_back(viewOf(view));
  constexpr int kSteps = 1000;
  ProgressBar bar("searching", kSteps);
  return registration.search(views, {initial, {}}, starts,
                             [&](double share_done) { bar.show(static_cast<int>(kSteps * share_done)); });
}

// Looks for what else could be the answer. A pose that has an alternative is not trusted.
PoseCertificate certified(const VesselTree& tree, const SeenView& view, const Pose& initial,
                          const CertificateSettings& settings, RegistrationResult& result) {
  constexpr int kSteps = 1000;
  ProgressBar bar("certifying", kSteps);
  const auto began = std::chrono::steady_clock::now();
  auto certificate =
      certify(tree, viewOf(view), initial, result.T_camera_model, settings, [&](double closed, double bound) {
        // Over when the box is closed, and after the time that it may take.
        const double elapsed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
        bar.show(static_cast<int>(kSteps * std::max(closed, elapsed_s / settings.seconds)),
                 formatted("bound %.2f of the score", bound));
      });
  if (certificate.alternative && result.status == RegistrationStatus::kConverged) {
    result.status = RegistrationStatus::kAmbiguous;
    result.reason = certificate.reason;
  }
  return certificate;
}

std::string certificateLine(const PoseCertificate& certificate, const CertificateSettings& settings) {
  if (!certificate.proven) return certificate.reason;
  return formatted("proven: no pose within +-%g deg / +-%g mm and more than %g mm away has %g %% of the score   %.1f s",
                   settings.box_rotation_deg, settings.box_translation_mm, settings.distance_mm,
                   100 * settings.alternative_share, certificate.seconds);
}

// Cameras whose calibration is old may still be right, and whoever asks should know.
void warnOfOldCameras(const Options& o) {
  for (const std::string& camera : o.files.cameras) {
    for (const auto& warning : checkRecords(camera, readRecords(camera), {"", o.max_age_days})) {
      std::cerr << "angio-register: " << warning << "\n";
    }
  }
}

int registerOne(const Options& o) {
  for (const auto& path : {o.out, o.out_pose, o.dicom.registration, o.dicom.overlay}) requireFolderOf(path);
  requireImagePath(o.overlay);
  ProgramSettings settings;
  if (!o.settings.empty()) settings = readSettings(o.settings, settings);
  if (const int own = startsOfPreset(o.method); own > 0) settings.starts.count = own;
  if (o.starts > 0) settings.starts.count = o.starts;
  if (o.search_rotation_deg > 0) settings.starts.box_rotation_deg = o.search_rotation_deg;
  if (o.search_translation_mm > 0) settings.starts.box_translation_mm = o.search_translation_mm;
  ExtractorSettings extractor = chosenExtractor(settings, o.extractor);
  if (o.polarity == "bright") std::visit([](auto& s) { s.polarity = Polarity::kBright; }, extractor);
  const auto method = settings.of(o.method, o.nonrigid ? std::optional(Deformation::kNonrigid) : std::nullopt);

  const VesselTree tree = readVesselTree(o.tree);
  auto [views, initial, image_s, assumed] = readViews(o.files, tree, *makeExtractor(extractor));
  if (o.files.initial_pose.empty() && o.files.t_dsa_cb.empty() && !settings.starts.box()) {
    settings.starts.box_rotation_deg = 180;
    settings.starts.box_translation_mm = 60;
    assumed.push_back("nothing of the start: all poses within +-180 deg and +-60 mm are searched");
  }
  warnOfOldCameras(o);
  if (o.files.t_dsa_cb == kCentered) std::cerr << "angio-register: assumed: " << kCenteredAssumption << "\n";
  if (o.files.centerlines.empty()) {
    const auto wide = tooWideVessels(tree, views.front().camera, initial, extractor);
    if (wide) std::cerr << "angio-register: " << *wide << "\n";
  }
  CaseOutcome outcome;
  outcome.name = o.tree;
  outcome.image_s = image_s;
  const auto registration = makeRegistration(method, tree);
  outcome.result = searched(*registration, views, initial, settings.starts);
  addClaims(tree, o.point_covariance, outcome);

  CertificateSettings asked = o.certificate;
  if (settings.starts.box()) {
    asked.box_rotation_deg = settings.starts.box_rotation_deg;
    asked.box_translation_mm = settings.starts.box_translation_mm;
  }
  std::optional<PoseCertificate> certificate;
  if (o.certify) certificate = certified(tree, views.front(), initial, asked, outcome.result);

  nlohmann::ordered_json json = {{"method", o.method}};
  json.update(caseAsJson(outcome));
  if (certificate) json["certificate"] = certificateAsJson(*certificate, asked);
  if (!assumed.empty()) json["assumed"] = assumed;
  json["settings"] = methodAsJson(method);
  json["settings"]["starts"] = settingsAsJson(settings.starts);
  json["settings"].update(extractorAsJson(extractor));
  json["machine"] = machineAsJson();
  const bool converged = outcome.result.status == RegistrationStatus::kConverged;
  // A pose that nobody should trust is not written: a file does not say how it came about.
  if (!o.out_pose.empty() && converged) {
    writePose(o.out_pose, {outcome.result.T_camera_model, outcome.result.covariance, modelId(tree)});
  }
  if (!o.overlay.empty()) writeImage(o.overlay, pictureOf(views, tree, initial, outcome));
  o.dicom.write(tree, o.method, outcome, o.files.images.empty() ? "" : o.files.images.front(),
                [&] { return pictureOf(views, tree, initial, outcome); });
  if (!o.out.empty()) writeWholeFile(o.out, json.dump(2) + "\n");
  if (o.json) std::cout << json.dump(2) << "\n";

  RegistrationTry tried{views.size(),
                        !o.files.images.empty() && o.files.centerlines.empty(),
                        std::visit([](const auto& e) { return std::string(e.kName); }, extractor),
                        o.nonrigid,
                        settings.starts,
                        {}};
  // Another reading turns the centreline, not the image.
  if (outcome.result.status == RegistrationStatus::kDiverged && views.size() == 1 && !imageNeeded(method)) {
    tried.matching = matchingReading(*registration, viewOf(views.front()), {initial, {}}, settings.starts);
  }
  std::ostream& said = o.json ? std::cerr : std::cout;
  said << summaryOf(outcome, tried) << "\n";
  for (const auto& path : {o.out_pose, o.dicom.registration}) {
    if (!path.empty() && !converged) said << path << " is not written: the registration did not converge\n";
  }
  if (certificate) said << certificateLine(*certificate, asked) << "\n";
  return converged ? 0 : kExitNotReached;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app("Finds the pose of a pre-operative vessel tree in one X-ray image.", "angio-register");
  angio::apps::describeProgram(
      app,
      "angio-register --tree tree.csv --camera camera.yaml --image frame.png --initial-pose start.yaml "
      "--out result.json --overlay picture.png");
  angio::apps::Options o;
  app.addOption("--tree", o.tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt)")->required();
  // Each may be given again for a further view; each takes one file at a time.
  const auto addViews = [](angio::cli::Command& to, const char* name, std::vector<std::string>& files,
                           const char* help) { return to.addOption(name, files, help)->oneAtATime(); };
  addViews(app, "--camera", o.files.cameras,
           "X-ray camera (.yaml, ViSP .xml); once for each view. DICOM runs need none");
  addViews(app, "--view-pose", o.files.view_poses,
           "Where the camera of view 2, 3, ... stands: T_view_first (.yaml). DICOM runs have angles");
  auto* seen = app.addGroup("What is seen", "At least one of them", 2);
  addViews(*seen, "--centerline", o.files.centerlines,
           "2D centreline (.csv) of each view; with --image the image is only shown");
  addViews(*seen, "--image", o.files.images, "X-ray image (.png, .tif, .jpg) or DICOM run (.dcm) of each view");
  app.addOption("--frame", o.files.frames, "Frame of a run or of a TIFF, from 0; once for all images or for each")
      ->oneAtATime()
      ->check(angio::cli::wholeBetween(0, 1000000));
  app.addOption("--mask-frame", o.files.mask_frames,
                "Frame of the same file without contrast agent, which is subtracted; once for all images or for each")
      ->oneAtATime()
      ->check(angio::cli::wholeBetween(0, 1000000))
      ->group(angio::cli::kFurtherOptions);
  angio::apps::addReadingOptions(app, o.files);
  app.addOption("--initial-pose", o.files.initial_pose,
                "Pose to start from (.yaml); without it a DICOM run's angles say where to start");
  app.addOption(
      "--t-dsa-cb", o.files.t_dsa_cb,
      "With angles: the tree in the patient's axes L, P, S from the isocentre (.yaml); or centre: its x, y, z are "
      "L, P, S of a patient head first supine, its centroid is at the isocentre");
  app.addOption("--method", o.method, "Registration method");
  app.addFlag("--nonrigid", o.nonrigid, "Let the tree deform after the rigid registration");
  app.addOption("--extractor", o.extractor,
                "How centrelines are found in images: " + angio::apps::listOfExtractors() +
                    "; the settings' choice (ridge) when not given");
  app.addOption("--starts", o.starts, "Starts drawn around the initial pose; 0 takes the settings' count")
      ->check(angio::cli::wholeBetween(0, 10000))
      ->group(angio::cli::kFurtherOptions);
  app.addOption("--search-rotation-deg,--box-rotation-deg", o.search_rotation_deg,
                "Search all poses turned by up to so much about each axis; 0 takes the settings' box")
      ->check(angio::apps::between(0, 180));
  app.addOption("--search-translation-mm,--box-translation-mm", o.search_translation_mm,
                "The same for shifts along each axis")
      ->check(angio::apps::between(0, 1000));
  app.addFlag(
         "--point-covariance", o.point_covariance,
         "Add the covariance of each point of the tree to the result [mm^2]; with --bus say it: REGISTRATION_POINTS")
      ->group(angio::cli::kFurtherOptions);
  auto* certify = app.addFlag("--certify", o.certify,
                              "Prove that no different pose of the box scores nearly as well, or find one; the "
                              "search's box, or +-45 deg and +-60 mm");
  app.addOption("--certify-seconds", o.certificate.seconds, "Time for the proof; what is open then is not proven")
      ->check(angio::apps::between(0, 1e6))
      ->needs(certify)
      ->group(angio::cli::kFurtherOptions);
  app.addOption("--certify-distance-mm", o.certificate.distance_mm,
                "Poses further away than this are different; depth does not count")
      ->check(angio::apps::between(0, 1000))
      ->needs(certify)
      ->group(angio::cli::kFurtherOptions);
  app.addOption("--certify-threads", o.certificate.threads, "Threads of the proof; 0: as many as the processor has")
      ->check(angio::cli::wholeBetween(0, 256))
      ->needs(certify)
      ->group(angio::cli::kFurtherOptions);
  app.addOption("--polarity", o.polarity, "How vessels stand out of the image")
      ->check(angio::cli::oneOf({"dark", "bright"}))
      ->group(angio::cli::kFurtherOptions);
  app.addOption("--max-calibration-age-days", o.max_age_days, "A camera's older calibration is warned of")
      ->check(angio::apps::between(0, 1e6))
      ->group(angio::cli::kFurtherOptions);
  angio::apps::addSettingsOptions(app, o.settings, "Settings (.yaml), sections by method, starts, extractors",
                                  angio::io::settingsInForce<angio::apps::ProgramSettings>);
  app.addOption("--out", o.out, "Result (.json)");
  app.addFlag("--json", o.json, "The result to stdout, and what is said of it to stderr");
  app.addOption("--out-pose", o.out_pose, "Pose of the model in the camera (.yaml), of a result that converged");
  app.addOption("--overlay", o.overlay, "Picture of the result (.png, .jpg)");
  o.dicom.addTo(app);
  auto* bus =
      seen->addOption("--bus", o.live.bus, angio::cli::busHelp("Register the frames of a bus, and say so there"));
  app.addOption("--key-file", o.live.key_file, "With --bus: key that the programs on the bus share")
      ->needs(bus)
      ->group(angio::cli::kFurtherOptions);
  app.addOption("--calibration", o.live.calibration, "With --bus: C-arm geometry and T_dsa_cb (.yaml)")->needs(bus);
  app.addOption("--duration-s", o.live.duration_s, "With --bus: how long; 0: until stopped")
      ->check(angio::apps::between(0, 86400))
      ->needs(bus);
  app.onRead([&] { o.live.bus.empty() ? o.check() : o.checkLive(); });
  return angio::apps::runProgram(app, argc, argv, [&] {
    o.live.tree = o.tree;
    o.live.method = o.method;
    o.live.point_covariance = o.point_covariance;
    return o.live.bus.empty() ? angio::apps::registerOne(o) : angio::apps::registerOnBus(o.live);
  });
}
