// SPDX-License-Identifier: GPL-2.0-or-later
// angio-slicer: a run of the bus for 3D Slicer, by OpenIGTLink.
#include <chrono>
#include <iostream>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/bus_help.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/run_time.hpp"
#include "angio/io/displacement_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/messaging/authenticated_bus.hpp"
#include "angio/slicer/slicer_bridge.hpp"

namespace angio::apps {
namespace {

// After so many lines on what clients sent wrongly, they are counted only.
constexpr int kMaxProblems = 20;

struct Options {
  std::string bus = cli::kUsualBus, key_file, tree = exampleDataFile("hepatic-tace/tree.csv"),
              calibration = exampleDataFile("hepatic-tace/carm.yaml"), displacements;
  igtl::IgtlServerSettings server;
  int header_version = 1;
  double duration_s = 0, within_deg = 0.5, within_mm = 2;
};

SlicerScene sceneOf(const Options& o) {
  const VesselTree tree = readVesselTree(o.tree);
  const CArmCalibration calibration = readCArmCalibration(o.calibration, tree);
  Eigen::Matrix3Xd displacements_m(3, 0);
  if (!o.displacements.empty()) displacements_m = readDisplacements(o.displacements, tree.size());
  return {tree,         displacements_m, calibration.carm, calibration.T_dsa_cb, calibration.R_lps_model,
          o.within_deg, o.within_mm};
}

int serve(Options o) {
  const auto tell = [](const std::string& line) { std::cerr << "angio-slicer: " << line << "\n"; };
  const SlicerScene scene = sceneOf(o);
  const auto bus = withKeyFile(openSharedBus(o.bus), o.key_file, tell);
  if (const auto warning = unprotectedWarning(o.bus, o.key_file)) tell(*warning);
  if (const auto warning = receiveBufferWarning(o.bus)) tell(*warning);
  o.server.version = o.header_version == 2 ? igtl::HeaderVersion::k2 : igtl::HeaderVersion::k1;
  igtl::IgtlServer server(o.server);
  if (o.server.address != "127.0.0.1") {
    tell("whoever reaches " + o.server.address + " sees the images and may ask for views: OpenIGTLink has no key");
  }
  int problems = 0;
  SlicerBridge bridge(*bus, server, scene, [&](const std::string& line) {
    if (++problems <= kMaxProblems) tell(line);
  });
  std::cerr << "angio-slicer: listens on " << o.server.address << ":" << server.port() << "\n";
  const RunTime run(o.duration_s);
  while (!run.over() && !bus->ended()) {
    bus->handle(std::chrono::milliseconds(5));
    bridge.serve(monotonic_us(), std::chrono::milliseconds(5));
  }
  std::cout << bridge.frames() << " frames shown, " << server.droppedImages() << " dropped for slow clients, "
            << bridge.requests() << " views asked for, " << server.refused() + bridge.refused()
            << " messages refused\n";
  return 0;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app(
      "Shows a run to 3D Slicer by OpenIGTLink: frames in space, tree, C-arm, table, catheter tip and status; and "
      "passes "
      "on the views that are asked for there.",
      "angio-slicer");
  angio::apps::describeProgram(app, "angio-slicer --tree tree.csv --calibration lab.yaml");
  using angio::apps::between;
  angio::apps::Options o;
  app.addOption("--bus", o.bus, angio::cli::busHelp("Bus to show"));
  app.addOption("--tree", o.tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt); its frame is the one that is shown");
  app.addOption("--calibration", o.calibration, "C-arm geometry and T_dsa_cb (.yaml)");
  app.addOption("--displacements", o.displacements, "Of the tree's points (.csv), for a second, deformed tree");
  app.addOption("--port", o.server.port, "TCP port; 0: any that is free")->check(angio::cli::wholeBetween(0, 65535));
  app.addOption("--address", o.server.address,
                "IPv4 address of the interface to listen on: this machine alone, or 0.0.0.0 for all");
  app.addOption("--header-version", o.header_version,
                "Of OpenIGTLink's headers until a client speaks another: 1, or 2 with metadata")
      ->check(angio::cli::wholeBetween(1, 2));
  app.addOption("--within-deg", o.within_deg,
                "A view that was asked for is reached when the beam is as near as this ...")
      ->check(between(0.01, 10));
  app.addOption("--within-mm", o.within_mm, "... and the target")->check(between(0.1, 100));
  app.addOption("--key-file", o.key_file, angio::cli::kKeyFileHelp);
  app.addOption("--duration-s", o.duration_s, "How long; 0: until stopped")->check(between(0, 86400));
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::serve(o); });
}
