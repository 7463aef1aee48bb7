// SPDX-License-Identifier: GPL-2.0-or-later
#include "background.hpp"

#include <algorithm>
#include <cmath>

#include "uniform.hpp"

namespace angio::simulation {
namespace {

constexpr double kBodyRadius = 0.15;  // [m] Clouds fill a ball of this size, a little more than a detector sees.

// exp(-d^2 / 2 sigma^2) at grid nodes first..last, d from `centre` [px].
void bump(double center, double sigma, int first, int last, std::vector<float>& values) {
  for (int i = first; i <= last; ++i) {
    const double d = (i * Background::kCell - center) / sigma;
    values[i] = static_cast<float>(std::exp(-0.5 * d * d));
  }
}

}  // namespace

Background::Background(const Eigen::Vector3d& center_model, double strength, double structure_m, std::uint64_t seed) {
  Uniform uniform(seed);
  struct Level {
    int count;
    double size, share;  // Relative to the largest structure; share of the standard deviation.
  };
  for (const Level level : {Level{100, 0.5, 0.85}, Level{300, 0.2, 0.45}, Level{600, 0.1, 0.2}}) {
    for (int i = 0; i < level.count; ++i) {
      Eigen::Vector3d p;
      do {
        p = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
      } while (p.squaredNorm() > 1);
      const double sigma = structure_m * level.size * uniform(0.6, 1.4);
      // Bumps of random sign, n on a disc of radius R: variance = n / (pi R^2) * peak^2 pi sigma^2. Uniform in (-a, a)
      // has the variance a^2 / 3.
      const double a = std::sqrt(3.0) * strength * level.share * kBodyRadius / (sigma * std::sqrt(level.count));
      clouds_.push_back({center_model + kBodyRadius * p, sigma, uniform(-a, a)});
    }
  }
}

void Background::addCloud(const Cloud& cloud, const XrayCamera& camera, const Pose& T_camera_model) {
  const Eigen::Vector3d center = T_camera_model * cloud.center;
  if (center.z() < 4 * cloud.std_m) return;  // Around the source there is no patient.
  const auto& K = camera.parameters();
  const Eigen::Vector2d seen = *camera.project(center);
  const int columns = nodesAcross(K.width_px), rows = nodesAcross(K.height_px);
  const auto span = [](double middle, double sigma, int count) {
    const double low = (middle - 3 * sigma) / kCell, high = (middle + 3 * sigma) / kCell;
    return std::pair<int, int>(static_cast<int>(std::ceil(std::clamp(low, 0.0, static_cast<double>(count)))),
                               static_cast<int>(std::floor(std::clamp(high, -1.0, count - 1.0))));
  };
  const double std_x = K.fx_px * cloud.std_m / center.z(), std_y = K.fy_px * cloud.std_m / center.z();
  const auto [left, right] = span(seen.x(), std_x, columns);
  const auto [top, bottom] = span(seen.y(), std_y, rows);
  bump(seen.x(), std_x, left, right, across_);
  bump(seen.y(), std_y, top, bottom, down_);
  for (int j = top; j <= bottom; ++j) {
    const float height = static_cast<float>(cloud.peak) * down_[j];
    float* row = grid_.data() + static_cast<std::size_t>(j) * columns;
    for (int i = left; i <= right; ++i) row[i] += height * across_[i];
  }
}

const std::vector<float>& Background::logAttenuation(const XrayCamera& camera, const Pose& T_camera_model) {
  const int columns = nodesAcross(camera.width_px()), rows = nodesAcross(camera.height_px());
  grid_.assign(static_cast<std::size_t>(columns) * rows, 0.0F);
  across_.resize(columns);
  down_.resize(rows);
  for (const Cloud& cloud : clouds_) addCloud(cloud, camera, T_camera_model);
  return grid_;
}

}  // namespace angio::simulation
