// SPDX-License-Identifier: GPL-2.0-or-later
// angio-servo: drives a C-arm to a view of the anatomy by what its X-ray images show.
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/plotting/plot.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/servo_node.hpp"
#include "angio/servo/way_preview.hpp"
#include "angio/types/channels.hpp"
#include "hold_tally.hpp"
#include "loop_warnings.hpp"
#include "program_bus.hpp"
#include "servo_program.hpp"

namespace angio::apps {
namespace {

using Json = nlohmann::ordered_json;

double shown(int joint, double value) { return joint < 2 ? radToDeg(value) : 1e3 * value; }

std::vector<double> column(const WayPreview& way, const std::function<double(const WayPoint&)>& of) {
  std::vector<double> values;
  for (const WayPoint& point : way.points) values.push_back(of(point));
  return values;
}

// What hardly changes is shown on a scale on which it does not.
void widen(Plot& plot) {
  const auto atLeast = [](PlotAxis& axis, const std::vector<const std::vector<double>*>& values) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const auto* each : values) {
      low = std::min(low, *std::min_element(each->begin(), each->end()));
      high = std::max(high, *std::max_element(each->begin(), each->end()));
    }
    constexpr double kLeast = 2;  // deg or mm
    const double middle = 0.5 * (low + high);
    if (high - low < kLeast) axis.range = {middle - 0.5 * kLeast, middle + 0.5 * kLeast};
  };
  std::vector<const std::vector<double>*> x, y;
  for (const PlotSeries& series : plot.series) {
    x.push_back(&series.x);
    y.push_back(&series.y);
  }
  atLeast(plot.x, x);
  atLeast(plot.y, y);
}

cv::Mat pictureOf(const WayPreview& way) {
  const std::vector<double> time_s = column(way, [](const WayPoint& p) { return p.time_s; });
  Plot angles{"angles", {"time [s]"}, {"deg"}}, table{"table", {"time [s]"}, {"mm"}};
  for (int joint = 0; joint < kCArmJointCount; ++joint) {
    PlotSeries series{kJointNames[joint], time_s,
                      column(way, [&](const WayPoint& p) { return shown(joint, p.joints[joint]); })};
    series.color = joint < 2 ? joint : joint - 2;
    (joint < 2 ? angles : table).series.push_back(series);
  }
  Plot off{"from the goal", {"time [s]"}, {"target [mm]"}};
  off.series = {{"target", time_s, column(way, [](const WayPoint& p) { return 1e3 * p.target_off_m; })}};
  const CArmJoints &from = way.points.front().joints, &to = way.points.back().joints;
  Plot above{"table from above: start (ring), goal (dot), the box between them",
             {"x, to the patient's left [mm]"},
             {"z, to the head [mm]"}};
  const auto x = [](const CArmJoints& q) { return 1e3 * q[2]; };
  const auto z = [](const CArmJoints& q) { return 1e3 * q[4]; };
  above.series = {{"", {x(from), x(to), x(to), x(from), x(from)}, {z(from), z(from), z(to), z(to), z(from)}, 2},
                  {"", column(way, [&](const WayPoint& p) { return x(p.joints); }),
                   column(way, [&](const WayPoint& p) { return z(p.joints); })},
                  {"", {x(from), x(to)}, {z(from), z(to)}, kWarningColor, PlotSeries::Kind::kDots}};
  above.series[0].dashed = true;
  above.series[2].hollow = {true, false};
  above.equal_scale = true;
  for (Plot* plot : {&angles, &table, &off, &above}) widen(*plot);
  return drawPlots({angles, table, off, above});
}

Json jsonOf(const WayPreview& way, const ServoLoopSettings& settings) {
  const CArmJoints &from = way.points.front().joints, &to = way.points.back().joints;
  Json json = {{"arrives", !way.hold_reason}, {"duration_s", way.points.back().time_s}};
  if (way.hold_reason) json["reason"] = *way.hold_reason;
  const auto& view = std::get<ViewTaskSettings>(settings.task);
  json["table_excursion_mm"] = 1e3 * way.max_table_m;
  json["max_table_excursion_mm"] = view.max_table_excursion_mm;
  json["target_excursion_mm"] = 1e3 * way.max_target_m;
  json["max_target_excursion_mm"] = view.max_target_excursion_mm;
  for (int joint = 0; joint < kCArmJointCount; ++joint) {
    double fastest = 0;
    for (const WayPoint& p : way.points) fastest = std::max(fastest, std::abs(p.velocity[joint]));
    json["joints"].push_back(
        {{"name", kJointNames[joint]},
         {"unit", joint < 2 ? "deg" : "mm"},
         {"start", shown(joint, from[joint])},
         {"goal", shown(joint, to[joint])},
         {"fastest_per_s", shown(joint, fastest)},
         {"limit_per_s", shown(joint, settings.limits.velocity[joint])},
         {"range", {shown(joint, settings.limits.lower[joint]), shown(joint, settings.limits.upper[joint])}}});
  }
  return json;
}

// Writes the way that a view's task would take into a folder (preview.png, preview.json), prints it for people, and
// moves nothing. Throws InputError as previewWay() does, when a file cannot be written, and, with the files written,
// when the task would not arrive.
int previewTo(const std::string& folder, const ServoLoopSettings& settings, const VesselTree& tree,
              const CArmJoints& start) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw InputError(folder, "preview", "", "cannot be made: " + failed.message());
  const WayPreview way = previewWay(settings, tree, start);
  writeWholeFile(folder + "/preview.json", jsonOf(way, settings).dump(2) + "\n");
  std::vector<unsigned char> png;
  cv::imencode(".png", pictureOf(way), png);
  writeWholeFile(folder + "/preview.png", std::string(png.begin(), png.end()));
  const CArmJoints &from = way.points.front().joints, &to = way.points.back().joints;
  std::cout << formatted("angles  %+.1f %+.1f -> %+.1f %+.1f deg\n", shown(0, from[0]), shown(1, from[1]),
                         shown(0, to[0]), shown(1, to[1]))
            << formatted("table   %+.1f %+.1f %+.1f -> %+.1f %+.1f %+.1f mm\n", shown(2, from[2]), shown(3, from[3]),
                         shown(4, from[4]), shown(2, to[2]), shown(3, to[3]), shown(4, to[4]))
            << formatted(
                   "way     %.1f s; table %.1f mm outside start and goal, target %.1f mm further than at the start\n",
                   way.points.back().time_s, 1e3 * way.max_table_m, 1e3 * way.max_target_m)
            << "nothing was moved; the picture is " << folder << "/preview.png\n";
  if (way.hold_reason) throw InputError("preview", "task", "view", "would not arrive: " + *way.hold_reason);
  return 0;
}

// How long a machine may take to say where it is.
constexpr std::chrono::seconds kMaxWait(10);

// From where the simulation would start, or the machine on the bus stands.
int preview(const ServoProgramOptions& o, const ServoSettings& settings, const VesselTree& tree,
            const CArmCalibration& calibration) {
  const ServoLoopSettings loop = settings.loop(calibration);
  if (o.simulate) {
    const ViewAngles angles{degToRad(settings.scenario.start_primary_deg),
                            degToRad(settings.scenario.start_secondary_deg)};
    const Eigen::Vector3d target = loop.target_model.value_or(tree.centroid());
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
  RunLog log(*bus, o.record, "angio-servo");
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
