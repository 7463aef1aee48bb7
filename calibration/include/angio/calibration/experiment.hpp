// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "angio/calibration/calibration_simulation.hpp"

namespace angio::calibration {

/// Called after each trial with how many are done.
using ExperimentProgress = std::function<void(int done)>;

/// One simulated camera calibration against its truth.
struct CameraTrial {
  double rms_px = 0;                ///< Reprojection, both axes together.
  double principal_point_nees = 0;  ///< Squared error by the covariance; 2 on average.
  double camera_nees = 0;           ///< Of fx, fy, cx and cy; 4 on average.
  double source_m = 0;  ///< How far the source is placed wrong, seen from the phantom, root mean square over views.
};

/// Calibrates a camera from views of a helix, each trial another machine with another noise.
std::vector<CameraTrial> cameraExperiment(const CArmCalibration& nominal, const CalibrationSimulationSettings& settings,
                                          int trials, const ExperimentProgress& tell = {});

/// One simulated geometry calibration against its truth.
struct GeometryTrial {
  double nees = 0;           ///< Of the arm's numbers, per number; meaningful where no bending was simulated.
  int numbers = 0;           ///< So many.
  double direction_rad = 0;  ///< At 50 positions that no view was taken at, root mean square: the beam seen from the
  double target_m = 0;       ///< phantom, and the phantom's middle in the camera.
  double rms_px = 0;         ///< Residual of the views.
  double rms_rigid_px = 0;   ///< The same before bending is estimated.
};

/// Calibrates a C-arm's geometry, each trial another machine.
std::vector<GeometryTrial> geometryExperiment(const CArmCalibration& nominal,
                                              const CalibrationSimulationSettings& settings, int trials,
                                              const ExperimentProgress& tell = {});

/// Wall time of calibrations from views whose beads are known, the quickest of three [s].
struct CalibrationTimes {
  double camera_s = 0;
  double geometry_s = 0;
};
CalibrationTimes calibrationTimes(const CArmCalibration& nominal, const CalibrationSimulationSettings& settings);

}  // namespace angio::calibration
