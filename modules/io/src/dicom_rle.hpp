// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// Unpacks one frame of DICOM's run lengths (PS3.5 annex G) into `samples` samples of `bytes_per_sample` bytes, 1 or 2,
/// little endian. False when the packed bytes are no such frame. DCMTK's own decoder trusts the offsets it reads, and
/// leaves its buffer when they are wrong.
bool unpackRunLengths(const std::uint8_t* packed, std::size_t size, std::size_t samples, int bytes_per_sample,
                      std::uint8_t* frame);

}  // namespace angio::io
