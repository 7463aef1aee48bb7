// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "angio/io/curve_folder.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::io {

/// Reads the vessel tree of one file format; throws InputError.
using TreeReader = VesselTree(const std::string& path);

TreeReader readVtpTree, readVtkTree, readHmmTree, readMrkJsonTree, readTreTree;

/// What files call patient axes.
inline const char* nameOf(PatientFrame frame) { return frame == PatientFrame::kRas ? "RAS" : "LPS"; }

/// The axes of that name. Throws InputError that names `place` and `field`.
PatientFrame frameNamed(const std::string& place, const std::string& field, const std::string& name);

/// Writes one file format; throws InputError. `frame` is what the tree's points are in, for the formats that say so.
using TreeWriter = void(const std::string& path, const VesselTree& tree, std::optional<PatientFrame> frame);

TreeWriter writeVtpTree, writeMrkJsonTree, writeTreTree;

/// The curves of one file of 3D Slicer's markups, without names.
std::vector<NamedCurve> readMrkJsonCurves(const std::string& path);

/// A place to the last digit, to be found by.
using Position = std::array<double, 3>;
inline Position positionOf(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }

/// One point as it stands in a file.
struct TreeRow {
  int line = 0;  ///< From 1; 0 in a binary file.
  int id = 0;
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  std::optional<double> radius_mm;
  int parent = -1;  ///< An id, or -1 at a root.
};

/// The tree of all rows, in their order. A defect throws InputError with the line of its row, the field and what the
/// file says there.
VesselTree treeOfRows(const std::string& path, const std::vector<TreeRow>& rows);

/// A radius of a format in which numbers that are not positive mean that it is unknown.
std::optional<double> knownRadius(double radius_mm);

}  // namespace angio::io
