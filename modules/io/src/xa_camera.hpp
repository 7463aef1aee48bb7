// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/io/xa_files.hpp"
#include "dicom_pixels.hpp"

namespace angio::io {

/// The camera of a frame with its distances; the rest of the result is left alone. Throws InputError that names the
/// attribute when a value is wrong, or when no camera can be had.
XaGeometry readXaCamera(const DicomFile& file, const DicomPixelLayout& layout, int frame);

/// "(0018,1164) Imager Pixel Spacing is missing: " and what was done instead.
std::string missing(const DicomTag& tag, const std::string& instead);

}  // namespace angio::io
