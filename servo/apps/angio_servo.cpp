// SPDX-License-Identifier: GPL-2.0-or-later
// angio-servo: drives a C-arm to a view of the anatomy by what its X-ray images show.
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <optional>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/cli/run_time.hpp"
#include "angio/io/claimed_folder.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/perception/patient_observation.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/servo_node.hpp"
#include "angio/types/channels.hpp"
#include "hold_tally.hpp"
#include "loop_warnings.hpp"
#include "preview.hpp"
#include "program_bus.hpp"
#include "servo_program.hpp"

namespace angio::apps {
namespace {

// How long a machine may take to say where it is.
constexpr std::chrono::seconds kMaxWait(10);

// From where the simulation would start, or the machine on the bus stands.
int preview(const ServoProgramOptions& o, const ServoSettings& settings, const VesselTree& tree,
            const CArmCalibration& calibration) {
  const ServoLoopSettings loop = settings.loop(calibration);
  const ClaimedFolder claimed(o.preview);  // Before the wait for a machine, not after it.
  if (o.simulate) {
    const ViewAngles angles{degToRad(settings.scenario.start_primary_deg),
                            degToRad(settings.scenario.start_secondary_deg)};
    const Eigen::Vector3d target = targetOf(loop, tree);
    return previewTo(o.preview, loop, tree, loop.carm.jointsFor(angles, loop.T_dsa_cb * target));
  }
  const auto bus = openSharedBus(o.bus, o.disturb, o.key_file, "angio-servo");
  const LatestMessage<CArmState> states(*bus, kCArmStateChannel);
  const auto end = std::chrono::steady_clock::now() + kMaxWait;
  while (!states.peek() && std::chrono::steady_clock::now() < end) bus->handle(std::chrono::milliseconds(50));
  if (!states.peek()) throw InputError(o.bus, kCArmStateChannel, "", "no machine says where it is");
  return previewTo(o.preview, loop, tree, states.peek()->joints);
}

// Listens until it is stopped; the arm's side stops by itself when no more commands come.
int serve(const ServoProgramOptions& o, const ServoSettings& settings, const VesselTree& tree,
          const CArmCalibration& calibration) {
  if (!o.preview.empty()) return preview(o, settings, tree, calibration);
  const ServoLoopSettings loop = settings.loop(calibration);
  const auto bus = openSharedBus(o.bus, o.disturb, o.key_file, "angio-servo");
  if (const auto warning = unprotectedWarning(o.bus, o.key_file)) std::cerr << "angio-servo: " << *warning << "\n";
  if (const auto warning = receiveBufferWarning(o.bus)) std::cerr << "angio-servo: " << *warning << "\n";
  RunLog log(*bus, o.record, "angio-servo",
             [&] { return recordedRun(tree, calibration, o.tree, o.calibration, settingsAsYaml(settings)); });
  ServoNode node(log.bus(), loop, tree);
  std::optional<Operator> starter;
  if (o.autostart) {
    starter.emplace(log.bus());
  } else {
    std::cerr << "angio-servo: stands still until it is armed and started (angio-operator, or --autostart)\n";
  }
  const RunTime run(o.duration_s.value_or(0));
  HoldTally tally;
  bool reached = false;
  LoopWarnings warnings("angio-servo");
  while (!run.over()) {
    bus->handle(std::chrono::milliseconds(20));
    const std::int64_t now_us = monotonic_us();
    if (starter) starter->start(now_us);
    const auto report = node.answer(now_us);
    log.watch();
    warnings.tell(node);
    if (!report) continue;
    tally.count(report->hold_reason);
    if (o.point_covariance && report->observed && !loop.external_registration) {
      const Observation& seen = report->observation;
      if (const auto points = registrationPoints(seen.registration, tree, seen.model_id, report->command.time_us,
                                                 report->command.frame_sequence)) {
        publish(log.bus(), kRegistrationPointsChannel, *points);
      }
    }
    if (report->hold_reason)
      std::cerr << "frame " << report->command.frame_sequence << " held: " << *report->hold_reason << "\n";
    if (report->task.reached && !reached && report->task.remark) std::cerr << *report->task.remark << "\n";
    reached = report->task.reached;
  }
  std::cout << tally.frames() << " frames answered, " << tally.held() << " held, " << node.refused()
            << " messages refused\n";
  log.finish();
  const auto never_moved = tally.neverMoved();
  if (never_moved) std::cerr << "angio-servo: " << *never_moved << "\n";
  return never_moved ? kExitNotReached : 0;
}

// The simulation is a program of its own, beside this one, so that the loop of a real machine links none. Takes this
// process over; comes back only by throwing.
int simulateInstead(char** argv) {
  const auto program = std::filesystem::read_symlink("/proc/self/exe").replace_filename("angio-servo-simulated");
  execv(program.c_str(), argv);
  throw InputError(program.string(), "--simulate", "", std::string("cannot be started: ") + std::strerror(errno));
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  return angio::apps::runServoProgram(
      argc, argv, [argv] { return angio::apps::simulateInstead(argv); }, angio::apps::serve);
}
