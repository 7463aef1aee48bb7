// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulate_loop.hpp"

#include <iostream>

#include "angio/apps/namespace.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/evaluation/case_run.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::apps {

void ExperimentOptions::add(CLI::App& command) {
  tree = exampleDataFile("hepatic-tace/tree.csv");
  calibration = exampleDataFile("hepatic-tace/carm.yaml");
  command.add_option("--tree", tree, "Vessel tree");
  command.add_option("--calibration", calibration, "C-arm geometry and T_dsa_cb (.yaml): what is made wrong");
  command.add_option("--runs", runs, "How many runs")->check(CLI::Range(1, 100000));
  command.add_option("--first-seed", first_seed, "Seed of the first run; each has one more than the one before")
      ->check(CLI::Range(0, 2147000000));
  command.add_option("--threads", threads, "Runs at a time")->check(CLI::Range(1, 256));
  command.add_option("--settings", settings, "Settings (.yaml), as angio-servo's");
  command.add_option("--out", out, "All runs and the settings (.json)");
}

VesselTree ExperimentOptions::readTree() const { return readVesselTree(tree); }

CArmCalibration ExperimentOptions::readCalibration() const { return readCArmCalibration(calibration); }

ServoSettings ExperimentOptions::readSettings() const {
  ServoSettings read;
  read.scenario.calibration_error_deg = 1;
  read.scenario.calibration_error_mm = 3;
  return readServoSettings(settings, read);
}

void ExperimentOptions::write(nlohmann::ordered_json json, const std::string& table,
                              const ServoSettings& effective) const {
  std::cout << table;
  if (out.empty()) return;
  json["settings"] = settingsAsJson(effective);
  json["machine"] = machineAsJson();
  writeWholeFile(out, json.dump(2) + "\n");
}

}  // namespace angio::apps
