// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/plated_cameras.hpp"

#include <cmath>

#include "angio/base/errors.hpp"

namespace angio::calibration {
namespace {

constexpr double kClearlyBetter = 0.9;  // Of the error of beads that are left out.

PhantomPlates platesOf(const BeadPhantom& phantom, PhantomBuild build, double tolerance_mm) {
  return build == PhantomBuild::kOnePiece ? PhantomPlates{}
                                          : platesAlong(phantom, static_cast<int>(build) - 1, tolerance_mm);
}

std::vector<CameraCalibration> eachAlone(const BeadPhantom& phantom, const std::vector<CameraViews>& cameras,
                                         const CameraCalibrationSettings& settings, const PhantomPlates& plates) {
  std::vector<CameraCalibration> results;
  for (const CameraViews& camera : cameras) {
    results.push_back(calibrateCamera(phantom, camera.detector, camera.views, settings, plates));
  }
  return results;
}

// What all cameras but one say of the shifts.
PlateShifts saidByOthers(const PhantomPlates& plates, const std::vector<CameraCalibration>& alone, std::size_t but) {
  PlateShifts said = plates.known;
  for (std::size_t c = 0; c < alone.size(); ++c) {
    if (c != but) said = jointShifts(plates.known, said, alone[c].plates);
  }
  return said;
}

// Each camera with what the others say of the shifts: to first order that is the joint solution of all, as cameras have
// nothing but the shifts in common.
std::vector<CameraCalibration> together(const BeadPhantom& phantom, const std::vector<CameraViews>& cameras,
                                        const CameraCalibrationSettings& settings, const PhantomPlates& plates,
                                        const std::vector<CameraCalibration>& alone) {
  std::vector<CameraCalibration> results;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    PhantomPlates known = plates;
    known.known = saidByOthers(plates, alone, c);
    results.push_back(calibrateCamera(phantom, cameras[c].detector, cameras[c].views, settings, known));
  }
  return results;
}

// The phantom with its plates where they are thought to be.
BeadPhantom shifted(BeadPhantom phantom, const PhantomPlates& plates, const Eigen::VectorXd& shifts_mm) {
  for (std::size_t i = 0; i < phantom.beads.size(); ++i) {
    phantom.beads[i].position_m += 1e-3 * shifts_mm.segment<3>(3 * plates.plate_of_bead[i]);
  }
  return phantom;
}

double rootMeanSquare(const std::vector<CameraCalibration>& cameras, double (*rms_px)(const CameraCalibration&)) {
  double squared = 0, beads = 0;
  for (const CameraCalibration& camera : cameras) {
    double used = 0;
    for (const CalibratedView& view : camera.views) {
      for (const bool outlier : view.is_outlier) used += !outlier && !view.held_out && !view.left_out;
    }
    squared += used * rms_px(camera) * rms_px(camera);
    beads += used;
  }
  return std::sqrt(squared / beads);
}

double residualRms(const CameraCalibration& camera) { return camera.record.residual_rms; }
double leftOutRms(const CameraCalibration& camera) { return camera.left_out_rms_px; }

// Of each camera by a phantom of one piece, shifted as the other camera has found.
double rmsByTheOther(const BeadPhantom& phantom, const std::vector<CameraViews>& cameras,
                     const CameraCalibrationSettings& settings, const PhantomPlates& plates,
                     const std::vector<CameraCalibration>& alone) {
  std::vector<CameraCalibration> results;
  for (std::size_t c = 0; c < 2; ++c) {
    const BeadPhantom seen = shifted(phantom, plates, alone[1 - c].plates.mean_mm);
    results.push_back(calibrateCamera(seen, cameras[c].detector, cameras[c].views, settings));
  }
  return rootMeanSquare(results, residualRms);
}

}  // namespace

PlatedCameras calibrateCameras(const BeadPhantom& phantom, const std::vector<CameraViews>& cameras,
                               const CameraCalibrationSettings& settings, std::optional<PhantomBuild> build,
                               double tolerance_mm, bool one_frame) {
  std::vector<PhantomBuild> builds = {PhantomBuild::kOnePiece, PhantomBuild::kPlatesAlongX, PhantomBuild::kPlatesAlongY,
                                      PhantomBuild::kPlatesAlongZ};
  if (build) builds = {*build};
  PlatedCameras best;
  double least_px = 0;
  for (const PhantomBuild tried : builds) {
    const PhantomPlates plates = platesOf(phantom, tried, tolerance_mm);
    if (tried != PhantomBuild::kOnePiece && plates.isOnePiece()) {
      if (!build) continue;
      throw InputError(phantom.name, "plates", std::string(1, "xyz"[static_cast<int>(tried) - 1]),
                       "must be an axis along which 2 to 8 plates of 4 beads or more are stacked");
    }
    std::vector<CameraCalibration> results = eachAlone(phantom, cameras, settings, plates);
    BuildTrial trial{tried, 0, 0, 0};
    if (!plates.isOnePiece() && one_frame && cameras.size() > 1) {
      if (cameras.size() == 2) trial.other_rms_px = rmsByTheOther(phantom, cameras, settings, plates, results);
      results = together(phantom, cameras, settings, plates, results);
    }
    trial.rms_px = rootMeanSquare(results, residualRms);
    trial.left_out_rms_px = rootMeanSquare(results, leftOutRms);
    best.trials.push_back(trial);
    const bool first = best.cameras.empty();
    const double bound = best.build == PhantomBuild::kOnePiece ? kClearlyBetter * least_px : least_px;
    if (!first && !(trial.left_out_rms_px < bound)) continue;
    least_px = trial.left_out_rms_px;
    best.build = tried;
    best.cameras = std::move(results);
  }
  return best;
}

}  // namespace angio::calibration
