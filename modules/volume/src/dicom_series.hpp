// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/volume/volume.hpp"

namespace angio::volume {

/// The volume of the one DICOM series in a folder: slices of one size, in their order along the normal, evenly spaced
/// to a hundredth of a slice's distance. Throws InputError.
Volume readDicomSeries(const std::string& folder);

}  // namespace angio::volume
