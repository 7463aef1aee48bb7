// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// The part of a detector that the collimator leaves open: what is outside of it shows lead, or what a display puts
/// there, and not the patient.
struct OpenField {
  /// Corners [px], convex, in order; what XrayView::collimator_px takes. Empty when the whole image is open.
  std::vector<Eigen::Vector2d> polygon_px;
  cv::Mat mask;  ///< CV_8UC1 of the image's size, 255 where it is open.
};

/// Finds the shadow of a collimator: rectangular, octagonal, circular, or single blades; darker than the patient, or,
/// where a display whitens it, brighter.
///
/// A shadow reaches the image's edge, is uniform beside what it frames, and the open part is convex with a sharp
/// border. What does not look like that is anatomy, and the field is then the whole image. The border is found to about
/// a hundred-and-fiftieth of the image, where brightness is halfway, as a logarithm, between shadow and patient.
/// `image` is CV_8UC1 or CV_16UC1; throws InputError for another type or an empty image.
OpenField findOpenField(const cv::Mat& image);

}  // namespace angio::imaging
