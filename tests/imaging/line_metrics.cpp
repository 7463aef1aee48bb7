// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_metrics.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

namespace angio::test {

double median(std::vector<double> values) {
  EXPECT_FALSE(values.empty());
  std::sort(values.begin(), values.end());
  return values.empty() ? 1e9 : values[values.size() / 2];
}

double medianDistance(const Centerline2d& found, const Scene& scene) {
  std::vector<double> distances;
  for (int i = 0; i < found.size(); ++i) distances.push_back(distanceToLines(scene, found.points_px.col(i)));
  return median(distances);
}

double distanceTo(const Centerline2d& found, const Eigen::Vector2d& p) {
  return found.size() == 0 ? 1e9 : (found.points_px.colwise() - p).colwise().norm().minCoeff();
}

double coverage(const Scene& scene, const Centerline2d& found, double reach_px) {
  int covered = 0, total = 0;
  for (const auto& vessel : scene.vessels) {
    for (const auto& tube : vessel) {
      for (const auto& p : tube.line) {
        covered += distanceTo(found, p) <= reach_px ? 1 : 0;
        ++total;
      }
    }
  }
  return static_cast<double>(covered) / total;
}

double precision(const Scene& scene, const Centerline2d& found, double reach_px) {
  int right = 0;
  for (int i = 0; i < found.size(); ++i) {
    right += distanceToLines(scene, found.points_px.col(i)) <= reach_px ? 1 : 0;
  }
  return static_cast<double>(right) / std::max(1, found.size());
}

std::size_t branches(const Centerline2d& found) {
  return std::set<int>(found.branch.begin(), found.branch.end()).size();
}

Scene clinicalScene(std::vector<Vessel> vessels) {
  Scene scene;
  scene.width_px = scene.height_px = 1024;
  scene.vessels = std::move(vessels);
  return scene;
}

}  // namespace angio::test
