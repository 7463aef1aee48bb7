// SPDX-License-Identifier: GPL-2.0-or-later
#include "register_bus.hpp"

#include <chrono>
#include <iostream>
#include <optional>

#include "angio/base/errors.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/bus_help.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/messaging/authenticated_bus.hpp"
#include "angio/perception/perception_node.hpp"
#include "angio/types/channels.hpp"

namespace angio::apps {
namespace {

GatedPerceptionSettings settingsOf(const RegisterBusOptions& o, const VesselTree& tree) {
  GatedPerceptionSettings node;
  if (o.method == IterativePnpSettings::kName) {
    node.perception.useIterativePnp();
  } else if (o.method != OrientedKernelSettings::kName) {
    throw InputError(
        "angio-register", "--method", o.method,
        std::string("must be ") + OrientedKernelSettings::kName + " or " + IterativePnpSettings::kName + " on a bus");
  }
  const CArmCalibration calibration = readCArmCalibration(o.calibration, tree);
  node.carm = calibration.carm;
  node.T_dsa_cb = calibration.T_dsa_cb;
  return node;
}

}  // namespace

int registerOnBus(const RegisterBusOptions& o) {
  const VesselTree tree = readVesselTree(o.tree);
  const GatedPerceptionSettings settings = settingsOf(o, tree);
  const auto bus = withKeyFile(openSharedBus(o.bus), o.key_file,
                               [](const std::string& line) { std::cerr << "angio-register: " << line << "\n"; });
  if (const auto warning = unprotectedWarning(o.bus, o.key_file)) std::cerr << "angio-register: " << *warning << "\n";
  if (const auto warning = receiveBufferWarning(o.bus)) std::cerr << "angio-register: " << *warning << "\n";
  PerceptionNode node(*bus, settings, tree);
  const RunTime run(o.duration_s);
  long frames = 0, rejected = 0;
  while (!run.over() && !bus->ended()) {
    bus->handle(std::chrono::milliseconds(100));
    const auto report = node.observe();
    if (!report) continue;
    ++frames;
    rejected += report->rejection.has_value();
    if (report->message && o.point_covariance) {
      const RegistrationMessage& said = *report->message;
      const auto points =
          registrationPoints(report->observation.registration, tree, said.model_id, said.time_us, said.frame_sequence);
      if (points) publish(*bus, kRegistrationPointsChannel, *points);
    }
    if (report->rejection) {
      std::cerr << "frame " << report->frame_sequence << " rejected: " << *report->rejection << "\n";
    }
  }
  std::cout << frames << " frames registered, " << rejected << " rejected, " << node.refused() << " messages refused\n";
  return 0;
}

}  // namespace angio::apps
