// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/io/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::io {

/// One open curve along a vessel.
struct NamedCurve {
  std::string name;            ///< Of its file without `.mrk.json`.
  std::string place;           ///< File and markup, for messages.
  Eigen::Matrix3Xd points_mm;  ///< 3 x N, LPS.
  std::vector<std::optional<double>> radii_mm;
};

/// Reads all `.mrk.json` files of a folder (3D Slicer's markups), in the order of their names. Throws InputError for a
/// file as readVesselTree does, and for a folder without one.
std::vector<NamedCurve> readCurveFolder(const std::string& folder);

/// Joins curves to one tree; the first one begins at the inlet.
///
/// A curve hangs where one of its points is a point of another; else where its beginning, or else its end, is within
/// the radius of the nearest point of another (1 mm where the radius is unknown). Where curves close a ring, as both
/// vertebral arteries do, it stays open: the curve that comes later ends in front of where they meet. Curves come
/// nearest to the inlet first, counted in points. `from` names the folder in messages. Throws InputError when a curve
/// hangs on no other.
VesselTree joinedCurves(const std::string& from, const std::vector<NamedCurve>& curves);

/// The curve of that name, or the only one whose name ends with that word: "LCCA" for "Centerline curve - LCCA". Throws
/// InputError for a name of none or of several.
const NamedCurve& curveOfName(const std::string& from, const std::vector<NamedCurve>& curves, const std::string& name);

/// What each of a joined tree's branches is called, by its number (TreeTopology): the curve that most of its points are
/// on, the first of several. Empty where it is on none.
std::vector<std::string> branchNames(const VesselTree& tree, const std::vector<NamedCurve>& curves);

}  // namespace angio::io
