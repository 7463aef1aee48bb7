// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <vector>

#include "angio/geometry/xray_camera.hpp"
#include "angio/perception/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::perception {

/// How an image has to be read so that it is as xray_frame_t wants it: seen from the source, x right and y down. The
/// eight orientations in which a display may turn and mirror it.
enum class ImageReading {
  kAsSent,
  kMirrored,     ///< Left to right.
  kUpsideDown,   ///< Mirrored top to bottom.
  kTurnedHalf,   ///< By 180 deg.
  kTurnedRight,  ///< By 90 deg, clockwise.
  kTurnedLeft,
  kTransposed,      ///< Mirrored about the falling diagonal.
  kAntiTransposed,  ///< Mirrored about the rising one.
};
constexpr std::array<ImageReading, 8> kImageReadings = {
    ImageReading::kAsSent,      ImageReading::kMirrored,   ImageReading::kUpsideDown, ImageReading::kTurnedHalf,
    ImageReading::kTurnedRight, ImageReading::kTurnedLeft, ImageReading::kTransposed, ImageReading::kAntiTransposed};

/// "mirrored left to right", "turned by 90 deg clockwise", ...; "as sent".
const char* nameOf(ImageReading reading);

/// Returns the readings besides "as sent" that keep the image's size: all seven of one as wide as high, else three.
std::vector<ImageReading> otherReadings(const XrayCamera& camera);

/// Returns curves as they would have been found in the image read so, about the image's middle. Positions and tangents
/// [px, rad]; the rest is kept. Readings that swap rows and columns are for images as wide as high.
Centerline2d readAs(ImageReading reading, const Centerline2d& curves, const XrayCamera& camera);

}  // namespace angio::perception
