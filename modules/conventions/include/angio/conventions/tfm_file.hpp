// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/conventions/itk_transform.hpp"

namespace angio::conventions {

/// Reads the one rigid transform of an ITK transform file, "#Insight Transform File V1.0" (.tfm, .txt), whose numbers
/// are of type double or float. ITK's own reader takes what it cannot read for zero.
///
/// Throws InputError that names file, line, field and rule: another file, more transforms than one, a type that is not
/// among ItkTransformType, a number missing or too many.
ItkTransform readTfm(const std::string& path);

/// Writes what readTfm reads. Throws InputError when the file cannot be written or a number is not finite.
void writeTfm(const std::string& path, const ItkTransform& transform);

}  // namespace angio::conventions
