// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/projection.hpp"

namespace angio::vessel {

Centerline2d projectedCenterline(const VesselTree& tree, const XrayCamera& camera, const Pose& T_camera_model) {
  std::vector<Eigen::Vector2d> pixels;
  std::vector<int> branch;
  int label = 0;
  for (const auto& chain : tree.branches()) {
    bool open = false;
    for (const int i : chain) {
      const auto pixel = camera.project(T_camera_model * tree.points().col(i));
      const bool seen = pixel && camera.sees(*pixel);
      if (seen) {
        pixels.push_back(*pixel);
        branch.push_back(label);
      } else if (open) {
        ++label;
      }
      open = seen;
    }
    ++label;
  }
  Eigen::Matrix2Xd points(2, pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) points.col(static_cast<Eigen::Index>(i)) = pixels[i];
  return makeCenterline(std::move(points), std::move(branch));
}

}  // namespace angio::vessel
