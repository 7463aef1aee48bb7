// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/registration/registration.hpp"

namespace angio {

/// Several starts against local minima: the prior's pose and draws around it.
struct StartSettings {
  int count = 1;                  ///< Starts in all; the first is the prior's pose.
  double rotation_std_deg = 2;    ///< Spread of the draws, per axis, about the tree's centroid.
  double translation_std_mm = 5;  ///< Per axis.
  int seed = 1;

  void visit(SettingsVisitor& v) {
    v.integer("count", count, 1, 10000);
    v.number("rotation_std_deg", rotation_std_deg, 0, 180);
    v.number("translation_std_mm", translation_std_mm, 0, 1000);
    v.integer("seed", seed, 0, 2147483647);
  }
};

/// Aligns from every start and returns the best by Agreement::score, with its ambiguity: when a pose that differs by more
/// than 3 mm (mean over the tree) scores nearly as well, a converged result becomes kAmbiguous.
/// Times are summed over all starts.
RegistrationResult alignFromStarts(Registration& registration, const Centerline2d& centerline, const XrayCamera& camera,
                                   const PosePrior& prior, const StartSettings& starts);

/// A draw around `T_camera_model`: a turn and a shift about `centre_model`, normal with the given standard deviations per axis.
/// The same numbers on every machine for one `seed` and `index`.
Pose drawnPose(const Pose& T_camera_model, const Eigen::Vector3d& centre_model, double rotation_std_rad,
               double translation_std_m, int seed, int index);

}  // namespace angio
