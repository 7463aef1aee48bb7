// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <utility>

#include "angio/registration/result.hpp"
#include "tree_error.hpp"

namespace angio::registration {

/// Returns what an error leaves open over the tree's points (3 x N, about the centroid), of which a few are looked at.
PlaceSpread spreadOf(const TreeError& error, const Eigen::Matrix3Xd& points_centered, const Pose& T_camera_centered);

/// What is uncertain of a fit, as it was when the fit came to rest.
class FitUncertainty final : public PointUncertainty {
 public:
  FitUncertainty(std::shared_ptr<const TreeError> error, const Eigen::Matrix3d& R_camera_model,
                 const Eigen::Vector3d& centroid)
      : error_(std::move(error)), R_(R_camera_model), centroid_(centroid) {}

  Eigen::Matrix3d covarianceAt(const Eigen::Vector3d& p_model) const override {
    return R_ * error_->pointCovariance(p_model - centroid_) * R_.transpose();
  }

 private:
  std::shared_ptr<const TreeError> error_;
  Eigen::Matrix3d R_;
  Eigen::Vector3d centroid_;
};

}  // namespace angio::registration
