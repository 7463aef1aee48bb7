// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/conventions/world_frame.hpp"
#include "angio/conventions/xray_projection.hpp"

namespace angio::conventions {

/// The nine numbers of a projection in RTK's ThreeDCircularProjectionGeometry.
///
/// Rotated axes are Rz(-in-plane) Rx(-out-of-plane) Ry(-gantry) of the fixed ones; in them the source is at
/// (source offsets, source-isocentre), the detector's origin at (projection offsets, source-isocentre less
/// source-detector), and the detector's axes are x and y. The fixed axes are those of IEC 61217. Source: "3D projection
/// geometry" of RTK's documentation.
struct RtkProjection {
  double gantry_deg = 0, out_of_plane_deg = 0, in_plane_deg = 0;
  double source_to_isocenter_mm = 0, source_to_detector_mm = 0;
  Eigen::Vector2d source_offset_mm = Eigen::Vector2d::Zero();
  Eigen::Vector2d projection_offset_mm = Eigen::Vector2d::Zero();
};

using RtkMatrix = Eigen::Matrix<double, 3, 4>;

/// RTK's matrix of a projection: from the fixed system [mm] to the detector's physical coordinates [mm], homogeneous.
RtkMatrix rtkMatrix(const RtkProjection& projection);

/// The numbers of a matrix, whatever its scale. Throws InputError when it is no projection, shears, or has one scale
/// along u and another along v.
RtkProjection rtkProjectionOf(const RtkMatrix& matrix);

/// How the pixels of an RTK projection lie on its detector, as ITK's image says: the physical point of pixel i is
/// origin + direction * spacing * i.
struct RtkDetector {
  int width_px = 0, height_px = 0;
  Eigen::Vector2d origin_mm = Eigen::Vector2d::Zero();
  Eigen::Vector2d spacing_mm = Eigen::Vector2d::Zero();
  Eigen::Vector2d direction{1, 1};  ///< +1 or -1 along u and along v.
};

/// The detector that has its middle at its physical origin, and its first row at its top: what a picture as seen from
/// the source is with y of the detector up. Throws InputError when the camera does not say its source-detector
/// distance.
RtkDetector centeredRtkDetector(const XrayCamera& camera);

/// Throws InputError when a distance is not positive (parallel beams are none of ours) or a direction not +-1.
ConvertedProjection fromRtk(const RtkProjection& theirs, const RtkDetector& detector, const WorldFrame& world);

/// For the picture on centeredRtkDetector(). Throws InputError as that does.
RtkProjection toRtk(const XrayProjection& ours, const WorldFrame& world);

}  // namespace angio::conventions
