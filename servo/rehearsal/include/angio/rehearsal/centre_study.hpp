// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/rehearsal/rehearsal.hpp"

namespace angio {

/// Many rehearsals of the task `centre`, each of another point of the tree in another patient who breathes, seen from
/// another side; and each once more by the same task without prediction.
struct CentreStudySettings {
  double breathing_mm = 15;  ///< Of the target: what is nearer to the feet moves less, so that the tree bends.
  double heartbeat_mm = 2;   ///< Of the target, in systole.
  double drift_mm_per_min = 3;
  double most_primary_deg = 30;    ///< Views are spread evenly over +- this ...
  double most_secondary_deg = 20;  ///< ... and this.
  double learn_s = 12;             ///< Errors count from then on: two breaths, and some.
  double within_mm = 1;            ///< A run succeeds when the target's rms distance stays below this.

  void visit(SettingsVisitor& v) {
    v.number("breathing_mm", breathing_mm, 0, 60);
    v.number("heartbeat_mm", heartbeat_mm, 0, 20);
    v.number("drift_mm_per_min", drift_mm_per_min, -30, 30);
    v.number("most_primary_deg", most_primary_deg, 0, 90);
    v.number("most_secondary_deg", most_secondary_deg, 0, 45);
    v.number("within_mm", within_mm, 1e-3, 100);
  }
};

/// How near the target's image really was to the wanted pixel, as a distance at the isocentre.
struct CentreErrors {
  double rms_mm = 0, worst_mm = 0;
  int frames = 0, held = 0;                   ///< Of the whole run.
  std::optional<std::string> breach;          ///< A limit that the machine exceeded.
  double answer_p50_s = 0, answer_p99_s = 0;  ///< Wall time from frame to command.
};

struct CentreStudyRow {
  int seed = 0;
  ViewAngles view;
  Eigen::Vector3d target_model = Eigen::Vector3d::Zero();  ///< [m].
  CentreErrors predicted, last_value;                      ///< With prediction, and without.
};

/// One run and its twin. Of `parts` the task's target is this seed's; the settings of `centre` stay.
CentreStudyRow studyCentre(const VesselTree& tree, const CArmCalibration& nominal, const CentreStudySettings& study,
                           RehearsalSettings rehearsal, ServoLoopSettings parts, CentreTaskSettings centre,
                           SimulatedPatientSettings patient);

nlohmann::ordered_json centreStudyAsJson(const std::vector<CentreStudyRow>& rows, const CentreStudySettings& study);

/// The same as a table for people.
std::string centreStudyTable(const nlohmann::ordered_json& summary);

}  // namespace angio
