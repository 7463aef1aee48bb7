// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// Loss of the paper's figure 1; the Gaussian kernel is the paper's own, L2 and Huber with LM its "DT-ICP".
enum class Kernel { kGaussian, kL2, kHuber };

/// Where E_init of the paper's eq. 4 takes its weight from.
enum class PriorForm {
  kPaper,       ///< lambda1 |log(T0^-1 T)|^2, one lambda for radians and lengths together.
  kCovariance,  ///< Information matrix: what is known of the start, from calibration or tracking.
};

enum class LengthUnit { kMillimetre, kMetre };
enum class OutsideImage { kVote, kIgnore };
enum class Deformation { kRigid, kNonrigid };

/// The paper's Iterative PnP with its own parameters as defaults. What the paper leaves open is a setting, and says so.
struct IterativePnpSettings {
  static constexpr const char* kName = "iterative_pnp";

  Kernel kernel = Kernel::kGaussian;
  double huber_px = 3;  ///< Where Huber's loss turns linear [px]; used with Kernel::kHuber only.

  Deformation deformation = Deformation::kRigid;

  // Scale of the kernel, section III-C: starts at the largest match distance, halves every 5 iterations.
  double first_scale_px = 0;  ///< 0: the largest match distance, as in the paper [px].
  double last_scale_px = 1;   ///< Open in the paper: where the halving ends [px].
  static constexpr int halve_every = 5;
  int max_iterations = 80;

  /// Open in the paper: Delta(i), the image points matched to each model point, is the nearest one and so many on
  /// either side of it along its branch. With the nearest alone, matches stick to the samples of the centreline.
  int neighbours_each_side = 1;
  OutsideImage outside_image =
      OutsideImage::kVote;  ///< kVote: the paper's; kIgnore: points off the detector have no match.

  PriorForm prior = PriorForm::kPaper;
  double lambda1 = 100;                                    ///< kPaper: weight of E_init [px^2].
  LengthUnit prior_length_unit = LengthUnit::kMillimetre;  ///< Open in the paper: the unit of lengths inside |log|^2.
  double prior_rotation_std_deg = 2;                       ///< kCovariance: per axis.
  double prior_translation_std_mm = 5;                     ///< kCovariance: per axis.
  static constexpr double pixel_std_px = 1;  ///< kCovariance: noise of one match, which the prior is weighed against.

  double lambda2 = 1;                                    ///< Weight of E_reg; lengths in mm.
  double w1 = 0.1, w2 = 10, w3 = 1;                      ///< Size, chain and neighbour terms of E_reg.
  int regulariser_neighbours = 4;                        ///< Open in the paper: size of Omega_i, nearest points in 3D.
  static constexpr double nonrigid_first_scale_px = 16;  ///< 0: the largest match distance; open in the paper [px].
  int nonrigid_iterations = 20;

  double spacing_mm = 1;  ///< Longest edge of the model; 0 keeps the points as they are.
  double spacing_px = 2;  ///< Longest step of the image's centreline; 0 keeps the points as they are.
  int max_points_3d = 3000;

  void visit(SettingsVisitor& v) {
    v.choice("kernel", kernel, {"gaussian", "l2", "huber"});
    v.number("huber_px", huber_px, 1e-3, 1e3);
    v.choice("deformation", deformation, {"rigid", "nonrigid"});
    v.number("first_scale_px", first_scale_px, 0, 1e4);
    v.number("last_scale_px", last_scale_px, 0.05, 100);
    v.integer("max_iterations", max_iterations, 1, 1000);
    v.integer("neighbours_each_side", neighbours_each_side, 0, 32);
    v.choice("outside_image", outside_image, {"vote", "ignore"});
    v.choice("prior", prior, {"paper", "covariance"});
    v.number("lambda1", lambda1, 0, 1e12);
    v.number("prior_rotation_std_deg", prior_rotation_std_deg, 1e-3, 180);
    v.number("prior_translation_std_mm", prior_translation_std_mm, 1e-3, 1e4);
    v.number("lambda2", lambda2, 1e-6, 1e6);
    v.number("w1", w1, 1e-6, 1e6);
    v.number("w2", w2, 0, 1e6);
    v.number("w3", w3, 0, 1e6);
    v.integer("regulariser_neighbours", regulariser_neighbours, 0, 32);
    v.integer("nonrigid_iterations", nonrigid_iterations, 1, 200);
    v.number("spacing_mm", spacing_mm, 0, 100);
    v.number("spacing_px", spacing_px, 0, 100);
    v.integer("max_points_3d", max_points_3d, 10, 100000);
  }
};

}  // namespace angio::registration
