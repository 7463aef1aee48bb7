// SPDX-License-Identifier: GPL-2.0-or-later
#include "dicom_rle.hpp"

namespace angio::io {
namespace {

constexpr std::size_t kHeaderBytes = 64;

std::size_t headerWord(const std::uint8_t* packed, std::size_t index) {
  const std::uint8_t* b = packed + 4 * index;
  return b[0] | static_cast<std::size_t>(b[1]) << 8 | static_cast<std::size_t>(b[2]) << 16 |
         static_cast<std::size_t>(b[3]) << 24;
}

// One byte of every sample, from `at` up to `end`; written every `stride` bytes.
bool unpackSegment(const std::uint8_t* packed, std::size_t at, std::size_t end, std::size_t samples, std::size_t stride,
                   std::uint8_t* to) {
  std::size_t done = 0;
  while (done < samples) {
    if (at >= end) return false;
    const unsigned code = packed[at++];
    if (code == 128) continue;  // No operation.
    const bool literal = code < 128;
    const std::size_t count = literal ? code + 1 : 257 - code;
    if (count > samples - done || (literal ? count : 1) > end - at) return false;
    for (std::size_t i = 0; i < count; ++i) to[stride * (done + i)] = packed[literal ? at + i : at];
    at += literal ? count : 1;
    done += count;
  }
  return true;
}

}  // namespace

bool unpackRunLengths(const std::uint8_t* packed, std::size_t size, std::size_t samples, int bytes_per_sample,
                      std::uint8_t* frame) {
  const auto segments = static_cast<std::size_t>(bytes_per_sample);
  if (size < kHeaderBytes || headerWord(packed, 0) != segments) return false;
  for (std::size_t s = 0; s < segments; ++s) {
    const std::size_t begin = headerWord(packed, 1 + s), end = s + 1 < segments ? headerWord(packed, 2 + s) : size;
    if (begin < kHeaderBytes || begin > end || end > size) return false;
    // The first segment holds the highest bytes.
    if (!unpackSegment(packed, begin, end, samples, segments, frame + (segments - 1 - s))) return false;
  }
  return true;
}

}  // namespace angio::io
