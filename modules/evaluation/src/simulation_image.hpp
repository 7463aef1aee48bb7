// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "angio/base/shuffled.hpp"
#include "angio/evaluation/simulation.hpp"

namespace angio::evaluation {

/// What a draw is for: each purpose has numbers of its own, so that one setting does not shift another's draws.
enum class DrawFor {
  kView,
  kWindow,
  kMissing,
  kSpurious,
  kNoise,
  kTangents,
  kDeformation,
  kCalibration,
  kStart,
  kFilled,
  kDevice,
  kCatheter,
};

/// Random numbers that are the same with every compiler and library: the standard fixes its engines and seed_seq, but
/// not its distributions.
class SimulationRandom {
 public:
  SimulationRandom(int seed, int trial, DrawFor purpose, int view = 0) {
    std::seed_seq sequence{seed, trial, static_cast<int>(purpose), view};
    engine_.seed(sequence);
  }

  /// In [0, 1).
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }

  /// Standard normal, Box-Muller.
  double normal() {
    const double u = (static_cast<double>(engine_() >> 11) + 1) * 0x1p-53;
    const double v = uniform();
    return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
  }

  template <int N>
  Eigen::Matrix<double, N, 1> normals() {
    Eigen::Matrix<double, N, 1> result;
    for (int k = 0; k < N; ++k) result[k] = normal();
    return result;
  }

  /// A unit vector, uniform.
  template <int N>
  Eigen::Matrix<double, N, 1> direction() {
    return normals<N>().normalized();
  }

  /// 0 to n - 1 in random order.
  std::vector<int> order(int n) {
    return shuffled(n, [this] { return uniform(); });
  }

 private:
  std::mt19937_64 engine_;
};

/// What one view of a trial shows, and the camera that shows just that field.
struct SimulatedView {
  XrayCamera camera;
  Centerline2d centerline;
  std::vector<Curve> spurious_px;  ///< Those of its curves that are no vessel.
};

/// One view of a tree.
///
/// @param branches_px  The whole tree's branches on the detector's plane, finely sampled, also what the detector does
///                     not see.
/// @param shown        Which of them contrast agent fills.
/// @param trial, view  Numbers that choose the draws.
SimulatedView simulatedView(const std::vector<Curve>& branches_px, const std::vector<bool>& shown,
                            const XrayCamera& camera, const SimulationSettings& settings, int trial, int view);

}  // namespace angio::evaluation
