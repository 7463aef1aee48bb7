// SPDX-License-Identifier: GPL-2.0-or-later
#include "servo_settings.hpp"

#include <algorithm>

#include "angio/base/errors.hpp"
#include "angio/cli/further_options.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/settings_files.hpp"

namespace angio::apps {
namespace {

// In the order of ServoSettings::Perceiver.
std::vector<std::string> perceivers() { return {"own", "own_and_catheter", "bus"}; }

}  // namespace

void ServoSettings::visit(SettingsVisitor& v) {
  const auto section = [&v](const char* key, auto& settings, const char* meaning) {
    v.section(
        key, [&](SettingsVisitor& inner) { settings.visit(inner); }, meaning);
  };
  section("scenario", scenario, "Of a simulation: start, calibration error, duration");
  section("fluoroscopy", patient, "Of a simulation: X-ray, contrast agent, motion and device");
  tasks.visit(v);
  laws.visit(v);
  v.number("latency_ms", latency_ms, 0, 2000, "Time from an exposure until its command moves the machine");
  extractors.visit(v);
  v.choice("method", method, {OrientedKernelSettings::kName, IterativePnpSettings::kName}, "Method of registration");
  v.choice("perception", perception, perceivers(),
           "Who registers frames: this program, also by a catheter alone where nothing else is seen, or another one on "
           "the bus by its REGISTRATION");
  v.integer("starts", starts, 0, 100000, "Starts of a search; 0: as many as the method needs");
  section(OrientedKernelSettings::kName, oriented_kernel, "With method oriented_kernel");
  v.section(
      IterativePnpSettings::kName,
      [&](SettingsVisitor& inner) {
        inner.section(
            "search", [&](SettingsVisitor& s) { search.visit(s); }, "While nothing is tracked");
        inner.section(
            "tracking", [&](SettingsVisitor& s) { tracking.visit(s); }, "From frame to frame");
      },
      "With method iterative_pnp");
  section("tracker", tracker, "From frame to frame: where the next registration is looked for");
  section("limits", limits, "Limits of the C-arm, by its data sheet");
  section("supervisor", supervisor, "Which registrations are used");
  section("safety", safety, "When the machine holds or stops");
}

ServoLoopSettings ServoSettings::loop(const CArmCalibration& calibrated) const {
  const CArmGeometry& carm = calibrated.carm;
  ServoLoopSettings loop;
  loop.carm = carm;
  loop.T_dsa_cb = calibrated.T_dsa_cb;
  loop.R_lps_model = calibrated.R_lps_model;
  loop.target_model = target_model;
  loop.limits = limits.limits(carm.source_detector_distance_m - carm.source_isocenter_distance_m);
  loop.task = tasks.chosen();
  const auto& depth = tasks.of<ResolveDepthTaskSettings>();
  if (depth.first && !std::holds_alternative<ResolveDepthTaskSettings>(loop.task)) loop.depth_first = depth;
  loop.law = laws.chosen();
  loop.latency_s = 1e-3 * latency_ms;
  loop.external_registration = perception == Perceiver::kBus;
  loop.perception.by_catheter = perception == Perceiver::kOwnAndCatheter;
  loop.perception.extractor = extractors.chosen();
  loop.perception.search = loop.perception.tracking = oriented_kernel;
  if (method == Method::kIterativePnp) {
    loop.perception.useIterativePnp();
    loop.perception.search = search;
    loop.perception.tracking = tracking;
  }
  if (starts > 0) loop.perception.search_starts.count = starts;
  loop.perception.tracker = tracker;
  loop.supervisor = supervisor;
  loop.safety = safety;
  return loop;
}

ServoSettings readServoSettings(const std::string& path, ServoSettings usual) {
  if (path.empty()) return usual;
  const ServoSettings settings = readSettings(path, usual);
  try {
    settings.limits.check();
  } catch (const InputError& error) {
    throw error.within(path);
  }
  return settings;
}

std::string servoSettingsAsYaml(const std::string& path) { return settingsAsYaml(readServoSettings(path)); }

void LoopOptions::addTo(cli::Command& app) {
  const ServoSettings usual;
  const auto& view = usual.tasks.of<ViewTaskSettings>();
  app.addOption("--task", task, "What to do")->check(cli::oneOf(usual.tasks.names()))->defaultText("view");
  app.addOption("--view-primary-deg", view_primary_deg, "Desired view of the anatomy: LAO positive, RAO negative")
      ->check(between(-110, 110))
      ->defaultText(formatValue(view.primary_deg));
  app.addOption("--view-secondary-deg", view_secondary_deg, "Desired view of the anatomy: CRA positive, CAU negative")
      ->check(between(-55, 55))
      ->defaultText(formatValue(view.secondary_deg));
  app.addOption("--target-mm", target_mm,
                "The point that matters: x,y,z in the tree's coordinates, within 50 mm of it; else its centroid")
      ->check(between(-10000, 10000))
      ->delimiter(',')
      ->expected(3);
  app.addOption("--view-from", view_from,
                "Who says which view: settings (or the angles here), or bus: VIEW_REQUEST, as of angio-navigate")
      ->check(cli::oneOf({"settings", "bus"}))
      ->defaultText("settings");
  app.addOption(
         "--perception", perception,
         "Who registers frames: own; own_and_catheter, by a catheter alone as well where nothing else is seen; or "
         "bus: another program says REGISTRATION of each (angio-register --bus)")
      ->check(cli::oneOf(perceivers()))
      ->defaultText("own")
      ->group(cli::kFurtherOptions);
  app.addOption(
         "--centre-on", center_on,
         "What centre keeps: target, a point of the tree, or catheter_tip, of which angio-navigate says where it is")
      ->check(cli::oneOf({"target", "catheter_tip"}))
      ->defaultText("target");
}

bool LoopOptions::given() const {
  return !(task.empty() && view_from.empty() && perception.empty() && center_on.empty() && target_mm.empty()) ||
         view_primary_deg || view_secondary_deg;
}

void LoopOptions::applyTo(ServoSettings& settings) const {
  if (!task.empty()) settings.tasks.choose(task);
  if (!target_mm.empty()) settings.target_model = 1e-3 * Eigen::Map<const Eigen::Vector3d>(target_mm.data());
  ViewTaskSettings& view = settings.tasks.of<ViewTaskSettings>();
  view.primary_deg = view_primary_deg.value_or(view.primary_deg);
  view.secondary_deg = view_secondary_deg.value_or(view.secondary_deg);
  if (view_from == "bus") {
    const TaskSettings chosen = settings.tasks.chosen();
    if (!std::holds_alternative<ViewTaskSettings>(chosen)) {
      throw InputError("command line", "--view-from", view_from, "needs the task view, and not " + nameOf(chosen));
    }
    view.goal = ViewGoal::kRequested;
  }
  if (!perception.empty()) {
    const auto names = perceivers();
    const auto named = std::find(names.begin(), names.end(), perception) - names.begin();
    settings.perception = static_cast<ServoSettings::Perceiver>(named);
  }
  if (!center_on.empty()) {
    const TaskSettings chosen = settings.tasks.chosen();
    if (!std::holds_alternative<CenterTaskSettings>(chosen)) {
      throw InputError("command line", "--centre-on", center_on, "needs the task centre, and not " + nameOf(chosen));
    }
    settings.tasks.of<CenterTaskSettings>().on =
        center_on == "catheter_tip" ? CenterOn::kCatheterTip : CenterOn::kTarget;
  }
}

}  // namespace angio::apps
