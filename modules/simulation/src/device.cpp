// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/device.hpp"

#include <algorithm>
#include <numeric>

#include "angio/base/errors.hpp"

namespace angio::simulation {

void Device::check() const {
  const std::string place = "device";
  if (points.cols() < 2) throw InputError(place, "points", std::to_string(points.cols()), "must be at least two");
  if (!points.allFinite()) throw InputError(place, "points", "", "must be finite");
  requirePositive(place, "diameter_m", diameter_m);
  for (const auto& [field, value] : {std::pair<const char*, double>{"attenuation_per_m", attenuation_per_m},
                                     {"marker_length_m", marker_length_m},
                                     {"marker_attenuation_per_m", marker_attenuation_per_m}}) {
    requireBetween(place, field, value, 0, 1e6);
  }
}

std::vector<int> pathFromRoot(const VesselTree& tree, int point) {
  if (point < 0 || point >= tree.size()) {
    throw InputError("vessel tree", "point", std::to_string(point),
                     "must be one of the tree's " + std::to_string(tree.size()));
  }
  std::vector<int> path;
  for (int at = point; at >= 0; at = tree.parents()[at]) path.push_back(at);
  std::reverse(path.begin(), path.end());
  return path;
}

std::vector<int> endsByDistance(const VesselTree& tree) {
  std::vector<int> ends;
  std::vector<double> length;
  for (int i = 0; i < tree.size(); ++i) {
    if (!tree.children()[i].empty() || tree.parents()[i] < 0) continue;
    const std::vector<int> path = pathFromRoot(tree, i);
    double sum = 0;
    for (std::size_t k = 1; k < path.size(); ++k) {
      sum += (tree.points().col(path[k]) - tree.points().col(path[k - 1])).norm();
    }
    ends.push_back(i);
    length.push_back(sum);
  }
  std::vector<int> order(ends.size()), result;
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return length[a] > length[b]; });
  for (const int i : order) result.push_back(ends[i]);
  return result;
}

Eigen::Matrix3Xd alongPath(const Eigen::Matrix3Xd& points, const std::vector<int>& path, double length_m) {
  Eigen::Matrix3Xd line(3, path.size());
  Eigen::Index count = 0;
  double left = length_m;
  for (std::size_t k = 0; k < path.size(); ++k) {
    const Eigen::Vector3d p = points.col(path[k]);
    if (k > 0) {
      const Eigen::Vector3d last = line.col(count - 1);
      const double step = (p - last).norm();
      if (step >= left) {
        line.col(count++) = step > 0 ? Eigen::Vector3d(last + left / step * (p - last)) : p;
        break;
      }
      left -= step;
    }
    line.col(count++) = p;
  }
  return line.leftCols(count);
}

std::vector<Device> deviceInTree(const DeviceSettings& settings, const Eigen::Matrix3Xd& points,
                                 const std::vector<int>& path, double inserted_m) {
  if (settings.kind == DeviceKind::kNone || inserted_m <= 0) return {};
  Device device;
  device.points = alongPath(points, path, inserted_m);
  if (settings.kind == DeviceKind::kCatheter) {
    device.diameter_m = 1.67e-3 * settings.diameter_factor;
    device.attenuation_per_m = 160 * settings.opacity_factor;
  } else {
    device.diameter_m = 0.36e-3 * settings.diameter_factor;
    device.attenuation_per_m = 950 * settings.opacity_factor;
    device.marker_length_m = 20e-3;
    device.marker_attenuation_per_m = 4000 * settings.opacity_factor;  // A coil is half air and saline.
  }
  return {device};
}

}  // namespace angio::simulation
