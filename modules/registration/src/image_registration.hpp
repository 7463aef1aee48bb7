// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "angio/registration/registration.hpp"

namespace angio::registration {

/// What methods that look at the X-ray image have in common: a rigid fit from one start, without a prior, to the
/// attenuation of what is not wider than a vessel.
class ImageRegistration : public Registration {
 public:
  /// @param name  Of the method, for what it refuses.
  ImageRegistration(const char* name, const VesselTree& tree);

  using Registration::align;
  RegistrationResult align(const XrayViews& views, const PosePrior& prior, const Pose& start) final;

  /// Prepares the images once for all starts.
  RegistrationResult search(const XrayViews& views, const PosePrior& prior, const StartSettings& starts,
                            const SearchProgress& progress = {}) final;

  const VesselTree& tree() const final { return tree_; }

 protected:
  const Eigen::Matrix3Xd& pointsCentered() const { return points_centered_; }  ///< About the centroid, 3 x N [m].

  /// Moves the pose of the centred tree, counts the result's iterations and says how far the last one moved the
  /// projection. Nothing else of the result is set here.
  /// @param attenuations  One a view, by vesselAttenuation().
  virtual void fit(const XrayViews& views, const std::vector<cv::Mat>& attenuations, Pose& T_camera_centered,
                   RegistrationResult& result) = 0;

  /// Of the result's pose, as RegistrationResult has it: from the nearest points of the centreline, unless the method
  /// knows better.
  virtual std::optional<Matrix6d> covarianceAt(const XrayViews& views, const Pose& T_camera_centered) const;

 private:
  const char* name_;
  VesselTree tree_;
  Eigen::Matrix3Xd points_centered_;
  const std::vector<cv::Mat>* prepared_ = nullptr;  // Those of the search that is under way.
};

}  // namespace angio::registration
