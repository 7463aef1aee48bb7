// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/io/xa_files.hpp"
#include "dicom_file.hpp"

namespace angio::io {

/// The largest image that is read, in each direction [px].
constexpr unsigned kMaxSide = 8192;

/// The same, checked against what the file holds.
struct DicomPixelLayout : DicomPixels {
  std::vector<unsigned> first_fragments;  ///< Of each frame, when the pixels are compressed.
};

/// Throws InputError that names the attribute for pixels that are no grey X-ray frames, and for sizes and numbers of
/// frames that the pixel data do not hold. Nothing is decoded.
DicomPixelLayout readPixelLayout(const DicomFile& file);

/// One frame: CV_8UC1, or CV_16UC1 when more than 8 bits are allocated. Values are as stored, but signed ones begin at
/// zero, and MONOCHROME1 is turned, so that more is brighter. Throws InputError when the frame cannot be decoded.
cv::Mat decodeDicomFrame(const DicomFile& file, const DicomPixelLayout& layout, int frame);

}  // namespace angio::io
