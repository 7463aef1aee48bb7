// SPDX-License-Identifier: GPL-2.0-or-later
// angio-simulate: X-ray frames and robot states on the bus, in real time; obeys velocity commands. Or, with --out, a
// run in files with its truth.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <iostream>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/cli/bus_help.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/further_options.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/imaging/xray_frame.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/simulation/nodes.hpp"
#include "angio/types/channels.hpp"
#include "catheter_options.hpp"
#include "centered_option.hpp"
#include "navigate_options.hpp"
#include "patient_options.hpp"
#include "program_bus.hpp"
#include "run_files.hpp"

namespace angio::apps {
namespace {

using Clock = std::chrono::steady_clock;

// So long it may take until simulated machines stop.
constexpr std::chrono::milliseconds kMaxWait(100);

// The simulated C-arm, and the catheter drive where there is one, in real time on a thread and a bus of their own: as
// real machines they hear and report while the X-ray is busy.
class SimulatedDevices {
 public:
  // How a catheter begins; borrows the tree.
  struct Catheter {
    const VesselTree& tree;
    CatheterSettings settings;
    TreeLocation start;
  };

  SimulatedDevices(std::unique_ptr<Bus> bus, const CArmLimits& limits, const CArmJoints& start,
                   const std::optional<Catheter>& catheter)
      : bus_(std::move(bus)), arm_(*bus_, limits, start, monotonic_us()) {
    if (catheter) catheter_.emplace(*bus_, catheter->tree, catheter->settings, catheter->start, monotonic_us());
  }

  ~SimulatedDevices() { end(); }
  SimulatedDevices(const SimulatedDevices&) = delete;
  SimulatedDevices& operator=(const SimulatedDevices&) = delete;

  // From now on they obey what they hear as it comes, and report at `first` and every `period` after it.
  void start(Clock::time_point first, Clock::duration period) {
    thread_ = std::thread([this, first, period] {
      try {
        run(first, period);
      } catch (...) {
        thrown_ = std::current_exception();
        failed_ = true;
      }
    });
  }

  // Ends that. Throws what went wrong meanwhile.
  void stop() {
    end();
    if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
  }

  // Whether they have stopped by themselves, as something went wrong.
  bool failed() const { return failed_; }

  // The catheter as it is now, as SimulatedCatheter::device. Only with a catheter; at any time.
  Device device(const Eigen::Matrix3Xd& points) const {
    const std::lock_guard<std::mutex> lock(moving_);
    return catheter_->catheter().device(points);
  }

  // Only while stopped.
  const SimulatedCArm& arm() const { return arm_.arm(); }
  const std::optional<SimulatedCatheterNode>& catheter() const { return catheter_; }

 private:
  void run(Clock::time_point first, Clock::duration period) {
    for (auto due = first; !stopped_;) {
      const auto left = std::clamp<Clock::duration>(due - Clock::now(), Clock::duration::zero(), kMaxWait);
      bus_->handle(std::chrono::floor<std::chrono::milliseconds>(left));
      listen();
      if (due - Clock::now() >= std::chrono::milliseconds(1)) continue;  // A message came first.
      std::this_thread::sleep_until(due);                                // What a wait in milliseconds left.
      report();
      due += period * ((Clock::now() - due) / period + 1);  // What was missed is not made up for in a burst.
    }
  }

  void listen() {
    const std::lock_guard<std::mutex> lock(moving_);
    arm_.listen(monotonic_us());
    if (catheter_) catheter_->listen(monotonic_us());
    while (const auto news = arm_.takeNews()) std::cerr << "angio-simulate: C-arm: " << *news << "\n";
    while (const auto news = catheter_ ? catheter_->takeNews() : std::nullopt) {
      std::cerr << "angio-simulate: catheter: " << *news << "\n";
    }
  }

  void report() {
    const std::lock_guard<std::mutex> lock(moving_);
    arm_.report(monotonic_us());
    if (catheter_) catheter_->report(monotonic_us());
  }

  void end() {
    stopped_ = true;
    if (thread_.joinable()) thread_.join();
  }

  std::unique_ptr<Bus> bus_;
  SimulatedCArmNode arm_;
  std::optional<SimulatedCatheterNode> catheter_;
  mutable std::mutex moving_;  // Of what the machines are.
  std::atomic<bool> stopped_{false}, failed_{false};
  std::exception_ptr thrown_;
  std::thread thread_;
};

struct Options {
  std::string tree = exampleDataFile("hepatic-tace/tree.csv"), calibration = exampleDataFile("hepatic-tace/carm.yaml");
  std::string bus = cli::kUsualBus, settings, disturb, key_file, t_dsa_cb;
  double start_primary_deg = 0, start_secondary_deg = 0, frame_rate_hz = 15, duration_s = 0;
  std::optional<double> end_primary_deg, end_secondary_deg;
  std::optional<int> seed;
  PatientOptions patient;
  ImageEncoding encoding = ImageEncoding::kRaw;
  std::vector<int> region;             // x, y, width, height [px]; empty: the whole detector.
  std::optional<int> catheter_branch;  // With a catheter, its tip there.
  double catheter_mm = 30;
  CatheterOptions catheter;
  bool xray_only = false;  // Another program on the bus is the C-arm.
  RunOptions run;          // Without a folder: on the bus.
};

/// What the settings file may say: the patient's keys at the top, and a section of the catheter's.
struct SimulateSettings {
  SimulatedPatientSettings patient;
  CatheterSettings catheter;
  double roadmap_contrast_s = 1.5;

  void visit(SettingsVisitor& v) {
    patient.visit(v);
    v.section("catheter", [this](SettingsVisitor& s) { catheter.visit(s); });
    v.number("roadmap_contrast_s", roadmap_contrast_s, 0, 60,
             "With the bolus' trigger demand: how long is injected after a view is reached");
  }
};

SimulateSettings effectiveSettings(const Options& o) {
  SimulateSettings settings;
  if (!o.settings.empty()) settings = readSettings(o.settings, settings);
  o.patient.applyTo(settings.patient);
  o.catheter.applyTo(settings.catheter);
  settings.patient.fluoroscopy.seed = o.seed.value_or(settings.patient.fluoroscopy.seed);
  return settings;
}

ViewAngles anglesOf(double primary_deg, double secondary_deg) {
  return {degToRad(primary_deg), degToRad(secondary_deg)};
}

int writeFiles(const Options& o) {
  const SimulatedPatientSettings settings = effectiveSettings(o).patient;
  const VesselTree tree = readVesselTree(o.tree);
  const CArmCalibration calibration = readCalibration("angio-simulate", o.calibration, o.t_dsa_cb, tree);
  RunOptions run = o.run;
  run.frame_rate_hz = o.frame_rate_hz;
  run.from = anglesOf(o.start_primary_deg, o.start_secondary_deg);
  run.to =
      anglesOf(o.end_primary_deg.value_or(o.start_primary_deg), o.end_secondary_deg.value_or(o.start_secondary_deg));
  ProgressBar bar("rendering", run.frames);
  writeRun(tree, calibration, settings, run, [&](int done) { bar.show(done); });
  std::cout << run.frames << " frames and their truth are in " << run.folder << "/\n";
  return 0;
}

constexpr double kReports_hz = 100;

void send(Bus& bus, const XrayFrame& frame, const Options& o) {
  const auto& r = o.region;
  bus.publish(kXrayFrameChannel, encode(r.empty() ? frame : cropped(frame, {r[0], r[1], r[2], r[3]}), o.encoding));
}

int simulate(const Options& o) {
  if (o.bus.rfind("file://", 0) == 0) {
    throw InputError("bus", "url", o.bus, "must be live, as machines hear commands there: --out writes a run to files");
  }
  const SimulateSettings settings = effectiveSettings(o);
  const VesselTree tree = readVesselTree(o.tree);
  const CArmCalibration calibration = readCalibration("angio-simulate", o.calibration, o.t_dsa_cb, tree);
  std::optional<SimulatedDevices::Catheter> catheter;
  if (o.catheter_branch) {
    catheter.emplace(SimulatedDevices::Catheter{
        tree, settings.catheter, placeOf(TreeTopology(tree), "catheter", *o.catheter_branch, o.catheter_mm)});
  }
  const auto opened = [&] { return openSharedBus(o.bus, o.disturb, o.key_file, "angio-simulate"); };
  const auto bus = opened();
  if (const auto warning = unprotectedWarning(o.bus, o.key_file)) std::cerr << "angio-simulate: " << *warning << "\n";
  SimulatedDevices machines(opened(), CArmLimits::typical(),
                            calibration.carm.jointsFor(anglesOf(o.start_primary_deg, o.start_secondary_deg),
                                                       calibration.T_dsa_cb * tree.centroid()),
                            catheter);
  SimulatedXrayNode xray(tree, settings.patient, calibration.carm, calibration.T_dsa_cb);
  if (catheter) xray.show([&](const Eigen::Matrix3Xd& points) { return machines.device(points); });
  const LatestMessage<CArmState> heard(*bus, kCArmStateChannel);
  SimulatedInjector injector(*bus, settings.roadmap_contrast_s);
  const bool on_demand = settings.patient.bolus.enabled && settings.patient.bolus.trigger == BolusTrigger::kDemand;

  // A report comes with every exposure.
  const double reports = std::max(1.0, std::round(kReports_hz / o.frame_rate_hz));
  const auto report_period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / (o.frame_rate_hz * reports)));
  const auto period = report_period * std::llround(reports);
  const auto began = Clock::now();
  const RunTime run(o.duration_s);
  const auto goesOn = [&] { return !run.over() && !machines.failed(); };
  if (!o.xray_only) machines.start(began, report_period);
  std::int64_t frames = 0;
  std::optional<std::int64_t> exposed_us;
  for (auto next = began; goesOn();) {
    // The X-ray looks from where the bus says the arm is: what it says of this exposure has to have come round.
    // Another's C-arm has its own clock: its newest state is of this exposure, if none was exposed by it yet.
    const auto has_come = [&] {
      if (!heard.peek()) return false;
      const std::int64_t said_us = heard.peek()->time_us;
      return o.xray_only ? said_us != exposed_us && Clock::now() >= next : said_us >= monotonic_us(next);
    };
    while (!has_come() && Clock::now() < next + period && goesOn()) bus->handle(std::chrono::milliseconds(5));
    if (has_come()) {
      exposed_us = heard.peek()->time_us;
      if (on_demand && injector.injects(*exposed_us)) {
        xray.beginInjection(*exposed_us);
      } else {
        xray.endInjection(*exposed_us);
      }
      send(*bus, xray.render(heard.peek()->time_us, heard.peek()->joints), o);
      ++frames;
    }
    next += period;
    if (Clock::now() > next + period) next = Clock::now();  // A slow machine drops frames, and makes no burst of them.
  }
  machines.stop();
  std::cout << frames << " frames shown";
  if (!o.xray_only) {
    std::cout << "; " << machines.arm().ignored().total()
              << " commands refused; commands ran out before the next came: " << machines.arm().ranOut();
  }
  std::cout << "\n";
  if (catheter) {
    const CatheterTruth truth = machines.catheter()->catheter().truth();
    std::cout << formatted(
        "the catheter's tip is in branch %d, %.1f mm into it; it touched a wall %d times, with %.2f N at most\n",
        truth.tip.branch, 1e3 * truth.tip.arc_m, truth.wall_contacts, truth.max_tip_force_n);
  }
  return 0;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app(
      "Simulated X-ray and C-arm: publishes frames and joint states, obeys velocity commands. With --out: writes a run "
      "of frames with its truth, for angio-evaluate cases.",
      "angio-simulate");
  angio::apps::describeProgram(app,
                               "angio-simulate --out run --frames 60 --start-primary-deg 30 --settings scene.yaml");
  using angio::apps::between;
  angio::apps::Options o;
  app.addOption("--bus", o.bus, angio::cli::busHelp("Bus"));
  app.addOption("--key-file", o.key_file, angio::cli::kKeyFileHelp)->group(angio::cli::kFurtherOptions);
  app.addOption("--tree", o.tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt)");
  app.addOption("--calibration", o.calibration, "C-arm geometry and how the patient really lies (.yaml)");
  angio::apps::addCenteredOption(app, o.t_dsa_cb);
  app.addOption("--start-primary-deg", o.start_primary_deg, "C-arm angle at the start")->check(between(-110, 110));
  app.addOption("--start-secondary-deg", o.start_secondary_deg, "C-arm angle at the start")->check(between(-55, 55));
  app.addOption("--frame-rate-hz", o.frame_rate_hz, "Frames a second")->check(between(0.1, 100));
  app.addOption("--duration-s", o.duration_s, "How long; 0: until stopped")->check(between(0, 86400));
  const std::map<std::string, angio::apps::ImageEncoding> encodings{{"raw", angio::apps::ImageEncoding::kRaw},
                                                                    {"png", angio::apps::ImageEncoding::kPng}};
  app.addOption("--transport", o.encoding, "How pixels travel: raw, or png without loss and with half the bytes")
      ->check(angio::apps::choice(encodings))
      ->defaultText("raw")
      ->group(angio::cli::kFurtherOptions);
  app.addOption("--region", o.region, "Only this window of the detector is sent: x,y,width,height [px]")
      ->delimiter(',')
      ->expected(4)
      ->group(angio::cli::kFurtherOptions);
  auto* catheter = app.addOption("--catheter-branch", o.catheter_branch,
                                 "With a catheter and its drive: the branch of the tree that its tip begins in")
                       ->check(angio::cli::wholeBetween(0, 1000000));
  app.addOption("--catheter-mm", o.catheter_mm, "How far into that branch")->check(between(0, 1500))->needs(catheter);
  o.catheter.addTo(app);
  app.addFlag("--xray-only", o.xray_only, "Without a C-arm: another program on the bus says CARM_STATE")
      ->excludes(catheter)
      ->group(angio::cli::kFurtherOptions);
  app.addOption("--disturb", o.disturb, "What happens to messages on their way (.yaml): loss, delay, jitter, ...")
      ->group(angio::cli::kFurtherOptions);
  o.patient.addTo(app);
  angio::apps::addSettingsOptions(app, o.settings,
                                  "Settings of the X-ray, contrast agent, motion, device and catheter (.yaml)",
                                  angio::io::settingsInForce<angio::apps::SimulateSettings>);
  app.addOption("--seed", o.seed, "Seed of anatomy, noise, motion and starts; before the settings file's")
      ->check(angio::cli::wholeBetween(0, 2147483647));
  auto* out = app.addOption("--out", o.run.folder, "Folder for a run in files, without a bus")->excludes(catheter);
  const std::map<std::string, angio::apps::FrameFormat> formats{{"png", angio::apps::FrameFormat::kPng},
                                                                {"tif", angio::apps::FrameFormat::kTiff},
                                                                {"run", angio::apps::FrameFormat::kRun}};
  app.addOption("--frames", o.run.frames, "Frames of the run")->check(angio::cli::wholeBetween(1, 9999))->needs(out);
  app.addOption("--format", o.run.format, "png or tif: a file a frame; run: all in one TIFF")
      ->check(angio::apps::choice(formats))
      ->defaultText("png")
      ->needs(out)
      ->group(angio::cli::kFurtherOptions);
  app.addOption("--end-primary-deg", o.end_primary_deg, "C-arm angle at the last frame")
      ->check(between(-110, 110))
      ->needs(out)
      ->group(angio::cli::kFurtherOptions);
  app.addOption("--end-secondary-deg", o.end_secondary_deg, "C-arm angle at the last frame")
      ->check(between(-55, 55))
      ->needs(out)
      ->group(angio::cli::kFurtherOptions);
  app.addOption("--start-rotation-deg", o.run.start_rotation_deg,
                "Spread of the calibration error in the initial poses, per axis; one draw a run")
      ->check(between(0, 180))
      ->needs(out)
      ->group(angio::cli::kFurtherOptions);
  app.addOption("--start-translation-mm", o.run.start_translation_mm,
                "Spread of the calibration error in the initial poses, per axis; one draw a run")
      ->check(between(0, 1000))
      ->needs(out)
      ->group(angio::cli::kFurtherOptions);
  return angio::apps::runProgram(
      app, argc, argv, [&] { return o.run.folder.empty() ? angio::apps::simulate(o) : angio::apps::writeFiles(o); });
}
