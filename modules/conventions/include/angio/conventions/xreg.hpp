// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/conventions/world_frame.hpp"
#include "angio/conventions/xray_projection.hpp"

namespace angio::conventions {

/// xreg's `cam_coord_frame_type`: where the camera frame's origin is, and which way its z points. x goes along the rows
/// and y along the columns of the picture.
enum class XregFrame {
  kFocalPointPositiveZ,  ///< Origin at the source, +z to the detector: as ours.
  kFocalPointNegativeZ,  ///< Origin at the source, -z to the detector: x, y, z of a picture seen from the detector.
  kOnDetector            ///< Origin on the detector at the principal point, +z to the source.
};

/// xreg's CameraModel. A point's index is K (E p), with z replaced by focal length - z for an origin on the detector.
/// Source: lib/transforms/xregPerspectiveXform.{h,cpp} and lib/file_formats/xregH5CamModelIO.cpp of xreg.
struct XregProjection {
  XregFrame frame = XregFrame::kFocalPointNegativeZ;
  int num_rows = 0, num_cols = 0;
  double row_spacing_mm = 0, col_spacing_mm = 0;
  Eigen::Matrix3d intrinsic = Eigen::Matrix3d::Identity();
  Eigen::Matrix4d extrinsic = Eigen::Matrix4d::Identity();  ///< World to camera [mm].
  WorldFrame world;
};

/// Throws InputError when the intrinsic matrix shears or is no camera's, or the extrinsic one is not rigid.
ConvertedProjection fromXreg(const XregProjection& theirs);

/// What another program makes of ours, and the flip of our picture that goes with it.
struct XregResult {
  XregProjection projection;
  PictureFlip flip = PictureFlip::kNone;
};

/// With the signs of xreg's own cameras: a negative z goes with a picture that is flipped left for right. Throws
/// InputError when the camera does not say its source-detector distance.
XregResult toXreg(const XrayProjection& ours, XregFrame frame, const WorldFrame& world);

}  // namespace angio::conventions
