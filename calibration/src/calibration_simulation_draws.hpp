// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include "angio/calibration/calibration_simulation.hpp"

namespace angio::calibration {

/// Draws that are the same on every machine for one seed: the standard's distributions are not.
class Draws {
 public:
  explicit Draws(std::uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  double normal() {
    const double u = 1 - uniform(0, 1), v = uniform(0, 1);
    return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
  }
  Eigen::Vector3d vector(double std) {
    const double x = normal(), y = normal(), z = normal();  // Named: the compiler may take arguments in any order.
    return std * Eigen::Vector3d(x, y, z);
  }
  Twist twist(double translation_std_m, double rotation_std_rad) {
    Twist xi;
    xi.head<3>() = vector(translation_std_m);
    xi.tail<3>() = vector(rotation_std_rad);
    return xi;
  }
  int below(int count) { return static_cast<int>(uniform(0, count)); }

 private:
  std::mt19937_64 engine_;
};

/// Another machine of another make with the same patient and phantom: what must not be mixed with the first.
SimulatedDevice otherMachine(const SimulatedDevice& machine, const CalibrationSimulationSettings& settings);

}  // namespace angio::calibration
