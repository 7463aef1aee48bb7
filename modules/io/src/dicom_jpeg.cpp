// SPDX-License-Identifier: GPL-2.0-or-later
#include "dicom_jpeg.hpp"

namespace angio::io {
namespace {

// ISO 10918-1, table B.1: C0 to CF are frame headers but for the tables C4 and CC and the reserved C8.
bool isFrameHeader(unsigned marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

JpegCoding codingOf(unsigned marker) {
  if (marker == 0xC0 || marker == 0xC1) return JpegCoding::kSequential;
  return marker == 0xC3 ? JpegCoding::kLossless : JpegCoding::kOther;
}

}  // namespace

std::string JpegFrame::formatValue() const {
  return "JPEG " + std::to_string(width_px) + " x " + std::to_string(height_px) + ", " + std::to_string(bits) +
         " bit, " + std::to_string(channels) + (channels == 1 ? " channel" : " channels");
}

std::optional<JpegFrame> readJpegFrame(const unsigned char* bytes, std::size_t size) {
  if (size < 4 || bytes[0] != 0xFF || bytes[1] != 0xD8) return std::nullopt;
  const auto word = [&](std::size_t at) { return bytes[at] << 8 | bytes[at + 1]; };
  std::size_t at = 2;
  while (at + 4 <= size && bytes[at] == 0xFF) {
    const unsigned marker = bytes[at + 1];
    if (marker == 0xFF) {  // Filling.
      ++at;
      continue;
    }
    if (isFrameHeader(marker) && at + 10 <= size) {
      return JpegFrame{word(at + 7), word(at + 5), bytes[at + 4], bytes[at + 9], codingOf(marker)};
    }
    at += 2 + static_cast<std::size_t>(word(at + 2));
  }
  return JpegFrame{};
}

}  // namespace angio::io
