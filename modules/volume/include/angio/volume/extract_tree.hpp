// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/vessel/vessel_tree.hpp"
#include "angio/volume/repairs.hpp"
#include "angio/volume/volume.hpp"

namespace angio::volume {

/// Where centrelines end: at the wall, or in the middle of the last sphere that fits into the vessel, as VMTK's do.
enum class CentrelineEnd { kWall, kSphere };

/// A tree has no loops: each is cut at one place, or a shape that has some is refused.
enum class CycleRule { kCut, kRefuse };

/// Whether vessels that only touch each other become trees of their own, or one.
enum class KissingRule { kCut, kKeep };

/// From a vessel's shape to its centrelines. Lengths are in the patient [mm].
struct CentrelineSettings {
  static constexpr const char* kName = "centreline";

  double voxel_mm = 0;
  double min_branch_mm = 3;
  static constexpr double min_branch_radii = 0.5;  ///< Least reach of side branches as well, in radii of the parent.
  double min_tree_mm = 10;
  static constexpr double smoothing_mm = 5;     ///< Shorter waves of a centreline are noise [mm].
  static constexpr double smoothing_radii = 4;  ///< The same, in radii of the vessel; the larger counts.
  CentrelineEnd ends = CentrelineEnd::kWall;
  CycleRule cycles = CycleRule::kCut;
  KissingRule kissing = KissingRule::kCut;
  double spacing_mm = 1;

  void visit(SettingsVisitor& v) {
    v.number("voxel_mm", voxel_mm, 0, 20,
             "Side of the equal voxels that the shape is thinned on; 0 takes the volume's smallest spacing");
    v.number("min_branch_mm", min_branch_mm, 0, 1000, "Side branches that reach less out of their parent are spurs");
    v.number("min_tree_mm", min_tree_mm, 0, 1e4, "Trees of less length in all are dropped");
    v.choice("ends", ends, {"wall", "sphere"},
             "Where a centreline ends: at the vessel's wall, or at the centre of the last sphere inside it");
    v.number("spacing_mm", spacing_mm, 0.05, 100, "Distance between points of the result");
  }
};

/// Where a surface was cut open across a vessel.
struct Opening {
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();  ///< In the patient's axes L, P, S [m].
  double radius_m = 0;
};

/// Centrelines of vessels, and what had to be done to get a tree.
struct ExtractedTree {
  VesselTree tree;              ///< In the patient's axes L, P, S [m], with radii; one tree per connected vessel.
  std::vector<Repair> repairs;  ///< Cycles, contacts, stubs and small trees, the longest of each first.

  int count(Flaw flaw) const;
};

/// What is about to be done, for a progress bar; there are kExtractionStages.
using ExtractionProgress = std::function<void(int stages_done, const char* stage)>;
constexpr int kExtractionStages = 5;

/// The centrelines of vessels whose `shape` is positive inside and zero at the wall (vesselShape): thinned on equal
/// voxels in the order of the distance to the wall, linked to trees, freed of spurs, centred between voxels, smoothed,
/// brought to the wall at their ends. Radii are those of the largest sphere inside the vessel.
///
/// Loops are cut where vessels only touch, else where they are thinnest; of places as thin, to half a voxel, at the one
/// farthest from the root. A cut end stays where it is, and is no root.
///
/// A line that ends within the radius of one of the `openings` ends in its middle: of a flat end thinning finds a
/// corner, and VMTK's lines begin and end there too.
///
/// Roots are the thickest ends; of the tree nearest to `root_m` [m] it is the end nearest to it. Throws InputError for
/// settings that cannot be, for loops where they are refused, and when no tree is long enough.
ExtractedTree extractTree(const Volume& shape, const CentrelineSettings& settings,
                          const std::optional<Eigen::Vector3d>& root_m = std::nullopt,
                          const ExtractionProgress& progress = {}, const std::vector<Opening>& openings = {});

}  // namespace angio::volume
