// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "angio/volume/namespace.hpp"

namespace angio::volume {

/// Returns the beginning of a regular file, at most `max_bytes` of it. These functions throw InputError.
std::string beginningOf(const std::string& path, std::size_t max_bytes);

/// Returns the bytes of a regular file.
std::uintmax_t sizeOf(const std::string& path);

/// Returns the numbers between blanks (and `also_blank` characters), as many as `count` says and all finite.
std::vector<double> numbersIn(const std::string& path, const std::string& field, std::string_view text,
                              std::size_t count, std::string_view also_blank = "");

/// Returns the voxels of a volume with these sizes, each 1 to 65535, kMaxVoxels in all.
std::size_t voxelsOf(const std::string& path, const std::string& field, const double* sizes);

/// Returns the bytes of a voxel by the name of its type.
using TypeSizes = std::map<std::string, std::size_t>;
std::size_t bytesOfType(const std::string& path, const char* field, const std::string& type, const TypeSizes& sizes);

/// Returns the path of a data file that a header names: a plain name, of a regular file in the header's folder.
std::string dataFileBeside(const std::string& path, const std::string& field, std::string_view name);

/// Throws unless the bytes of a file behind `first`, unpacked (zlib or gzip) when packed, are those of the voxels:
/// exactly when packed, at least when not.
enum class Packing { kNone, kDeflate };
void checkData(const std::string& path, std::uintmax_t first, std::uintmax_t wanted, Packing packing);

}  // namespace angio::volume
