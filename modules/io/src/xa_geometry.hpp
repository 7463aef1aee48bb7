// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/io/xa_files.hpp"
#include "dicom_pixels.hpp"

namespace angio::io {

/// Attributes with one value for each frame, or one that is the step from frame to frame; empty when not there.
struct XaIncrements {
  std::vector<double> primary_deg, secondary_deg;
  std::vector<double> vertical_mm, lateral_mm, longitudinal_mm;  ///< Of the table.
  std::vector<double> frame_times_ms;                            ///< From the frame before; one value is for all.
};

/// Throws InputError when a list is neither one value long nor as long as there are frames.
XaIncrements readXaIncrements(const DicomFile& file, int frames);

/// Throws InputError that names the attribute when a value is wrong, or when no camera can be had.
XaGeometry readXaGeometry(const DicomFile& file, const DicomPixelLayout& layout, const XaIncrements& increments,
                          int frame, XaAngleSigns signs);

}  // namespace angio::io
