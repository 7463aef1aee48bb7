// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/registration/deformation.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// Loss of the paper's figure 1; the Gaussian kernel is the paper's own, L2 and Huber with LM its "DT-ICP".
enum class Kernel { kGaussian, kL2, kHuber };

/// Where E_init of the paper's eq. 4 takes its weight from.
enum class PriorForm {
  kPaper,       ///< lambda1 |log(T0^-1 T)|^2, one lambda for radians and lengths together.
  kCovariance,  ///< Information matrix: what is known of the start, from calibration or tracking.
};

/// How the scale of the kernel goes.
enum class Schedule {
  kOwn,    ///< From the largest match distance; halves early where a scale has come to rest. Deformations from 16 px.
  kPaper,  ///< As printed in section III-C: from the largest *squared* match distance, half every 5 iterations.
};

enum class LengthUnit { kMillimetre, kMetre };
enum class OutsideImage { kVote, kIgnore };

/// The paper's Iterative PnP with its own parameters as defaults. What the paper leaves open is a setting, and says so.
struct IterativePnpSettings {
  static constexpr const char* kName = "iterative_pnp";

  Kernel kernel = Kernel::kGaussian;
  double huber_px = 3;

  Deformation deformation = Deformation::kRigid;

  // Scale of the kernel, section III-C.
  Schedule schedule = Schedule::kOwn;
  double first_scale_px = 0;
  double last_scale_px = 1;
  static constexpr int halve_every = 5;
  int max_iterations = 80;

  // The paper's Delta(i). With the nearest alone, matches stick to the samples of the centreline.
  int neighbours_each_side = 1;
  OutsideImage outside_image = OutsideImage::kVote;

  PriorForm prior = PriorForm::kPaper;
  double lambda1 = 100;
  LengthUnit prior_length_unit = LengthUnit::kMillimetre;  ///< Open in the paper: the unit of lengths inside |log|^2.
  double prior_rotation_std_deg = 2;
  double prior_translation_std_mm = 5;
  static constexpr double pixel_std_px = 1;  ///< kCovariance: noise of one match, which the prior is weighed against.

  double lambda2 = 1;
  double w1 = 0.1, w2 = 10, w3 = 1;
  int regulariser_neighbours = 4;
  static constexpr double nonrigid_first_scale_px = 16;  ///< With schedule kOwn; open in the paper [px].
  int nonrigid_iterations = 20;

  double spacing_mm = 1;
  double spacing_px = 2;
  int max_points_3d = 3000;

  /// Everything as the paper has it: one match a point, its own points, its schedule to the end, its prior, points off
  /// the detector matched like others.
  static IterativePnpSettings asInThePaper() {
    IterativePnpSettings s;
    s.schedule = Schedule::kPaper;
    s.neighbours_each_side = 0;
    s.spacing_mm = s.spacing_px = 0;
    // From the square of 300 px to 1 px are 17 halvings.
    s.max_iterations = s.nonrigid_iterations = 100;
    return s;
  }
  /// The best that was found for it, with kBestStarts starts.
  static IterativePnpSettings atItsBest() {
    IterativePnpSettings s;
    s.outside_image = OutsideImage::kIgnore;
    s.prior = PriorForm::kCovariance;
    return s;
  }
  static constexpr int kBestStarts = 16;

  void visit(SettingsVisitor& v) {
    v.choice("kernel", kernel, {"gaussian", "l2", "huber"},
             "Loss: Gaussian kernel (the paper's own), L2 or Huber (its DT-ICP, with Levenberg-Marquardt)");
    v.number("huber_px", huber_px, 1e-3, 1e3, "Where Huber's loss turns linear; used with kernel huber only");
    v.choice("deformation", deformation, {"rigid", "nonrigid"}, "Whether the tree may deform");
    v.choice(
        "schedule", schedule, {"own", "paper"},
        "Scale of the kernel: from the largest match distance, halved early where it rests; or as the paper prints "
        "it, from the largest squared distance, halved every 5 iterations");
    v.number("first_scale_px", first_scale_px, 0, 1e4, "First scale of the kernel; 0: as the schedule has it");
    v.number("last_scale_px", last_scale_px, 0.05, 100,
             "Scale of the kernel at which its halving ends; open in the paper");
    v.integer("max_iterations", max_iterations, 1, 1000, "Largest number of iterations");
    v.integer("neighbours_each_side", neighbours_each_side, 0, 32,
              "Image points matched to each model point: the nearest one and so many on either side of it along its "
              "branch; open in the paper");
    v.choice("outside_image", outside_image, {"vote", "ignore"},
             "Points off the detector have a match all the same, as in the paper, or none");
    v.choice("prior", prior, {"paper", "covariance"},
             "Weight of the start: one lambda for rotation and lengths together, as in the paper, or what is known of "
             "the start");
    v.number("lambda1", lambda1, 0, 1e12, "With prior paper: weight of E_init, in square pixels");
    v.number("prior_rotation_std_deg", prior_rotation_std_deg, 1e-3, 180,
             "With prior covariance: standard deviation of the start's rotation, per axis");
    v.number("prior_translation_std_mm", prior_translation_std_mm, 1e-3, 1e4,
             "With prior covariance: standard deviation of the start's translation, per axis");
    v.number("lambda2", lambda2, 1e-6, 1e6, "Weight of E_reg; lengths in mm");
    v.number("w1", w1, 1e-6, 1e6, "Weight of the size term of E_reg");
    v.number("w2", w2, 0, 1e6, "Weight of the chain term of E_reg");
    v.number("w3", w3, 0, 1e6, "Weight of the neighbour term of E_reg");
    v.integer("regulariser_neighbours", regulariser_neighbours, 0, 32,
              "Nearest points in 3D that the neighbour term looks at, the size of Omega_i; open in the paper");
    v.integer("nonrigid_iterations", nonrigid_iterations, 1, 200, "Iterations of the deformation");
    v.number("spacing_mm", spacing_mm, 0, 100, "Longest edge of the model; 0 keeps the points as they are");
    v.number("spacing_px", spacing_px, 0, 100,
             "Longest step of the image's centreline; 0 keeps the points as they are");
    v.integer("max_points_3d", max_points_3d, 10, 100000, "Most points of the model");
  }
};

}  // namespace angio::registration
