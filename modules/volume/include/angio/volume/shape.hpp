// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <variant>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/volume/repairs.hpp"
#include "angio/volume/volume.hpp"

namespace angio::volume {

/// Vessels are the voxels of a label volume that have one of these labels; with none named, all that are not zero.
struct LabelSettings {
  std::vector<int> labels;
};

enum class Inside { kAbove, kBelow };  ///< On which side of a threshold vessels are.

/// Vessels are what is above (bright blood) or below (a level set) a threshold, in the volume's own unit. The wall is
/// where the value, linear between voxels, crosses it.
struct ThresholdSettings {
  double threshold = 0;
  Inside inside = Inside::kAbove;
};

/// Vessels are what looks like a bright tube: Jerman et al., "Enhancement of vascular structures in 3D and 2D
/// angiographic images", 2016: a measure from 0 to 1 of the Hessian's eigenvalues, the largest over all scales. Voxels
/// above `strong` count, and those above `weak` that are connected to them.
struct VesselnessSettings {
  static constexpr const char* kName = "vesselness";

  double min_radius_mm = 1;
  double max_radius_mm = 4;
  int scales = 3;  ///< Radii looked at, in equal ratios.
  static constexpr double uniformity =
      0.5;  ///< The paper's tau: small values let weak vessels answer like strong ones.
  double strong = 0.8;
  double weak = 0.5;

  void visit(SettingsVisitor& v) {
    v.number("min_radius_mm", min_radius_mm, 0.05, 100, "Radius of the thinnest vessels that are looked for");
    v.number("max_radius_mm", max_radius_mm, 0.05, 100, "Radius of the widest vessels that are looked for");
    v.number("strong", strong, 0, 1, "Vesselness from which on a voxel is a vessel's");
    v.number("weak", weak, 0, 1,
             "Vesselness from which on a voxel is a vessel's when it hangs together with a strong one");
    v.fixed("scales", scales, 1, 20);
  }
};

/// How vessels are told from the rest.
using ShapeSettings = std::variant<LabelSettings, ThresholdSettings, VesselnessSettings>;

/// Which of the connected pieces are kept.
struct SelectionSettings {
  static constexpr const char* kName = "selection";

  int max_pieces = 0;
  double min_piece_mm3 = 30;

  void visit(SettingsVisitor& v) {
    v.integer("max_pieces", max_pieces, 0, 100000, "Only so many pieces are kept, by volume; 0 keeps all");
    v.number("min_piece_mm3", min_piece_mm3, 0, 1e9, "Smaller pieces are noise");
  }
};

/// Vessels as a field that is positive inside, zero at the wall and negative outside.
struct VesselShape : Volume {
  std::vector<Repair> repairs;  ///< Flaw::kSmallPiece, if any are dropped.
};

/// The vessels of a volume, on the box of the volume that they need.
///
/// `seeds_m` [m]: where given, only pieces that a seed lies in (or within two voxels of) are kept. Holes in the vessels
/// are filled. Throws InputError when nothing is left, or a seed lies in no vessel.
VesselShape vesselShape(const Volume& volume, const ShapeSettings& settings, const SelectionSettings& selection,
                        const std::vector<Eigen::Vector3d>& seeds_m);

/// The same for a mask whose inside is the vessels.
VesselShape vesselShape(VoxelMask mask, const SelectionSettings& selection,
                        const std::vector<Eigen::Vector3d>& seeds_m);

/// Makes outside that is enclosed (6 neighbours, the volume's border is open) inside.
void fillHoles(VoxelMask& mask);

/// How much each voxel looks like a bright tube, 0 to 1.
std::vector<float> vesselness(const Volume& volume, const VesselnessSettings& settings);

}  // namespace angio::volume
