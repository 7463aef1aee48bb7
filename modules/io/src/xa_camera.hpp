// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "dicom_file.hpp"
#include "dicom_pixels.hpp"

namespace angio::io {

using Lines = std::vector<std::string>;

/// "(0018,1164) Imager Pixel Spacing is missing: " and what was done instead.
std::string missing(const DicomTag& tag, const std::string& instead);

/// The camera of a frame with its distances and the image's middle as its principal point; the rest of the result is
/// left alone. Throws InputError that names the attribute when a value is wrong, or when no camera can be had.
XaGeometry readXaCamera(const DicomFile& file, const DicomPixelLayout& layout, int frame);

/// Clockwise, of what is stored against the detector [rad]. Throws InputError unless it is by quarters.
double fieldRotation(const DicomFile& file, int frame);

/// Moves the principal point to the middle of the detector's active area, where the file says how the field of view
/// lies on it, and says so; `stored_mirrored` must be known. Source: DICOM PS3.3 C.8.11.4.
void placePrincipalPoint(const DicomFile& file, int frame, XaGeometry& geometry);

}  // namespace angio::io
