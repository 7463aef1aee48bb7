// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/experiments/closed_loop.hpp"

namespace angio::experiments {

/// Many closed-loop simulations of the task `centre`, each of another point of the tree in another patient who
/// breathes, seen from another side; and each once more by the same task without prediction.
struct CenterExperimentSettings {
  double breathing_mm = 15;  ///< Of the target: what is nearer to the feet moves less, so that the tree bends.
  double heartbeat_mm = 2;   ///< Of the target, in systole.
  double drift_mm_per_min = 3;
  double max_primary_deg = 30;    ///< Views are spread evenly over +- this ...
  double max_secondary_deg = 20;  ///< ... and this.
  double learn_s = 12;            ///< Errors count from then on: two breaths, and some.
  double within_mm = 1;           ///< A run succeeds when the target's rms distance stays below this.

  void visit(SettingsVisitor& v) {
    v.number("breathing_mm", breathing_mm, 0, 60);
    v.number("heartbeat_mm", heartbeat_mm, 0, 20);
    v.number("drift_mm_per_min", drift_mm_per_min, -30, 30);
    v.number("max_primary_deg", max_primary_deg, 0, 90);
    v.number("max_secondary_deg", max_secondary_deg, 0, 45);
    v.number("within_mm", within_mm, 1e-3, 100);
  }
};

/// How near the target's image really was to the wanted pixel, as a distance at the isocentre.
struct CenterErrors {
  double rms_mm = 0, worst_mm = 0;
  int frames = 0, held = 0;                   ///< Of the whole run.
  std::optional<std::string> breach;          ///< A limit that the machine exceeded.
  double answer_p50_s = 0, answer_p99_s = 0;  ///< Wall time from frame to command.
};

struct CenterResult {
  int seed = 0;
  ViewAngles view;
  Eigen::Vector3d target_model = Eigen::Vector3d::Zero();  ///< [m].
  CenterErrors predicted, last_value;                      ///< With prediction, and without.
};

/// One run and its twin. Of `parts` the task's target is this seed's; the settings of `centre` stay.
CenterResult runCenterExperiment(const VesselTree& tree, const CArmCalibration& nominal,
                                 const CenterExperimentSettings& experiment, ScenarioSettings scenario,
                                 ServoLoopSettings parts, CenterTaskSettings center, SimulatedPatientSettings patient);

nlohmann::ordered_json centerExperimentAsJson(const std::vector<CenterResult>& rows,
                                              const CenterExperimentSettings& experiment);

/// The same as a table for people.
std::string centerExperimentTable(const nlohmann::ordered_json& summary);

}  // namespace angio::experiments
