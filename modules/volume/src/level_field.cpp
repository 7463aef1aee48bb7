// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/level_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "angio/base/errors.hpp"

namespace angio::volume {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

// One line of squared distances after another, each as the lower envelope of parabolas.
class LineTransform {
 public:
  LineTransform(int size, double spacing)
      : spacing2_(spacing * spacing), line_(size), at_(line_.size()), from_(line_.size() + 1) {}

  void run(float* values, std::size_t stride) {
    const int n = static_cast<int>(line_.size());
    int parabolas = 0;
    for (int q = 0; q < n; ++q) {
      line_[q] = values[q * stride];
      if (line_[q] == kFar) continue;
      double s = -std::numeric_limits<double>::infinity();
      while (parabolas > 0) {
        s = crossing(at_[parabolas - 1], q);
        if (s > from_[parabolas - 1]) break;
        --parabolas;
      }
      if (parabolas == 0) s = -std::numeric_limits<double>::infinity();
      at_[parabolas] = q;
      from_[parabolas] = s;
      ++parabolas;
    }
    if (parabolas == 0) return;
    from_[parabolas] = std::numeric_limits<double>::infinity();
    for (int q = 0, k = 0; q < n; ++q) {
      while (from_[k + 1] < q) ++k;
      const int center = at_[k];
      const double d = q - center;
      values[q * stride] = static_cast<float>(spacing2_ * d * d + line_[center]);
    }
  }

 private:
  // Where the parabola of q begins to lie below the one of p < q.
  double crossing(int p, int q) const {
    const double fp = line_[p] / spacing2_, fq = line_[q] / spacing2_;
    return (fq + static_cast<double>(q) * q - fp - static_cast<double>(p) * p) / (2.0 * (q - p));
  }

  double spacing2_;
  std::vector<double> line_;
  std::vector<int> at_;
  std::vector<double> from_;
};

constexpr double kOutside = -1;
constexpr std::size_t kMaxEqualVoxels = std::size_t{1} << 27;

// Neighbours of positions along one axis, and how much of the second one counts.
struct Between {
  std::vector<int> first;
  std::vector<float> share;
};

Between betweens(int size, int from_size, double ratio) {
  Between result;
  for (int i = 0; i < size; ++i) {
    const double at = std::min(i * ratio, from_size - 1.0);
    const int first = std::min(static_cast<int>(at), std::max(from_size - 2, 0));
    result.first.push_back(first);
    result.share.push_back(static_cast<float>(at - first));
  }
  return result;
}

// Linear interpolation along one axis.
Volume stretched(const Volume& from, int axis, double spacing_m) {
  Volume to;
  to.grid = from.grid;
  const double ratio = spacing_m / from.grid.spacing_m[axis];
  to.grid.size[axis] = static_cast<int>(std::ceil((from.grid.size[axis] - 1) / ratio - 1e-9)) + 1;
  to.grid.spacing_m[axis] = spacing_m;
  if (to.grid.count() > kMaxEqualVoxels) {
    throw InputError(
        "volume", "voxel_mm", formatValue(spacing_m * 1e3),
        "would make more than " + std::to_string(kMaxEqualVoxels) + " voxels of the vessels' box: choose larger ones");
  }
  to.values.resize(to.grid.count());
  const Between between = betweens(to.grid.size[axis], from.grid.size[axis], ratio);
  const std::size_t second = from.grid.size[axis] > 1 ? from.grid.offset(Eigen::Vector3i::Unit(axis)) : 0;
  forEachVoxel(to.grid.size, [&](const Eigen::Vector3i& v, std::size_t out) {
    Eigen::Vector3i u = v;
    u[axis] = between.first[v[axis]];
    const float* const a = &from.values[from.grid.offset(u)];
    to.values[out] = a[0] + between.share[v[axis]] * (a[second] - a[0]);
  });
  return to;
}

}  // namespace

std::vector<float> distanceMap(const VoxelMask& mask, std::uint8_t target) {
  const VoxelGrid& grid = mask.grid;
  std::vector<float> squares(grid.count());
  for (std::size_t i = 0; i < squares.size(); ++i) squares[i] = mask.inside[i] == target ? 0.0F : kFar;
  const std::size_t nx = grid.size.x(), ny = grid.size.y(), nz = grid.size.z();
  LineTransform along_x(grid.size.x(), grid.spacing_m.x());
  for (std::size_t row = 0; row < ny * nz; ++row) along_x.run(&squares[row * nx], 1);
  LineTransform along_y(grid.size.y(), grid.spacing_m.y());
  for (std::size_t z = 0; z < nz; ++z) {
    for (std::size_t x = 0; x < nx; ++x) along_y.run(&squares[z * nx * ny + x], nx);
  }
  LineTransform along_z(grid.size.z(), grid.spacing_m.z());
  for (std::size_t column = 0; column < nx * ny; ++column) along_z.run(&squares[column], nx * ny);
  for (float& value : squares) value = std::sqrt(value);
  return squares;
}

Volume signedDistance(const VoxelMask& mask) {
  Volume level{mask.grid, distanceMap(mask, 0)};
  const std::vector<float> outside = distanceMap(mask, 1);
  for (std::size_t i = 0; i < outside.size(); ++i) level.values[i] -= outside[i];
  return level;
}

Volume isotropic(const Volume& volume, double spacing_m) {
  // The axis that gains least first, so that the steps in between are small.
  int axes[3] = {0, 1, 2};
  std::sort(axes, axes + 3, [&](int a, int b) { return volume.grid.spacing_m[a] < volume.grid.spacing_m[b]; });
  Volume result = volume;
  for (const int axis : axes) {
    if (std::abs(result.grid.spacing_m[axis] / spacing_m - 1) > 1e-6) result = stretched(result, axis, spacing_m);
  }
  return result;
}

double LevelField::at(const Eigen::Vector3d& index) const {
  const Eigen::Vector3i& size = level_.grid.size;
  if (!((index.array() >= 0).all() && (index.array() <= size.cast<double>().array() - 1).all())) return kOutside;
  const Eigen::Vector3i v = index.cast<int>().cwiseMin((size.array() - 2).matrix()).cwiseMax(0);
  const Eigen::Vector3d t = index - v.cast<double>();
  const auto step = [&](int axis) { return size[axis] > 1 ? level_.grid.offset(Eigen::Vector3i::Unit(axis)) : 0; };
  const std::size_t dx = step(0), dy = step(1), dz = step(2);
  const float* const a = &level_.values[level_.grid.offset(v)];
  const auto row = [&](const float* p) { return p[0] + t.x() * (p[dx] - p[0]); };
  const auto layer = [&](const float* p) { return row(p) + t.y() * (row(p + dy) - row(p)); };
  return layer(a) + t.z() * (layer(a + dz) - layer(a));
}

double LevelField::wallDistance(const Eigen::Vector3d& index, const Eigen::Vector3d& direction, double farthest) const {
  constexpr double kStep = 0.5;  // No vessel's wall is crossed twice in half a voxel.
  double before = at(index);
  if (before <= 0) return 0;
  for (double s = kStep; s < farthest + kStep; s += kStep) {
    const double here = at(index + s * direction);
    if (here <= 0) return std::min(farthest, s - kStep * (here / (here - before)));
    before = here;
  }
  return farthest;
}

Eigen::Matrix3Xd LevelField::wallPoints() const {
  std::vector<Eigen::Vector3d> points;
  forEachVoxel(level_.grid.size, [&](const Eigen::Vector3i& v, std::size_t at) {
    const double here = level_.values[at];
    if (!(here > 0)) return;
    for (int k = 0; k < 6; ++k) {
      Eigen::Vector3i u = v;
      u[k / 2] += k % 2 ? 1 : -1;
      const double there = level_.grid.holds(u) ? level_.values[level_.grid.offset(u)] : -here;
      if (there <= 0) points.push_back(v.cast<double>() + here / (here - there) * (u - v).cast<double>());
    }
  });
  return Eigen::Map<const Eigen::Matrix3Xd>(points.empty() ? nullptr : points[0].data(), 3, points.size());
}

}  // namespace angio::volume
