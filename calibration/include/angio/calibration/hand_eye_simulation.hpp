// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "angio/calibration/hand_eye.hpp"

namespace angio::calibration {

/// Simulated poses of a C-arm that goes through LAO/RAO with no CRA/CAU, and then through CRA/CAU: as an operator does,
/// about two axes only. A model of known place is seen with noise.
struct OrbitSettings {
  int poses = 15;
  double max_primary_deg = 45;
  double max_secondary_deg = 30;
  double camera_noise_deg = 0.1;
  double camera_noise_mm = 0.3;
  double hand_noise_deg = 0;
  double hand_noise_mm = 0;
  double mount_deg = 1;
  double mount_mm = 5;

  void visit(SettingsVisitor& v) {
    v.integer("poses", poses, 1, 10000, "Number of simulated poses");
    v.number("max_primary_deg", max_primary_deg, 0, 120, "Largest LAO and RAO");
    v.number("max_secondary_deg", max_secondary_deg, 0, 60, "Largest CRA and CAU; 0: a single axis");
    v.number("camera_noise_deg", camera_noise_deg, 0, 45,
             "Standard deviation of the rotation of T_camera_object, per axis");
    v.number("camera_noise_mm", camera_noise_mm, 0, 1000,
             "Standard deviation of the translation of T_camera_object, per axis");
    v.number("hand_noise_deg", hand_noise_deg, 0, 45,
             "Standard deviation of the C-arm's own pose: turns about its isocentre");
    v.number("hand_noise_mm", hand_noise_mm, 0, 1000, "Standard deviation of the C-arm's own pose: shifts");
    v.number("mount_deg", mount_deg, 0, 45,
             "How far the camera is turned from where the C-arm's geometry has it, per axis; 0 with mount_mm 0: "
             "exactly there");
    v.number("mount_mm", mount_mm, 0, 1000,
             "How far the camera is shifted from where the C-arm's geometry has it, per axis");
  }
};

/// A pose set and what is true of it.
struct SimulatedPoseSet {
  PoseSet set;  ///< Says its noise.
  HandEyeTransforms truth;
};

/// One draw: the same for one seed on every machine. The model lies 30 mm (standard deviation per axis) from the
/// isocentre, turned in any way.
SimulatedPoseSet simulatedOrbit(const CArmGeometry& carm, const OrbitSettings& settings, int seed);

/// What calibration makes of one draw.
struct HandEyeTrial {
  Eigen::Matrix<double, 12, 1> error;  ///< See errorOf.
  double nees = 0;  ///< Squared error of all free parameters by the covariance; its mean is their number.
};

/// Trials with seeds from `first_seed` on. `tell` is called after each with how many are done.
std::vector<HandEyeTrial> handEyeTrials(const CArmGeometry& carm, const OrbitSettings& orbit,
                                        const HandEyeSettings& settings, int trials, int first_seed,
                                        const std::function<void(int done)>& tell = {});

/// Errors of a solution: [dt; dw] of X and Z [m, rad].
Eigen::Matrix<double, 12, 1> errorOf(const HandEyeTransforms& found, const HandEyeTransforms& truth);

}  // namespace angio::calibration
