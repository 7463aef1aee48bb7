// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/registration/iterative_pnp_settings.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// How finely a deformation may follow the image.
enum class DeformationDetail {
  kLowRank,  ///< A smooth field of some tens of modes.
  kFull,     ///< The same, and on top of it a small correction of each stretch of vessel.
};

/// What is expected of a deformation before the image is looked at: a zero-mean Gaussian process over the tree.
struct DeformationSettings {
  DeformationDetail detail = DeformationDetail::kFull;

  double std_mm = 4;
  double length_mm = 60;
  static constexpr int max_modes = 60;   ///< Of the smooth field, per axis.
  static constexpr double node_mm = 10;  ///< Displacements are linear along the vessel between nodes so far apart.

  static constexpr double local_std_mm = 0.15;   ///< kFull: size of the correction, per axis.
  static constexpr double local_length_mm = 20;  ///< kFull: length along the vessel over which it stays the same.

  void visit(SettingsVisitor& v) {
    v.choice("detail", detail, {"low_rank", "full"},
             "A smooth field of some tens of modes, or on top of it a small correction of each stretch of vessel");
    v.number("std_mm", std_mm, 1e-3, 1e3, "Standard deviation of the displacement, per axis");
    v.number("length_mm", length_mm, 1, 1e4, "Points nearer to each other than this, and than half of it, move alike");
  }
};

/// Which side looks for its match on the other while the pose is searched.
enum class Direction {
  kAuto,          ///< The data decide: image to model when the image shows little of what the model should.
  kModelToImage,  ///< Kernel fields of the image, read at the projected model.
  kImageToModel,  ///< Each image point to its nearest oriented edge of the projected model.
};

/// Registration by oriented kernel fields: many starts, coarse to fine, then a point-to-line polish from image to
/// model.
struct OrientedKernelSettings {
  static constexpr const char* kName = "oriented_kernel";

  Deformation deformation = Deformation::kRigid;
  Direction direction = Direction::kAuto;

  // What is known of the start when the prior brings no covariance of its own; per axis.
  double prior_rotation_std_deg = 5;
  double prior_translation_std_mm = 10;

  int starts = 128;
  static constexpr double along_stiffness =
      0.2;  ///< Stiffness along a vessel relative to across it; 1 never lowers the objective.

  double spacing_mm = 1;
  double spacing_px = 2;
  int max_points_3d = 15000;
  static constexpr int max_points_2d = 4000;  ///< Of the image; more are thinned evenly.

  DeformationSettings nonrigid;

  void visit(SettingsVisitor& v) {
    v.choice("deformation", deformation, {"rigid", "nonrigid"}, "Whether the tree may deform");
    v.choice(
        "direction", direction, {"auto", "model_to_image", "image_to_model"},
        "Which side looks for its match on the other; auto: image to model when the image shows little of the model");
    v.number("prior_rotation_std_deg", prior_rotation_std_deg, 1e-3, 180,
             "Standard deviation of the start's rotation, per axis, when the start brings no covariance");
    v.number("prior_translation_std_mm", prior_translation_std_mm, 1e-3, 1e4,
             "Standard deviation of the start's translation, per axis, when the start brings no covariance");
    v.integer("starts", starts, 1, 100000, "Starts of a search that does not say how many");
    v.number("spacing_mm", spacing_mm, 0, 100, "Longest edge of the model; 0 keeps the points as they are");
    v.number("spacing_px", spacing_px, 0.1, 100, "Longest step of the image's centreline");
    v.integer("max_points_3d", max_points_3d, 10, 100000, "Most points of the model");
    v.section("nonrigid", [&](SettingsVisitor& inner) { nonrigid.visit(inner); });
  }
};

}  // namespace angio::registration
