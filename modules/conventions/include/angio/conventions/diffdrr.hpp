// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/conventions/world_frame.hpp"
#include "angio/conventions/xray_projection.hpp"

namespace angio::conventions {

/// DiffDRR's `orientation`: how the C-arm stands before it is turned.
enum class DiffDrrOrientation { kAp, kPa, kNone };

/// The arguments of DiffDRR's DRR(...) and of its pose, of the versions that take the whole source-detector distance
/// (sdd) and not half of it (sdr).
///
/// The source is at the origin of DiffDRR's camera frame, the detector at z = sdd; y is up in the picture, and x is
/// left in it with `reverse_x_axis`, right without. A pose is world = R (reorient p + t), R = Rz Rx Ry:
/// `convert(rotations, translations, parameterization="euler_angles", convention="ZXY")`. The world's axes are the
/// patient's R, A, S, its origin the volume's centre. Source: diffdrr/detector.py, pose.py and data.py of DiffDRR.
struct DiffDrrProjection {
  Eigen::Vector3d rotations_deg = Eigen::Vector3d::Zero();  ///< About z, x and y, in this order.
  Eigen::Vector3d translations_mm = Eigen::Vector3d::Zero();
  DiffDrrOrientation orientation = DiffDrrOrientation::kAp;
  bool reverse_x_axis = true;
  double sdd_mm = 0;  ///< Source-detector distance.
  int height_px = 0, width_px = 0;
  double delx_mm = 0, dely_mm = 0;  ///< Pixels, along a row and along a column.
  double x0_mm = 0, y0_mm = 0;      ///< DRR's arguments of these names.
  WorldFrame world;
};

/// Throws InputError that names the field when a size or distance is not positive.
ConvertedProjection fromDiffDrr(const DiffDrrProjection& theirs);

/// With the `reverse_x_axis` that needs no flip of the picture. Throws InputError when the camera does not say its
/// source-detector distance.
DiffDrrProjection toDiffDrr(const XrayProjection& ours, DiffDrrOrientation orientation, const WorldFrame& world);

}  // namespace angio::conventions
