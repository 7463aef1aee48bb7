// SPDX-License-Identifier: GPL-2.0-or-later
#include "register_bus.hpp"

#include <chrono>
#include <csignal>
#include <iostream>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/perception/perception_node.hpp"

namespace angio::apps {
namespace {

using Clock = std::chrono::steady_clock;

volatile std::sig_atomic_t stopped = 0;

GatedPerceptionSettings settingsOf(const BusOptions& o) {
  GatedPerceptionSettings node;
  if (o.method == IterativePnpSettings::kName) {
    node.perception.useIterativePnp();
  } else if (o.method != OrientedKernelSettings::kName) {
    throw InputError(
        "angio-register", "--method", o.method,
        std::string("must be ") + OrientedKernelSettings::kName + " or " + IterativePnpSettings::kName + " on a bus");
  }
  const CArmCalibration calibration = readCArmCalibration(o.calibration);
  node.carm = calibration.carm;
  node.T_dsa_cb = calibration.T_dsa_cb;
  return node;
}

}  // namespace

int registerOnBus(const BusOptions& o) {
  const GatedPerceptionSettings settings = settingsOf(o);
  const VesselTree tree = readVesselTree(o.tree);
  const auto bus = openSharedBus(o.bus);
  if (const auto warning = receiveBufferWarning(o.bus)) std::cerr << "angio-register: " << *warning << "\n";
  PerceptionNode node(*bus, settings, tree);
  std::signal(SIGINT, [](int) { stopped = 1; });
  std::signal(SIGTERM, [](int) { stopped = 1; });
  const auto end = Clock::now() + std::chrono::duration<double>(o.duration_s);
  long frames = 0, rejected = 0;
  while (!stopped && !bus->ended() && (o.duration_s <= 0 || Clock::now() < end)) {
    bus->handle(std::chrono::milliseconds(100));
    const auto report = node.observe();
    if (!report) continue;
    ++frames;
    rejected += report->rejection.has_value();
    if (report->rejection) {
      std::cerr << "frame " << report->frame_sequence << " rejected: " << *report->rejection << "\n";
    }
  }
  std::cout << frames << " frames registered, " << rejected << " rejected, " << node.refused() << " messages refused\n";
  return 0;
}

}  // namespace angio::apps
