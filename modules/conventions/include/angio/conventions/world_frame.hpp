// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "angio/conventions/namespace.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::conventions {

/// The axes of the model's file: the patient's, or those of the other program's world, whatever these are.
enum class ModelAxes { kLps, kRas, kWorld };

/// How the model lies in the world of another program.
struct WorldFrame {
  ModelAxes model_axes = ModelAxes::kLps;
  Eigen::Vector3d isocenter_mm = Eigen::Vector3d::Zero();  ///< The model's point at the world's origin, model axes.
};

/// What the axes of a program's world are: the patient's L, P, S or R, A, S, or those of IEC 61217's fixed system with
/// a patient head first and supine (x left, y head, z anterior).
enum class WorldAxes { kLps, kRas, kIec };

/// The model's frame in a world with these axes [m].
Pose T_world_model(const WorldFrame& frame, WorldAxes axes);

}  // namespace angio::conventions
