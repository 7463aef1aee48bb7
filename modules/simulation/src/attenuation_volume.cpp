// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/attenuation_volume.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "volume_rays.hpp"

namespace angio::simulation {

void AttenuationVolume::check() const {
  const std::string place = "attenuation volume";
  std::size_t voxels = 1;
  for (int k = 0; k < 3; ++k) {
    requireBetween(place, "size[" + std::to_string(k) + "]", size[k], 2, 4096);
    requirePositive(place, "spacing_m[" + std::to_string(k) + "]", spacing_m[k]);
    voxels *= static_cast<std::size_t>(size[k]);
  }
  if (attenuation_per_m.size() != voxels) {
    throw InputError(place, "attenuation_per_m", std::to_string(attenuation_per_m.size()) + " values",
                     "must be one for each of " + std::to_string(voxels) + " voxels");
  }
  for (const float value : attenuation_per_m) requireBetween(place, "attenuation_per_m", value, -1e5, 1e5);
  if (!T_model_volume.matrix().allFinite() || !(rotationDefect(T_model_volume.linear()) < 1e-6)) {
    throw InputError(place, "T_model_volume", "", "must be a finite rigid transform");
  }
}

float attenuationOfHounsfield(float hu) {
  constexpr float kWaterAttenuation_per_m = 20.6F, kBoneFactor = 1.6F;
  return kWaterAttenuation_per_m * (1 + std::max(hu, -1000.0F) / 1000 * (hu > 0 ? kBoneFactor : 1.0F));
}

VolumeRays::VolumeRays(const AttenuationVolume& volume, const Pose& T_camera_model) : volume_(&volume) {
  const Pose T_volume_camera = (T_camera_model * volume.T_model_volume).inverse();
  M_ = volume.spacing_m.cwiseInverse().asDiagonal() * T_volume_camera.linear();
  origin_ = volume.spacing_m.cwiseInverse().cwiseProduct(T_volume_camera.translation());
}

float VolumeRays::logAttenuation(double dx, double dy) const {
  const Eigen::Vector3d d = M_ * Eigen::Vector3d(dx, dy, 1);
  double in = 0, out = 1e9;  // Depths at which the ray is within the outer voxels' centres.
  for (int k = 0; k < 3; ++k) {
    const double a = -origin_[k] / d[k], b = (volume_->size[k] - 1 - origin_[k]) / d[k];
    if (std::isnan(a) || std::isnan(b)) return 0;
    in = std::max(in, std::min(a, b));
    out = std::min(out, std::max(a, b));
  }
  if (!(out > in)) return 0;
  const int steps = std::max(1, static_cast<int>(std::ceil((out - in) * d.cwiseAbs().maxCoeff())));
  const double step = (out - in) / steps;
  double sum = 0;
  for (int i = 0; i < steps; ++i) sum += at(origin_ + (in + (i + 0.5) * step) * d);
  return static_cast<float>(sum * step * std::sqrt(dx * dx + dy * dy + 1));
}

float VolumeRays::at(const Eigen::Vector3d& p) const {
  const auto& n = volume_->size;
  const auto cell = [](double x, int size) { return std::clamp(static_cast<int>(x), 0, size - 2); };
  const int i = cell(p.x(), n[0]), j = cell(p.y(), n[1]), k = cell(p.z(), n[2]);
  const float u = static_cast<float>(p.x() - i), v = static_cast<float>(p.y() - j), w = static_cast<float>(p.z() - k);
  const std::size_t row = n[0], slice = row * n[1];
  const float* c = volume_->attenuation_per_m.data() + i + j * row + k * slice;
  const auto line = [u](const float* at) { return at[0] + u * (at[1] - at[0]); };
  const float low = line(c) + v * (line(c + row) - line(c));
  const float high = line(c + slice) + v * (line(c + slice + row) - line(c + slice));
  return low + w * (high - low);
}

}  // namespace angio::simulation
