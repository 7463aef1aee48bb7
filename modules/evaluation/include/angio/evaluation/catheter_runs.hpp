// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "angio/evaluation/simulation.hpp"
#include "angio/results/case_run.hpp"

namespace angio::evaluation {

/// Simulated runs of a catheter that is pushed on in a tree, frame by frame.
struct CatheterRunSettings {
  int seed = 1;
  int frames = 9;                  ///< Of a run, half a second apart.
  double rotation_std_deg = 1.5;   ///< Of what the poses are wrong by, the same in all frames of a run, per axis.
  double translation_std_mm = 20;  ///< The same.
  double deformation_rms_mm = 0;   ///< Of the tree, as SimulationSettings has it, the same in all frames of a run.
  double breath_mm = 3;            ///< Amplitude of the patient's shift along the model's z from frame to frame.
  double beside_mm = 0.7;          ///< How far the catheter lies beside the vessels' axes: smooth, rms across them.
  double noise_px = 1;             ///< Of each coordinate of the curve's points, independent.
  double spacing_px = 8;           ///< Between them.
};

/// One frame of such a run.
struct CatheterRunFrame {
  bool registered = false;  ///< By its catheter; converged or not.
  bool converged = false;
  bool for_centre = false;  ///< Whether it is of use for the task of that name.
  /// Of a converged one, at the vessels that the catheter lies in: distance from where they are across the beam, rms
  /// [m], and how that stands to the claims.
  std::optional<double> across_m;
  std::optional<CaseOutcome::Claim> claim;
  /// Of a converged one, at points of the other vessels that may be a target of `centre`, as they are claimed to be
  /// known well enough across the beam: shares that lie within the ellipse of their 90 % across the beam, and beyond
  /// that of three standard deviations (99.73 %). Nothing where there are none.
  struct Beside {
    double plane_in = 0, beyond = 0;
  };
  std::optional<Beside> beside;
  bool wrong = false;  ///< Converged, and wrong by its own claim, as trials are.
};

/// Makes one run and registers its frames with CatheterRegistration. View, pose error and deformation are those of
/// simulatedTrial() by `seed` and `index`. The catheter goes from about half way to the end of one of the tree's routes
/// of 80 mm or more. Returns no frame for a tree that has none. Throws InputError when a setting is out of its range.
std::vector<CatheterRunFrame> catheterRun(const VesselTree& tree, const CatheterRunSettings& settings, int index);

}  // namespace angio::evaluation
