// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/geometry/xray_camera.hpp"
#include "angio/io/namespace.hpp"

namespace angio::io {

/// The widest detector a camera file may name, as in XrayCamera [px].
constexpr double kMaxImageSide = 32768;

/// Reads ViSP's camera XML (vpXmlParserCamera): one camera with an image size and a model without distortion. Throws
/// InputError.
XrayCamera readVispCamera(const std::string& path);

}  // namespace angio::io
