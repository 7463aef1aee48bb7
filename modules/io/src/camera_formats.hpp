// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/geometry/xray_camera.hpp"

namespace angio {

/// The widest detector a camera file may name, as in XrayCamera [px].
constexpr double kLargestImageSide = 32768;

/// Reads ViSP's camera XML (vpXmlParserCamera): one camera with an image size and a model without distortion. Throws
/// InputError.
XrayCamera readVispCamera(const std::string& path);

}  // namespace angio
