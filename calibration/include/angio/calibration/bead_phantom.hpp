// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "angio/calibration/namespace.hpp"

namespace angio::calibration {

/// One radio-opaque ball, or a mark without a size: a corner of a grid.
struct Bead {
  Eigen::Vector3d position_m;  ///< Centre, phantom frame.
  double radius_m = 0;         ///< 0: a mark, which only a table can name.
};

/// Balls in a radiolucent body, arranged and sized so that a view tells which is which and whether it is mirrored; or a
/// grid of marks, whose views are tables that number them.
struct BeadPhantom {
  std::string name;
  std::vector<Bead> beads;  ///< Their place in this list is their number.

  /// Whether its views may be images: all are balls.
  bool isCoded() const { return !beads.empty() && beads.front().radius_m > 0; }
  /// Whether all lie in one plane, to a thousandth of the phantom's size.
  bool isPlanar() const;
  Eigen::Vector3d center_m() const;  ///< Mean of the beads.
  Eigen::Matrix3Xd positions_m() const;
};

/// Reads a phantom (YAML): `name`, and `beads: [[x_mm, y_mm, z_mm, diameter_mm], ...]` or, for a grid of marks,
/// `points: [[x_mm, y_mm, z_mm], ...]`. Throws InputError that names file, line, field, value and rule: fewer than 8
/// beads or 4 points, beads that touch, points that coincide, sizes beyond 0.2-20 mm, positions beyond 1 m (a file in
/// micrometres), all within 10 mm (a file in metres), and beads that lie in a plane, or whose arrangement is its own
/// mirror image or turned image to half a millimetre, so that no view can tell them apart.
BeadPhantom readBeadPhantom(const std::string& path);

/// Writes what readBeadPhantom reads. Throws InputError when the file cannot be written.
void writeBeadPhantom(const std::string& path, const BeadPhantom& phantom);

constexpr int kMaxHelixBeads = 108;  ///< As long as the code.

/// A helix of small and large beads in a coded order, as C-arm phantoms have it: every run of 8 along the helix occurs
/// once, and in neither direction twice.
///
/// The usual one nearly fills what a detector of 260 mm sees at the isocentre, 190 mm: focal length and depth are told
/// apart by how much more the front of the phantom is enlarged than its back, by the product of its depth and its size
/// in the image.
struct HelixPhantomSettings {
  double radius_mm = 85;
  double height_mm = 150;
  double turns = 4;
  int beads = kMaxHelixBeads;
  double small_diameter_mm = 1.6;
  double large_diameter_mm = 3.2;
};
BeadPhantom helixPhantom(const HelixPhantomSettings& settings = {});

}  // namespace angio::calibration
