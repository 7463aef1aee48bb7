// SPDX-License-Identifier: GPL-2.0-or-later
#include "preview.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/plotting/plot.hpp"
#include "angio/servo/trajectory_preview.hpp"

namespace angio::apps {
namespace {

using Json = nlohmann::ordered_json;

double shown(int joint, double value) { return joint < 2 ? radToDeg(value) : 1e3 * value; }

std::vector<double> column(const TrajectoryPreview& way, const std::function<double(const TrajectoryPoint&)>& of) {
  std::vector<double> values;
  for (const TrajectoryPoint& point : way.points) values.push_back(of(point));
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

cv::Mat pictureOf(const TrajectoryPreview& way) {
  const std::vector<double> time_s = column(way, [](const TrajectoryPoint& p) { return p.time_s; });
  Plot angles{"angles", {"time [s]"}, {"deg"}}, table{"table", {"time [s]"}, {"mm"}};
  for (int joint = 0; joint < kCArmJointCount; ++joint) {
    PlotSeries series{kJointNames[joint], time_s,
                      column(way, [&](const TrajectoryPoint& p) { return shown(joint, p.joints[joint]); })};
    series.color = joint < 2 ? joint : joint - 2;
    (joint < 2 ? angles : table).series.push_back(series);
  }
  Plot off{"from the goal", {"time [s]"}, {"target [mm]"}};
  off.series = {{"target", time_s, column(way, [](const TrajectoryPoint& p) { return 1e3 * p.target_off_m; })}};
  const CArmJoints &from = way.points.front().joints, &to = way.points.back().joints;
  Plot above{"table from above: start (ring), goal (dot), the box between them",
             {"x, to the patient's left [mm]"},
             {"z, to the head [mm]"}};
  const auto x = [](const CArmJoints& q) { return 1e3 * q[2]; };
  const auto z = [](const CArmJoints& q) { return 1e3 * q[4]; };
  above.series = {{"", {x(from), x(to), x(to), x(from), x(from)}, {z(from), z(from), z(to), z(to), z(from)}, 2},
                  {"", column(way, [&](const TrajectoryPoint& p) { return x(p.joints); }),
                   column(way, [&](const TrajectoryPoint& p) { return z(p.joints); })},
                  {"", {x(from), x(to)}, {z(from), z(to)}, kWarningColor, PlotSeries::Kind::kDots}};
  above.series[0].dashed = true;
  above.series[2].hollow = {true, false};
  above.equal_scale = true;
  for (Plot* plot : {&angles, &table, &off, &above}) widen(*plot);
  return drawPlots({angles, table, off, above});
}

Json jsonOf(const TrajectoryPreview& way, const ServoLoopSettings& settings) {
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
    for (const TrajectoryPoint& p : way.points) fastest = std::max(fastest, std::abs(p.velocity[joint]));
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

}  // namespace

int previewTo(const std::string& folder, const ServoLoopSettings& settings, const VesselTree& tree,
              const CArmJoints& start) {
  const TrajectoryPreview way = previewTrajectory(settings, tree, start);
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

}  // namespace angio::apps
