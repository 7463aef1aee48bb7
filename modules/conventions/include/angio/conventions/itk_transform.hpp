// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/conventions/namespace.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::conventions {

/// The rigid transforms of ITK in three dimensions that are read and written.
enum class ItkTransformType { kEuler3D, kVersorRigid3D, kAffine };

/// An ITK transform as its file has it. A point [mm] goes to M (p - c) + c + t with the centre c, the first three fixed
/// parameters.
///
/// - Euler3DTransform: angles about x, y and z [rad], t [mm]; M = Rz Rx Ry, or Rz Ry Rx where the fourth fixed
///   parameter is not 0.
/// - VersorRigid3DTransform: the vector part of M's unit quaternion, whose scalar part is not negative; t [mm].
/// - AffineTransform, MatrixOffsetTransformBase: M row by row, t [mm].
///
/// Source: Euler3DTransform, VersorRigid3DTransform and MatrixOffsetTransformBase of ITK.
struct ItkTransform {
  ItkTransformType type = ItkTransformType::kEuler3D;
  std::vector<double> parameters;
  std::vector<double> fixed_parameters;
};

/// The rigid transform [m]. Throws InputError that names `place` and the field when there are not as many numbers as
/// the type has, or M is no rotation.
Pose poseOf(const ItkTransform& transform, const std::string& place);

/// A rigid transform [m] as one of ITK's about this centre [mm].
ItkTransform itkTransformOf(const Pose& T, ItkTransformType type,
                            const Eigen::Vector3d& center_mm = Eigen::Vector3d::Zero());

}  // namespace angio::conventions
