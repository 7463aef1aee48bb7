// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/conventions/itk_transform.hpp"
#include "fields.hpp"

namespace angio::conventions {

/// ITK's names, without the type of number and the dimensions that a file adds ("_double_3_3"). The last one is read
/// only: it is what ITK calls an affine transform's base.
constexpr Names<ItkTransformType, 4> kItkTransforms = {{{"Euler3DTransform", ItkTransformType::kEuler3D},
                                                        {"VersorRigid3DTransform", ItkTransformType::kVersorRigid3D},
                                                        {"AffineTransform", ItkTransformType::kAffine},
                                                        {"MatrixOffsetTransformBase", ItkTransformType::kAffine}}};

}  // namespace angio::conventions
