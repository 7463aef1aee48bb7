// SPDX-License-Identifier: GPL-2.0-or-later
#include <functional>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/joined.hpp"
#include "angio/evaluation/simulation_run.hpp"
#include "angio/results/experiment.hpp"

namespace angio::evaluation {
namespace {

struct Range {
  std::function<void(SimulationSettings&, double)> set;
  const char *name, *axis, *unit;
  std::vector<double> values;
};

template <typename Value>
Range of(Value SimulationSettings::*field, const char* name, const char* axis, const char* unit,
         const std::vector<double>& values) {
  return {[field](SimulationSettings& s, double x) { s.*field = static_cast<Value>(x); }, name, axis, unit, values};
}

void setStart(SimulationSettings& s, double x) {
  // The paper's pairs, and one beyond.
  s.rotation_std_deg = x <= 1 ? 0.5 : x <= 3 ? 1 : x <= 5 ? 2 : x <= 8 ? 3 : x <= 10 ? 5 : 8;
  s.translation_std_mm = x;
}

void setCalibration(SimulationSettings& s, double x) {
  s.views = 2;
  s.calibration_rotation_error_deg = x;
  s.calibration_translation_error_mm = 2 * x;
}

const std::vector<Range>& ranges() {
  using S = SimulationSettings;
  static const std::vector<Range> kRanges = {
      of(&S::visible_fraction, "visible-fraction", "share of the tree in the field of view", "",
         {1, 0.9, 0.75, 0.6, 0.5, 0.4, 0.3, 0.2}),
      of(&S::noise_px, "noise", "noise of each image coordinate [px]", " px", {0, 0.5, 1, 1.5, 2, 3}),
      of(&S::spurious, "spurious", "spurious curves per view", "", {0, 2, 5, 10, 20, 40}),
      of(&S::missing, "missing", "share of the tree's branches not in the image", "",
         {0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6}),
      of(&S::filled, "filled", "share of the tree that contrast agent fills, downstream of injection sites", "",
         {1, 0.8, 0.6, 0.5, 0.4, 0.3, 0.2}),
      Range{setStart,
            "start",
            "spread of the starts per axis [mm, with the rotations of the table]",
            " mm",
            {1, 3, 5, 8, 10, 15}},
      of(&S::focal_error_percent, "focal", "error of the focal length [%]", " %", {0, 0.1, 0.25, 0.5, 1, 2}),
      Range{setCalibration,
            "calibration",
            "error between the two views [deg, and twice as many mm]",
            " deg",
            {0, 0.1, 0.25, 0.5, 1, 2}},
      of(&S::deformation_rms_mm, "deformation", "rms deformation of the tree [mm]", " mm", {0, 0.25, 0.5, 1, 2, 4, 8})};
  return kRanges;
}

Sweep sweepOver(const Range& range, const SimulationSettings& base) {
  Sweep sweep{range.name, range.axis, {}};
  for (const double value : range.values) {
    Sweep::Point point{value, formatValue(value) + range.unit, base};
    range.set(point.settings, value);
    if (sweep.name == "start") point.label = formatValue(point.settings.rotation_std_deg) + " deg, " + point.label;
    if (sweep.name == "calibration") point.label += ", " + formatValue(2 * value) + " mm";
    sweep.points.push_back(point);
  }
  return sweep;
}

}  // namespace

std::vector<std::string> sweepNames() {
  std::vector<std::string> names;
  for (const auto& range : ranges()) names.push_back(range.name);
  return names;
}

std::vector<Sweep> sweepsNamed(const std::string& name, const SimulationSettings& base) {
  std::vector<Sweep> sweeps;
  for (const auto& range : ranges()) {
    if (name == range.name || name == "all") sweeps.push_back(sweepOver(range, base));
  }
  if (sweeps.empty()) throw InputError("", "sweep", name, "must be one of all, " + joined(sweepNames()));
  return sweeps;
}

Json runSweep(const SimulationSetup& setup, const Sweep& sweep, const Progress& progress) {
  Json swept = {{"name", sweep.name}, {"quantity", sweep.axis}, {"points", Json::array()}};
  const auto spacing_m = setup.camera.value_or(simulatedCamera()).parameters().pixel_spacing_m;
  int done = 0;
  for (const auto& point : sweep.points) {
    const bool goes_on = finishPart(true, [&] {
      const auto runs = runSimulation(setup, point.settings, [&](int) {
        ++done;
        if (progress) progress(done);
      });
      swept["points"].push_back(
          {{"value", point.value}, {"label", point.label}, {"summaries", simulationSummaries(runs, spacing_m)}});
    });
    if (!goes_on) break;
  }
  return swept;
}

std::string sweepTable(const Json& swept) {
  const auto name = swept["name"].get<std::string>();
  Json rows = Json::array();
  for (const Json& point : swept["points"]) {
    for (const auto& [method, summary] : point["summaries"].items()) {
      rows.push_back({{"point", point["label"]}, {"method", method}});
      rows.back().update(summary);
    }
  }
  return "Sweep: " + swept["quantity"].get<std::string>() + "\n\n" +
         figureTable(rows, {{name.c_str(), "{point:%s}"},
                            {"method", "{method:%s}"},
                            {"success, mTRE < 2 mm", "{success_mtre_2mm_percent:%.0f %%}"},
                            {"95 % bounds",
                             "{success_mtre_2mm_bounds_percent/0:%.0f} to {success_mtre_2mm_bounds_percent/1:%.0f %%}"},
                            {"in-plane < 2 mm", "{in_plane_below_2mm_percent:%.0f %%}"},
                            {"pose ok", "{pose_ok_percent:%.0f %%}"},
                            {"mPD > 5 px", "{gfr_true_5px_percent:%.0f %%}"},
                            {"failed, trusted", "{failed_and_trusted_percent:%.0f %%}"},
                            {"mTRE", "{mtre_mm/median:%.3f mm}"},
                            {"in-plane", "{in_plane_mm/median:%.3f mm}"},
                            {"ms p50", "{time_ms/total/p50:%.1f}"}});
}

}  // namespace angio::evaluation
