// SPDX-License-Identifier: GPL-2.0-or-later
// angio-navigate: steers a catheter to a branch of the tree by what X-ray images show, over a bus.
#include <iostream>
#include <optional>

#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/bus_help.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/servo/operator.hpp"
#include "loop_warnings.hpp"
#include "navigate_options.hpp"
#include "program_bus.hpp"

namespace angio::apps {
namespace {

struct Options {
  std::string tree = exampleDataFile("hepatic-tace/tree.csv"), calibration = exampleDataFile("hepatic-tace/carm.yaml");
  std::string bus = cli::kUsualBus, settings, record, disturb, key_file;
  RouteOptions way;
  double duration_s = 0;
  bool wait_for_operator = false, autostart = false, ask_for_views = false;
};

int navigate(const Options& o) {
  NavigateSettings settings = readNavigateSettings(o.settings);
  settings.controller.ask_for_views |= o.ask_for_views;
  const VesselTree tree = readVesselTree(o.tree);
  const TreeTopology map(tree);
  const TreeLocation start = o.way.start(map), target = o.way.target(map);
  const CArmCalibration calibration = readCArmCalibration(o.calibration, tree);
  const CArmSetup stage = settings.stage(calibration);
  const auto bus = openSharedBus(o.bus, o.disturb, o.key_file, "angio-navigate");
  if (const auto warning = unprotectedWarning(o.bus, o.key_file)) std::cerr << "angio-navigate: " << *warning << "\n";
  if (const auto warning = receiveBufferWarning(o.bus)) std::cerr << "angio-navigate: " << *warning << "\n";
  RunLog log(*bus, o.record, "angio-navigate",
             [&] { return recordedRun(tree, calibration, o.tree, o.calibration, navigateSettingsAsYaml(o.settings)); });
  CatheterNode node(log.bus(), stage, tree, start, target, settings.controller);
  std::optional<Operator> starter;
  if (o.autostart) {
    starter.emplace(log.bus(), OperatedMachine::kCatheter);
  } else {
    std::cerr << "angio-navigate: stands still until it is armed and started (angio-operator --machine catheter, or "
                 "--autostart)\n";
  }
  const RunTime run(o.duration_s);
  std::int64_t frames = 0, held = 0;
  LoopWarnings warnings("angio-navigate");
  std::string said;
  while (!run.over()) {
    bus->handle(std::chrono::milliseconds(20));
    const std::int64_t now_us = monotonic_us();
    if (starter) starter->start(now_us);
    const auto report = node.answer(now_us);
    log.watch();
    warnings.tell(node);
    if (!report) continue;
    ++frames;
    held += report->hold_reason.has_value();
    // A line for each change: held and why, or what it does, and where.
    const NavigationAnswer& answer = report->loop.answer;
    const std::string does = stateName(answer.state) + (answer.why.empty() ? "" : ": " + answer.why);
    const std::string line = report->hold_reason ? "held: " + *report->hold_reason : does;
    if (withoutNumbers(line) != said) {
      const auto& belief = report->loop.input.belief;
      const std::string where =
          belief ? formatted(" (branch %d, %.1f mm into it)", belief->tip.branch, 1e3 * belief->tip.arc_m) : "";
      std::cerr << formatted("%7.2f s  ", run.elapsed_s()) << line << where << "\n";
      said = withoutNumbers(line);
    }
    const bool over =
        node.loop().navigation() == NavigationState::kArrived || node.loop().navigation() == NavigationState::kGivenUp;
    if (over) break;
  }
  std::cout << stateName(node.loop().navigation()) << "; " << frames << " frames answered, " << held << " held, "
            << node.refused() << " messages refused\n";
  log.finish();
  return node.loop().navigation() == NavigationState::kGivenUp ? 1 : 0;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app("Steers a catheter to a branch of the tree by what X-ray images show.", "angio-navigate");
  angio::apps::describeProgram(app, "angio-navigate --from-branch 0 --to-branch 13");
  using angio::apps::between;
  angio::apps::Options o;
  app.addOption("--bus", o.bus, angio::cli::busHelp("Bus to listen on"));
  app.addOption("--tree", o.tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt)");
  app.addOption("--calibration", o.calibration, "C-arm geometry and T_dsa_cb (.yaml)");
  o.way.addTo(app)->required();
  app.addOption("--duration-s", o.duration_s, "How long at most; 0: until it has arrived or is stopped")
      ->check(between(0, 86400));
  app.addFlag("--wait-for-operator", o.wait_for_operator,
              "Stand still until CATHETER_REQUEST arms and starts (angio-operator --machine catheter): the default");
  app.addFlag("--autostart", o.autostart, "Arm and start at once, without an operator: for simulations and tests")
      ->excludes("--wait-for-operator");
  app.addOption("--key-file", o.key_file, angio::cli::kKeyFileHelp);
  app.addFlag("--ask-for-views", o.ask_for_views,
              "Ask the C-arm for views of the way (VIEW_REQUEST); angio-servo --view-from bus goes there");
  app.addOption("--record", o.record,
                "Log of all that is heard and said (.lcm; .mcap, for Foxglove too), for angio-replay");
  app.addOption("--disturb", o.disturb, "What happens to commands on their way (.yaml): loss, delay, jitter, ...");
  angio::apps::addSettingsOptions(
      app, o.settings, "Settings (.yaml): navigator, tracer, localiser, supervisor, states, freshness, limits, ...",
      angio::apps::navigateSettingsAsYaml);
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::navigate(o); });
}
