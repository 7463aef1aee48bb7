// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>

#include "angio/registration/registration.hpp"
#include "arrays.hpp"

namespace angio::python {

/// One X-ray view, with all that it is made of.
struct OwnedView {
  Centerline2d centerline;
  XrayCamera camera;
  Pose T_view_first = Pose::Identity();
  std::vector<Eigen::Vector2d> collimator_px;
  cv::Mat image;  ///< Empty where it is not at hand.
  double image_s = 0;

  XrayView borrowed() const {
    return {centerline, camera, T_view_first, collimator_px, image.empty() ? nullptr : &image};
  }
};

/// A registration's result, and the tree that it is of.
struct TreeResult {
  RegistrationResult result;
  std::shared_ptr<const VesselTree> tree;
  double image_s = 0;
};

}  // namespace angio::python
