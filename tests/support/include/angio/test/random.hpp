// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <random>

#include "angio/geometry/se3.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {

/// Random vectors and poses, the same on every machine for one seed: std::normal_distribution is not, so this draws its
/// own.
class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_()) / 4294967296.0);
  }
  double normal() {
    const double u = 1 - uniform(0, 1), v = uniform(0, 1);
    return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
  }
  Eigen::Vector3d vector(double scale) {
    // Named, as the order in which arguments are evaluated is the compiler's.
    const double z = normal(), y = normal(), x = normal();
    return Eigen::Vector3d(x, y, z) * scale;
  }
  Eigen::Vector3d direction() { return vector(1).normalized(); }
  Twist twist(double translation, double rotation) {
    Twist xi;
    xi << vector(translation), vector(rotation);
    return xi;
  }

 private:
  std::mt19937 engine_;
};

}  // namespace angio::test
