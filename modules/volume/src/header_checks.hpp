// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "angio/volume/volume.hpp"

namespace angio::volume {

/// The beginning of a regular file, at most `max_bytes` of it. Throws InputError.
std::string beginningOf(const std::string& path, std::size_t max_bytes);

/// Bytes of a regular file.
std::uintmax_t sizeOf(const std::string& path);

/// The numbers between blanks (and `also_blank` characters), as many as `count` says and all finite.
std::vector<double> numbersIn(const std::string& path, const std::string& field, std::string_view text,
                              std::size_t count, std::string_view also_blank = "");

/// Voxels of a volume with these sizes, each 1 to 65535, kMaxVoxels in all.
std::size_t voxelsOf(const std::string& path, const std::string& field, const double* sizes);

/// Bytes of a voxel by the name of its type. Throws InputError for a name that is not among them.
using TypeSizes = std::map<std::string, std::size_t>;
std::size_t bytesOfType(const std::string& path, const char* field, const std::string& type, const TypeSizes& sizes);

/// A data file that a header names: a plain name, of a regular file in the header's folder. Returns its path.
std::string dataFileBeside(const std::string& path, const std::string& field, std::string_view name);

/// Throws unless the bytes of a file behind `first`, unpacked (zlib or gzip) when `packed`, are those of the voxels:
/// exactly when packed, at least when not.
enum class Packing { kNone, kDeflate };
void checkData(const std::string& path, std::uintmax_t first, std::uintmax_t wanted, Packing packing);

/// Look at a header before a parser that trusts it does: what it claims must be well formed, three-dimensional and
/// within bounds, and the data must be in the file (or one file beside it). Throw InputError.
void checkMetaHeader(const std::string& path);
void checkNiftiHeader(const std::string& path);
void checkNrrdHeader(const std::string& path);

/// The volume of the one DICOM series in a folder: slices of one size, in their order along the normal, evenly spaced
/// to a hundredth of a slice's distance. Throws InputError.
Volume readDicomSeries(const std::string& folder);

}  // namespace angio::volume
