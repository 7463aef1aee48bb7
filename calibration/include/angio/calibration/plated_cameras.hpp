// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "angio/calibration/camera_calibration.hpp"

namespace angio::calibration {

/// One camera's detector and its views of the phantom.
struct CameraViews {
  DetectorOfViews detector;
  std::vector<BeadView> views;
};

/// How a phantom is put together.
enum class PhantomBuild { kOnePiece, kPlatesAlongX, kPlatesAlongY, kPlatesAlongZ };

/// A way to put the phantom together, and how well cameras agree with it.
struct BuildTrial {
  PhantomBuild build = PhantomBuild::kOnePiece;
  double rms_px = 0;           ///< Of all beads of all cameras.
  double left_out_rms_px = 0;  ///< Of each bead by what the others say.
  double other_rms_px = 0;     ///< Of two cameras' beads with the shifts that the other camera has found; else 0.
};

/// Cameras that have seen one phantom, which has not changed.
struct PlatedCameras {
  std::vector<CameraCalibration> cameras;  ///< In the order they were given.
  PhantomBuild build = PhantomBuild::kOnePiece;
  std::vector<BuildTrial> trials;  ///< All that were tried.
};

/// Calibrates cameras of which each has seen one phantom. The phantom may be of plates that are shifted against its
/// file by `tolerance_mm` (a standard deviation per axis and plate): `build` says along which axis they are stacked,
/// and absent, what explains the beads best is taken: plates only when beads that are left out lie by a tenth nearer to
/// where the others put them than with a phantom of one piece.
///
/// `one_frame`: the cameras' beads are named alike, and the shifts are estimated from all cameras together: each camera
/// is calibrated with what the others say of them. Otherwise each by itself.
///
/// Throws InputError as calibrateCamera() does, and for a build whose plates the phantom has not.
PlatedCameras calibrateCameras(const BeadPhantom& phantom, const std::vector<CameraViews>& cameras,
                               const CameraCalibrationSettings& settings, std::optional<PhantomBuild> build,
                               double tolerance_mm, bool one_frame);

}  // namespace angio::calibration
