// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/experiments/closed_loop.hpp"

namespace angio::experiments {

/// Many closed-loop simulations of the task `view`, each from another start to another view.
struct ViewExperimentSettings {
  double max_primary_deg = 45;    ///< Starts and views are spread evenly over +- this ...
  double max_secondary_deg = 25;  ///< ... and this.
  double within_deg = 0.1;        ///< A run succeeds when its true view ends and stays as near as this ...
  double within_mm = 0.5;         ///< ... and its target.

  void visit(SettingsVisitor& v) {
    v.number("max_primary_deg", max_primary_deg, 0, 90);
    v.number("max_secondary_deg", max_secondary_deg, 0, 45);
    v.number("within_deg", within_deg, 1e-3, 10);
    v.number("within_mm", within_mm, 1e-3, 100);
  }
};

/// What became of one.
struct ViewResult {
  int seed = 0;
  ViewAngles start, goal;
  ViewError end, open_end;            ///< True errors at the end.
  std::optional<double> settled_s;    ///< From when on the true error stayed within bounds; nothing: it did not.
  double min_s = 0;                   ///< What the machine's limits allow at best, for the joints that it went by.
  std::optional<std::string> breach;  ///< A limit that the machine exceeded.
  int frames = 0, held = 0;
  double answer_p50_s = 0, answer_p99_s = 0;  ///< Wall time from frame to command.
};

/// One run. Of `parts` the task is replaced by the view of this seed.
ViewResult runViewExperiment(const VesselTree& tree, const CArmCalibration& nominal,
                             const ViewExperimentSettings& experiment, ScenarioSettings scenario,
                             ServoLoopSettings parts, const SimulatedPatientSettings& patient);

nlohmann::ordered_json viewExperimentAsJson(const std::vector<ViewResult>& rows,
                                            const ViewExperimentSettings& experiment);

/// The same as a table for people.
std::string viewExperimentTable(const nlohmann::ordered_json& summary);

}  // namespace angio::experiments
