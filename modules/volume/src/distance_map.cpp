// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/distance_map.hpp"

#include <cmath>
#include <limits>

namespace angio::volume {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

// One line of squared distances after another, each as the lower envelope of parabolas.
class LineTransform {
 public:
  LineTransform(int size, double spacing) : spacing2_(spacing * spacing), line_(static_cast<std::size_t>(size)) {
    at_.resize(line_.size());
    from_.resize(line_.size() + 1);
  }

  void run(float* values, std::size_t stride) {
    const int n = static_cast<int>(line_.size());
    int parabolas = 0;
    for (int q = 0; q < n; ++q) {
      line_[static_cast<std::size_t>(q)] = values[static_cast<std::size_t>(q) * stride];
      if (line_[static_cast<std::size_t>(q)] == kFar) continue;
      double s = -std::numeric_limits<double>::infinity();
      while (parabolas > 0) {
        s = crossing(at_[static_cast<std::size_t>(parabolas - 1)], q);
        if (s > from_[static_cast<std::size_t>(parabolas - 1)]) break;
        --parabolas;
      }
      if (parabolas == 0) s = -std::numeric_limits<double>::infinity();
      at_[static_cast<std::size_t>(parabolas)] = q;
      from_[static_cast<std::size_t>(parabolas)] = s;
      ++parabolas;
    }
    if (parabolas == 0) return;
    from_[static_cast<std::size_t>(parabolas)] = std::numeric_limits<double>::infinity();
    for (int q = 0, k = 0; q < n; ++q) {
      while (from_[static_cast<std::size_t>(k) + 1] < q) ++k;
      const int center = at_[static_cast<std::size_t>(k)];
      const double d = q - center;
      values[static_cast<std::size_t>(q) * stride] =
          static_cast<float>(spacing2_ * d * d + line_[static_cast<std::size_t>(center)]);
    }
  }

 private:
  // Where the parabola of q begins to lie below the one of p < q.
  double crossing(int p, int q) const {
    const double fp = line_[static_cast<std::size_t>(p)] / spacing2_,
                 fq = line_[static_cast<std::size_t>(q)] / spacing2_;
    return (fq + static_cast<double>(q) * q - fp - static_cast<double>(p) * p) / (2.0 * (q - p));
  }

  double spacing2_;
  std::vector<double> line_;
  std::vector<int> at_;
  std::vector<double> from_;
};

}  // namespace

std::vector<float> distanceMap(const VoxelMask& mask, std::uint8_t target) {
  const VoxelGrid& grid = mask.grid;
  std::vector<float> squares(grid.count());
  for (std::size_t i = 0; i < squares.size(); ++i) squares[i] = mask.inside[i] == target ? 0.0F : kFar;
  const auto nx = static_cast<std::size_t>(grid.size.x()), ny = static_cast<std::size_t>(grid.size.y()),
             nz = static_cast<std::size_t>(grid.size.z());
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

}  // namespace angio::volume
