// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/evaluation/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::evaluation {

/// One picture of a contact sheet: an X-ray with what was seen in it.
struct SheetPicture {
  cv::Mat image;  ///< CV_8UC1 or CV_16UC1.
  Centerline2d centerline;
  std::string caption;
};

/// Pictures in rows of `columns`, each scaled into a square of `side_px`: vessels in red, devices in blue. CV_8UC3.
/// Throws InputError without pictures or with columns or side below 1.
cv::Mat contactSheet(const std::vector<SheetPicture>& pictures, int columns, int side_px);

}  // namespace angio::evaluation
