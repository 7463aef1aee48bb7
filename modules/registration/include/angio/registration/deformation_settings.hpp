// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
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

  double std_mm = 4;                     ///< Size of the displacement, per axis.
  double length_mm = 60;                 ///< Points nearer to each other than this move alike.
  static constexpr int max_modes = 40;   ///< Of the smooth field, per axis.
  static constexpr double node_mm = 10;  ///< Displacements are linear along the vessel between nodes so far apart.

  static constexpr double local_std_mm = 0.15;   ///< kFull: size of the correction, per axis.
  static constexpr double local_length_mm = 20;  ///< kFull: length along the vessel over which it stays the same.

  void visit(SettingsVisitor& v) {
    v.choice("detail", detail, {"low_rank", "full"});
    v.number("std_mm", std_mm, 1e-3, 1e3);
    v.number("length_mm", length_mm, 1, 1e4);
  }
};

}  // namespace angio::registration
