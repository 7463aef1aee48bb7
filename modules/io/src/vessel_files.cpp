// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/vessel_files.hpp"

#include <algorithm>
#include <filesystem>

#include "angio/base/errors.hpp"
#include "angio/io/curve_folder.hpp"
#include "extension.hpp"
#include "tree_formats.hpp"

namespace angio::io {
namespace {

struct TreeFormat {
  const char* extension;
  TreeReader* read;
  TreeWriter* write;      // Null for formats that are only read.
  TreeWriter* write_ras;  // For a tree in RAS; null when the format does not say what it is in.
};

constexpr TreeFormat kFormats[] = {
    {".csv", readCsvTree, writeCsvTree, nullptr}, {".swc", readSwcTree, writeSwcTree, nullptr},
    {".vtp", readVtpTree, writeVtpTree, nullptr}, {".vtk", readVtkTree, nullptr, nullptr},
    {".txt", readHmmTree, nullptr, nullptr},      {".mrk.json", readMrkJsonTree, writeMrkJsonTree, writeRasMrkJsonTree},
    {".tre", readTreTree, writeTreTree, nullptr},
};

// The last part of the name, or the last two where a format wants two.
bool hasExtension(const std::string& path, const std::string& wanted) {
  const std::string last = extensionOf(path);
  if (std::count(wanted.begin(), wanted.end(), '.') == 1) return last == wanted;
  return extensionOf(std::filesystem::path(path).stem().string()) + last == wanted;
}

}  // namespace

VesselTree readVesselTree(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return joinedCurves(path, readCurveFolder(path));
  std::string known;
  for (const TreeFormat& format : kFormats) {
    if (hasExtension(path, format.extension)) return format.read(path);
    known += std::string(known.empty() ? "" : ", ") + format.extension;
  }
  throw InputError(path, "extension", extensionOf(path), "must be one of " + known);
}

VesselTree withOtherFrame(const VesselTree& tree) {
  Eigen::Matrix3Xd points_m = tree.points();
  points_m.topRows<2>() *= -1;
  return {std::move(points_m), tree.parents(), tree.radii()};
}

void writeVesselTree(const std::string& path, const VesselTree& tree, PatientFrame frame) {
  std::string known;
  for (const TreeFormat& format : kFormats) {
    if (!format.write) continue;
    if (hasExtension(path, format.extension)) {
      if (frame == PatientFrame::kLps) return format.write(path, tree);
      return (format.write_ras ? format.write_ras : format.write)(path, withOtherFrame(tree));
    }
    known += std::string(known.empty() ? "" : ", ") + format.extension;
  }
  throw InputError(path, "extension", extensionOf(path), "must be one of " + known);
}

}  // namespace angio::io
