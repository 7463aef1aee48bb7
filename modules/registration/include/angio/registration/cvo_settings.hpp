// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// What the flow follows, of the functions f of the projected model and g of the image.
enum class CvoObjective {
  kDistance,      ///< -|f - g|^2, the source's problem as it is posed.
  kInnerProduct,  ///< <f, g>, what is left of it where |f| is constant: under the source's isometries, not here.
};

/// Continuous visual odometry for a vessel tree and X-ray centrelines: both are functions in a reproducing kernel
/// Hilbert space, and a gradient flow on SE(3) brings them together, at kernels that grow narrower. Rigid.
///
/// Sources: Ghaffari, Clark, Bloch, Eustice and Grizzle, RSS 2019; Clark, Ghaffari and Bloch, JMLR 22 (2021).
struct CvoSettings {
  static constexpr const char* kName = "cvo";

  CvoObjective objective = CvoObjective::kDistance;
  double first_scale_px = 24;

  /// Of the kernel of the angle between vessels' directions; without directions (180) as many starts are found.
  static constexpr double direction_std_deg = 20;
  /// Length scale at which the flow ends: twice the noise of a centreline, and more than its pixels [px].
  static constexpr double last_scale_px = 2;
  static constexpr double scale_decay = 0.7;  ///< From one scale to the next: the factor of the source's program.
  static constexpr double spacing_mm = 1;     ///< Longest edge of the model that the result is judged by.
  static constexpr double spacing_px = 2;     ///< The same of the image.
  static constexpr int max_points_3d = 3000;  ///< As many points as the paper's trees have.

  void visit(SettingsVisitor& v) {
    v.choice("objective", objective, {"distance", "inner_product"},
             "Distance of model and image in the kernel's space; or their inner product alone, as the source has it "
             "for points in 3D");
    v.number("first_scale_px", first_scale_px, 2, 1e3, "First length scale of the kernel");
  }
};

}  // namespace angio::registration
