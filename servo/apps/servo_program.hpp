// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/calibration_records/record.hpp"
#include "angio/cli/bus_help.hpp"
#include "angio/cli/command_line_fwd.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/vessel/vessel_tree.hpp"
#include "patient_options.hpp"
#include "servo_settings.hpp"

namespace angio::apps {

/// The command line of angio-servo, and of what runs its simulations.
struct ServoProgramOptions {
  std::string tree = exampleDataFile("hepatic-tace/tree.csv"), calibration = exampleDataFile("hepatic-tace/carm.yaml");
  std::string bus = cli::kUsualBus, settings, out = "demo-output";
  LoopOptions loop;
  PatientOptions patient;
  std::optional<double> duration_s;  // Given, it comes before the settings file's.
  std::optional<int> seed;
  std::string t_dsa_cb, film, truth, machine, record, disturb, key_file, view_pose, preview;
  double max_age_days = RecordGate().max_age_days;
  bool simulate = false, wait_for_operator = false, autostart = false, point_covariance = false;

  void addTo(cli::Command& app);

  /// The settings file's, with what the command line says put over them. Throws InputError.
  ServoSettings effectiveSettings() const;

  /// The calibration of the machine that is to be moved, and of no other; with --t-dsa-cb centre the tree's centroid is
  /// at its isocentre. Says on stderr when it is old, and what is assumed. Throws InputError.
  CArmCalibration readCalibration(const VesselTree& model) const;
};

/// What a program of this command line does, once all files have been read. Its value is the exit code.
using ServoWork =
    std::function<int(const ServoProgramOptions&, const ServoSettings&, const VesselTree&, const CArmCalibration&)>;

/// Runs the command line: `simulated` instead, and before any file is read, where a simulation was asked for and it is
/// not empty. Returns the exit code.
int runServoProgram(int argc, char** argv, const std::function<int()>& simulated, const ServoWork& work);

}  // namespace angio::apps
