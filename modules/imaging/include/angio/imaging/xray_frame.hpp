// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/imaging/namespace.hpp"
#include "angio/types/xray_frame.hpp"

namespace angio::imaging {

/// The part of a frame inside `window` [px], with the camera of that part: the principal point moves with the corner.
/// Shares the pixels. Throws InputError when the window is empty or not within the image.
XrayFrame cropped(const XrayFrame& frame, const cv::Rect& window);

}  // namespace angio::imaging
