// SPDX-License-Identifier: GPL-2.0-or-later
#include "nearest_covariance.hpp"

#include "fit_classification.hpp"
#include "rigid_step.hpp"

namespace angio::registration {

std::optional<Matrix6d> covarianceByNearest(const Eigen::Matrix3Xd& points_centered, const XrayViews& views,
                                            const Pose& T_camera_centered, const PosePriorTerm& prior,
                                            const Eigen::Vector3d& centroid_model) {
  const auto size = static_cast<int>(points_centered.cols());
  std::vector<Pull> pulls;
  for (const XrayView& view : views) {
    const PointMatcher matcher(view.centerline.points_px);
    Projected projected(size);
    projectPoints(points_centered, view, T_camera_centered, OutsideImage::kIgnore, projected);
    Pull& pull = pulls.emplace_back(size);
    matchNearest(projected, matcher, pull);
    for (int i = 0; i < size; ++i) {
      if (pull.weight[i] > 0)
        pull.weighted_squares_px2 += (projected.pixel.col(i) - pull.target_px.col(i)).squaredNorm();
    }
  }
  return covarianceOf(normalEquations(points_centered, views, T_camera_centered, pulls, prior), pulls,
                      T_camera_centered, centroid_model);
}

}  // namespace angio::registration
