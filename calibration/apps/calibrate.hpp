// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "angio/apps/namespace.hpp"
#include "angio/calibration/calibration_simulation.hpp"

namespace angio::apps {

/// What the chosen sub-command does; returns the exit code.
using Work = std::function<int()>;

/// Each adds its sub-command, which sets `work` when it is chosen.
void addCalibrateCamera(CLI::App& app, Work& work);
void addCalibrateGeometry(CLI::App& app, Work& work);
void addCalibrateHandEye(CLI::App& app, Work& work);
void addCalibrateRegistration(CLI::App& app, Work& work);
void addCalibrateSimulate(CLI::App& app, Work& work);

/// Print errors of "camera" or "geometry" calibrations of machines drawn around a nominal one, against their truth, and
/// the time that both take.
void printStudy(const std::string& study, const CArmCalibration& nominal, const CalibrationSimulationSettings& settings,
                int trials);
void printTiming(const CArmCalibration& nominal, const CalibrationSimulationSettings& settings);

}  // namespace angio::apps
