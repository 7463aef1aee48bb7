// SPDX-License-Identifier: GPL-2.0-or-later
// angio-simulate: X-ray frames and robot states on the bus, in real time; obeys velocity commands.
#include <csignal>
#include <iostream>
#include <thread>

#include "angio/calibration/carm_calibration.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/messaging/channels.hpp"
#include "angio/simulation/nodes.hpp"

namespace angio {
namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  std::string tree = exampleDataFile("hepatic-tace/tree.csv"), calibration = exampleDataFile("hepatic-tace/carm.yaml");
  std::string bus = "udpm://239.255.76.67:7667?ttl=0", settings;
  double start_primary_deg = 0, start_secondary_deg = 0, frame_rate_hz = 15, duration_s = 0;
};

volatile std::sig_atomic_t stopped = 0;

std::int64_t now_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(Clock::now().time_since_epoch()).count();
}

int simulate(const Options& o) {
  FluoroscopySettings fluoroscopy;
  if (!o.settings.empty()) fluoroscopy = readSettings(o.settings, fluoroscopy);
  const VesselTree tree = readVesselTree(o.tree);
  const CArmCalibration calibration = readCArmCalibration(o.calibration);
  const auto bus = openBus(o.bus);
  const CArmJoints start = calibration.carm.jointsFor({degToRad(o.start_primary_deg), degToRad(o.start_secondary_deg)},
                                                      calibration.T_dsa_cb * tree.centroid());
  SimulatedCArmNode arm(*bus, CArmLimits::typical(), start, now_us());
  SimulatedXrayNode xray(*bus, tree, fluoroscopy, calibration.carm, calibration.T_dsa_cb);
  const LatestValue<CArmState> heard(*bus, kCArmStateChannel);
  std::signal(SIGINT, [](int) { stopped = 1; });
  std::signal(SIGTERM, [](int) { stopped = 1; });

  const auto period = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / o.frame_rate_hz));
  const auto began = Clock::now();
  auto next = began;
  std::int64_t frames = 0;
  while (!stopped && (o.duration_s <= 0 || Clock::now() - began < std::chrono::duration<double>(o.duration_s))) {
    arm.report(now_us());
    const std::int64_t exposure_us = arm.arm().state().time_us;
    // The X-ray looks from where the bus says the arm is: the state of this exposure has to have come round.
    const auto patience = Clock::now() + period;
    while (!(heard.peek() && heard.peek()->time_us == exposure_us) && Clock::now() < patience && !stopped) {
      bus->handle(std::chrono::milliseconds(5));
    }
    if (heard.peek() && heard.peek()->time_us == exposure_us) frames += xray.expose(exposure_us).has_value();
    next += period;
    // Commands are obeyed as they arrive, not once a frame.
    for (auto left = next - Clock::now(); left > Clock::duration::zero() && !stopped; left = next - Clock::now()) {
      bus->handle(std::chrono::ceil<std::chrono::milliseconds>(left));
      arm.listen(now_us());
    }
    arm.listen(now_us());
    if (Clock::now() > next + period)
      next = Clock::now();  // A slow machine drops frames; it does not catch up in a burst.
  }
  std::cout << frames << " frames shown\n";
  return 0;
}

}  // namespace
}  // namespace angio

int main(int argc, char** argv) {
  CLI::App app("Simulated X-ray and C-arm: publishes frames and joint states, obeys velocity commands.",
               "angio-simulate");
  angio::describeProgram(app, "angio-simulate --bus 'udpm://239.255.76.67:7667?ttl=0' --duration-s 60");
  using angio::between;
  angio::Options o;
  app.add_option("--bus", o.bus, "Bus (LCM URL)");
  app.add_option("--tree", o.tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt)");
  app.add_option("--calibration", o.calibration, "C-arm geometry and how the patient really lies (.yaml)");
  app.add_option("--start-primary-deg", o.start_primary_deg, "C-arm angle at the start")->check(between(-110, 110));
  app.add_option("--start-secondary-deg", o.start_secondary_deg, "C-arm angle at the start")->check(between(-55, 55));
  app.add_option("--frame-rate-hz", o.frame_rate_hz, "Frames a second")->check(between(0.1, 100));
  app.add_option("--duration-s", o.duration_s, "How long; 0: until stopped")->check(between(0, 86400));
  app.add_option("--settings", o.settings, "Settings of the X-ray (.yaml)");
  return angio::runProgram(app, argc, argv, [&] { return angio::simulate(o); });
}
