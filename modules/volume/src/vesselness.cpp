// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>

#include "angio/volume/shape.hpp"

namespace angio::volume {
namespace {

// Gaussian along one axis; the border's values go on outside.
void blur(const VoxelGrid& grid, int axis, double std_voxels, std::vector<float>& values) {
  const int reach = std::max(1, static_cast<int>(std::ceil(3 * std_voxels)));
  std::vector<float> weights(reach + 1);
  float sum = 0;
  for (int i = 0; i <= reach; ++i) {
    const auto weight = static_cast<float>(std::exp(-0.5 * i * i / (std_voxels * std_voxels)));
    weights[i] = weight;
    sum += i == 0 ? weight : 2 * weight;
  }
  for (float& weight : weights) weight /= sum;
  const std::size_t n = grid.size[axis], r = reach, step = grid.offset(Eigen::Vector3i::Unit(axis));
  std::vector<float> line(n + 2 * r);
  for (std::size_t block = 0; block < values.size(); block += n * step) {
    for (std::size_t first = block; first < block + step; ++first) {
      for (std::size_t i = 0; i < n; ++i) line[r + i] = values[first + i * step];
      std::fill_n(line.begin(), r, line[r]);
      std::fill_n(line.begin() + r + n, r, line[r + n - 1]);
      for (std::size_t i = 0; i < n; ++i) {
        float value = weights[0] * line[r + i];
        for (std::size_t k = 1; k <= r; ++k) value += weights[k] * (line[r + i - k] + line[r + i + k]);
        values[first + i * step] = value;
      }
    }
  }
}

struct Curvatures {
  float second = 0, third = 0;  // Of minus the image, by size: both large and positive in a bright tube.
};

// Eigenvalues of a symmetric matrix by the cosine formula; those of the second and third size, negated.
Curvatures curvaturesOf(double xx, double xy, double xz, double yy, double yz, double zz) {
  const double q = (xx + yy + zz) / 3, p1 = xy * xy + xz * xz + yz * yz;
  const double a = xx - q, b = yy - q, c = zz - q;
  const double p = std::sqrt((a * a + b * b + c * c + 2 * p1) / 6);
  if (p < 1e-30) return {static_cast<float>(-q), static_cast<float>(-q)};
  const double half_det = (a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)) / (2 * p * p * p);
  const double angle = std::acos(std::clamp(half_det, -1.0, 1.0)) / 3;
  double e[3];
  e[0] = q + 2 * p * std::cos(angle);
  e[2] = q + 2 * p * std::cos(angle + 2.0943951023931957);
  e[1] = 3 * q - e[0] - e[2];
  std::sort(e, e + 3, [](double l, double r) { return std::abs(l) < std::abs(r); });
  return {static_cast<float>(-e[1]), static_cast<float>(-e[2])};
}

// Curvatures at one scale, normalised by it; voxels at the border have none.
std::vector<Curvatures> curvatures(const Volume& volume, double std_m) {
  const VoxelGrid& grid = volume.grid;
  std::vector<float> smooth = volume.values;
  for (int axis = 0; axis < 3; ++axis) blur(grid, axis, std_m / grid.spacing_m[axis], smooth);
  std::vector<Curvatures> result(smooth.size());
  const long dx = 1, dy = grid.size.x(), dz = dy * grid.size.y();
  const Eigen::Vector3d w = (std_m / grid.spacing_m.array()).matrix();
  for (int z = 1; z + 1 < grid.size.z(); ++z) {
    for (int y = 1; y + 1 < grid.size.y(); ++y) {
      for (int x = 1; x + 1 < grid.size.x(); ++x) {
        const std::size_t at = grid.offset({x, y, z});
        const float* const f = &smooth[at];
        const auto twice = [&](long d) { return f[d] - 2.0 * f[0] + f[-d]; };
        const auto mixed = [&](long a, long b) { return 0.25 * (f[a + b] - f[a - b] - f[b - a] + f[-a - b]); };
        result[at] =
            curvaturesOf(w.x() * w.x() * twice(dx), w.x() * w.y() * mixed(dx, dy), w.x() * w.z() * mixed(dx, dz),
                         w.y() * w.y() * twice(dy), w.y() * w.z() * mixed(dy, dz), w.z() * w.z() * twice(dz));
      }
    }
  }
  return result;
}

}  // namespace

std::vector<float> vesselness(const Volume& volume, const VesselnessSettings& settings) {
  checkSettings(VesselnessSettings::kName, settings);
  std::vector<float> best(volume.values.size(), 0.0F);
  const double ratio = settings.max_radius_mm / settings.min_radius_mm;
  for (int s = 0; s < settings.scales; ++s) {
    const double share = settings.scales > 1 ? static_cast<double>(s) / (settings.scales - 1) : 0;
    // A bar's response peaks where the Gaussian is as wide as its radius over sqrt(2), in two dimensions of three.
    const double std_m = settings.min_radius_mm * std::pow(ratio, share) / 1e3 / std::sqrt(2.0);
    const auto found = curvatures(volume, std_m);
    float strongest = 0;
    for (const Curvatures& c : found) strongest = std::max(strongest, c.third);
    const auto floor = static_cast<float>(settings.uniformity) * strongest;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const float second = found[i].second;
      if (!(second > 0 && found[i].third > 0)) continue;
      const float rho = std::max(found[i].third, floor);
      const float scaled = 3 / (second + rho);
      const float response = second >= rho / 2 ? 1 : second * second * (rho - second) * scaled * scaled * scaled;
      best[i] = std::max(best[i], response);
    }
  }
  return best;
}

}  // namespace angio::volume
