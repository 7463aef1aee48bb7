// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/base/variant_sections.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/command_line_fwd.hpp"
#include "angio/experiments/scenario_settings.hpp"
#include "angio/geometry/carm_limits_settings.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/servo/safety_supervisor.hpp"
#include "angio/servo/servo_loop.hpp"
#include "angio/simulation/patient_settings.hpp"

namespace angio::apps {

/// What a settings file may say of a loop and of its closed-loop simulation, a section each.
struct ServoSettings {
  ScenarioSettings scenario;
  SimulatedPatientSettings patient;
  VariantSections<TaskSettings> tasks{"task", ServoLoopSettings().task, "What the loop does"};
  VariantSections<ServoLawSettings> laws{"law", ServoLoopSettings().law, "Control law by which a view is reached"};
  double latency_ms = 1e3 * ServoLoopSettings().latency_s;
  ExtractorSections extractors{PerceptionSettings().extractor};
  enum class Method { kOrientedKernel, kIterativePnp } method = Method::kOrientedKernel;
  OrientedKernelSettings oriented_kernel;
  IterativePnpSettings search = PerceptionSettings::iterativePnpForSearch();      // Of iterative_pnp, while nothing is
  IterativePnpSettings tracking = PerceptionSettings::iterativePnpForTracking();  // tracked, and from frame to frame.
  enum class Perceiver { kOwn, kOwnAndCatheter, kBus } perception = Perceiver::kOwn;
  int starts = 0;
  PatientTrackerSettings tracker;
  CArmLimitsSettings limits;
  RegistrationGateSettings supervisor;
  SafetySettings safety;
  /// Of the loop. A place in one tree: it stands beside the tree on the command line, and in no settings file.
  std::optional<Eigen::Vector3d> target_model;

  void visit(SettingsVisitor& v);

  /// The loop of a machine that is as its calibration says.
  ServoLoopSettings loop(const CArmCalibration& calibrated) const;
};

/// A settings file's, or `usual` where it says nothing, or when `path` is empty. Throws InputError that names the file.
ServoSettings readServoSettings(const std::string& path, ServoSettings usual = {});

/// The same as --print-settings prints them.
std::string servoSettingsAsYaml(const std::string& path);

/// What a command line says of a loop; what is given comes before the settings file's.
struct LoopOptions {
  std::string task, view_from, perception, center_on;
  std::optional<double> view_primary_deg, view_secondary_deg;
  std::vector<double> target_mm;  // Model frame; empty: the tree's centroid.

  void addTo(cli::Command& app);
  bool given() const;
  void applyTo(ServoSettings& settings) const;
};

}  // namespace angio::apps
