// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/simulation/namespace.hpp"

namespace angio::simulation {

/// A body as a grid of linear attenuation, from a CT volume for example.
struct AttenuationVolume {
  std::array<int, 3> size{};               ///< Voxels along i, j, k; at least 2 each.
  std::vector<float> attenuation_per_m;    ///< Of all voxels, i fastest [1/m]; outside there is air, 0.
  Pose T_model_volume = Pose::Identity();  ///< Volume axes i, j, k [m] into the model frame; origin: voxel (0, 0, 0).
  Eigen::Vector3d spacing_m{1e-3, 1e-3, 1e-3};  ///< Between voxels.

  /// Throws InputError that names the field: sizes, spacing, values or pose that cannot be.
  void check() const;
};

/// Hounsfield units as linear attenuation [1/m] at the mean energy behind a patient, 60 keV: water 20.6, air 0; of what
/// exceeds water's, bone takes more than its share at this energy, by a factor of 1.6.
float attenuationOfHounsfield(float hu);

}  // namespace angio::simulation
