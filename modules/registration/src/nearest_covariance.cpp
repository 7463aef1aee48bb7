// SPDX-License-Identifier: GPL-2.0-or-later
#include "nearest_covariance.hpp"

#include "fit_classification.hpp"
#include "rigid_step.hpp"

namespace angio::registration {
namespace {

// Where matches lose their weight: the distance at which the alignment score takes a point as explained [px].
constexpr double kMatched_px = 3;

}  // namespace

std::optional<Matrix6d> covarianceByNearest(const Eigen::Matrix3Xd& points_centered, const XrayViews& views,
                                            const Pose& T_camera_centered, const PosePriorTerm& prior,
                                            const Eigen::Vector3d& centroid_model) {
  const auto size = static_cast<int>(points_centered.cols());
  IterativePnpSettings gaussian;
  gaussian.neighbours_each_side = 0;
  std::vector<Pull> pulls;
  for (const XrayView& view : views) {
    const PointMatcher matcher(view.centerline.points_px);
    Projected projected(size);
    projectPoints(points_centered, view, T_camera_centered, OutsideImage::kIgnore, projected);
    Pull& pull = pulls.emplace_back(size);
    matchNearest(projected, matcher, pull);
    weigh(projected, matcher, {}, gaussian, kMatched_px, pull);
  }
  return covarianceOf(normalEquations(points_centered, views, T_camera_centered, pulls, prior), pulls,
                      T_camera_centered, centroid_model);
}

}  // namespace angio::registration
