// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/conventions/namespace.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"

namespace angio::conventions {

/// The geometry of an X-ray picture as this project has it: the picture as seen from the source.
struct XrayProjection {
  Pose T_camera_model = Pose::Identity();  ///< Model to camera [m].
  XrayCamera camera;
};

/// Where the source is, in the model's frame [m].
Eigen::Vector3d sourceInModel(const XrayProjection& projection);

/// The detector in the model's frame [m]: takes the pixel (u, v, 0, 1) to its middle; the third column is the beam's
/// direction. Throws InputError when the camera does not say its source-detector distance.
Eigen::Matrix4d detectorInModel(const XrayProjection& projection);

/// What has to be done to another program's picture so that it is the one as seen from the source, and the other way
/// round: programs that look from the detector to the source have their pictures mirrored.
enum class PictureFlip { kNone, kLeftRight, kUpDown };

/// What a convention makes of another one.
struct ConvertedProjection {
  XrayProjection projection;
  PictureFlip flip = PictureFlip::kNone;
};

}  // namespace angio::conventions
