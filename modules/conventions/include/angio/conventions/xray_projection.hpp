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

/// What has to be done to another program's picture so that it is the one as seen from the source, and the other way
/// round: programs that look from the detector to the source have their pictures mirrored.
enum class PictureFlip { kNone, kLeftRight, kUpDown };

/// What a convention makes of another one.
struct ConvertedProjection {
  XrayProjection projection;
  PictureFlip flip = PictureFlip::kNone;
};

}  // namespace angio::conventions
