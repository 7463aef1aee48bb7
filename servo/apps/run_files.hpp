// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/simulation/simulated_patient.hpp"

namespace angio::apps {

enum class FrameFormat { kPng, kTiff, kRun };  ///< One file a frame, or all in the pages of one TIFF.

/// A simulated run to write.
struct RunOptions {
  std::string folder;
  int frames = 30;
  FrameFormat format = FrameFormat::kPng;
  double frame_rate_hz = 15;
  ViewAngles from, to;              ///< Of the C-arm at the first and the last frame; it turns steadily.
  double start_rotation_deg = 2;    ///< How far the initial poses are off, standard deviation per axis.
  double start_translation_mm = 5;  ///< The same.
};

/// Renders a run and writes it with its truth:
///
/// - `frame0000.png` (.tif) for each frame, or `frames.tif`;
/// - `centerline0000.csv` and `device0000.csv`: axes of vessels and devices that are seen, when there are any;
/// - `displacements0000.csv`, when something moves; `tree.csv`, `camera.yaml`, and a pose file for each truth and
/// start;
/// - `frames.csv`: time and C-arm of each frame; `settings.json`: what was simulated;
/// - `cases.yaml`, a sequence by its images, and `centerlines.yaml`, the same by its true centrelines. A run in one
///   TIFF has only the second.
///
/// `progress` hears how many frames are done. Throws InputError when a file cannot be written.
void writeRun(const VesselTree& tree, const CArmCalibration& calibration, const SimulatedPatientSettings& settings,
              const RunOptions& options, const std::function<void(int done)>& progress);

}  // namespace angio::apps
