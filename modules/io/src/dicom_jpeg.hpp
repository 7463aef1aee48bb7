// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// The processes of JPEG that are decoded; a progressive image can be made to take very long.
enum class JpegCoding { kSequential, kLossless, kOther };

/// What the frame header of a JPEG image says.
struct JpegFrame {
  int width_px = 0;
  int height_px = 0;
  int bits = 0;
  int channels = 0;
  JpegCoding coding = JpegCoding::kOther;

  /// "JPEG 512 x 512, 8 bit, 1 channel".
  std::string formatValue() const;
};

/// The first frame header behind a start of image; nothing when the bytes do not begin an image. A header that is not
/// there before the bytes end gives an image of no size.
std::optional<JpegFrame> readJpegFrame(const unsigned char* bytes, std::size_t size);

}  // namespace angio::io
