// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/vessel_files.hpp"

#include "angio/base/errors.hpp"
#include "extension.hpp"
#include "tree_formats.hpp"

namespace angio {
namespace {

struct TreeFormat {
  const char* extension;
  TreeReader* read;
  TreeWriter* write;  // Null for formats that are only read.
};

constexpr TreeFormat kFormats[] = {
    {".csv", readCsvTree, writeCsvTree},
    {".swc", readSwcTree, writeSwcTree},
    {".vtp", readVtpTree, nullptr},
    {".vtk", readVtkTree, nullptr},
    {".txt", readHmmTree, nullptr},
};

}  // namespace

VesselTree readVesselTree(const std::string& path) {
  const std::string extension = extensionOf(path);
  std::string known;
  for (const TreeFormat& format : kFormats) {
    if (extension == format.extension) return format.read(path);
    known += std::string(known.empty() ? "" : ", ") + format.extension;
  }
  throw InputError(path, "extension", extension, "must be one of " + known);
}

void writeVesselTree(const std::string& path, const VesselTree& tree) {
  const std::string extension = extensionOf(path);
  std::string known;
  for (const TreeFormat& format : kFormats) {
    if (!format.write) continue;
    if (extension == format.extension) return format.write(path, tree);
    known += std::string(known.empty() ? "" : ", ") + format.extension;
  }
  throw InputError(path, "extension", extension, "must be one of " + known);
}

}  // namespace angio
