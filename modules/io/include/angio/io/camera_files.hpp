// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/geometry/xray_camera.hpp"

namespace angio {

/// Reads an X-ray camera. The extension (in any case) is the choice of the format:
///
/// - `.yaml`, `.yml`: `image_size_px: [w, h]`, `fx_px`, `fy_px`, `cx_px`, `cy_px`; optional `pixel_spacing_mm`,
///   `source_detector_distance_mm` and `distortion`, which must be zero.
/// - `.xml`: ViSP's camera parameters, with one camera and a model without distortion.
///
/// Throws InputError that names file, line, key, value and rule; an unknown key is refused.
XrayCamera readCamera(const std::string& path);

/// Writes the YAML form. Throws InputError when the file cannot be written.
void writeCamera(const std::string& path, const XrayCamera& camera);

}  // namespace angio
