// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "hand_eye_problem.hpp"

namespace angio::calibration {
namespace {

constexpr std::size_t kDrawn = 4;  // One more than is needed: three poses make poor starts.
constexpr double kTrimmed = 0.45;  // Of two machines' poses in one file, half are one's.

// Agreement of the poses that agree best: rotations as they are, translations over the camera's distance.
double score(const HandEyeEquations& e, const HandEyeTransforms& t, const std::vector<std::size_t>& indices,
             double lever_m) {
  std::vector<double> squares;
  for (const std::size_t i : indices) {
    const Pose Z = e.hands[i] * t.X * e.cameras[i];
    squares.push_back(std::pow(rotationAngle(t.Z.linear().transpose() * Z.linear()), 2) +
                      (Z.translation() - t.Z.translation()).squaredNorm() / (lever_m * lever_m));
  }
  const std::size_t kept =
      std::max<std::size_t>(std::min<std::size_t>(3, squares.size()),
                            static_cast<std::size_t>(std::ceil(kTrimmed * static_cast<double>(squares.size()))));
  std::partial_sort(squares.begin(), squares.begin() + static_cast<std::ptrdiff_t>(kept), squares.end());
  return std::accumulate(squares.begin(), squares.begin() + static_cast<std::ptrdiff_t>(kept), 0.0);
}

HandEyeTransforms fromOnePose(const HandEyeEquations& e, std::size_t i) {
  return {Pose::Identity(), e.hands[i] * e.cameras[i]};
}

}  // namespace

HandEyeTransforms robustStart(const HandEyeProblem& problem, const PoseChoice& chosen,
                              const HandEyeSettings& settings) {
  const HandEyeEquations& e = problem.equations();
  std::vector<std::size_t> indices;
  double squares = 0;
  for (std::size_t i = 0; i < e.size(); ++i) {
    if (!chosen[i]) continue;
    indices.push_back(i);
    squares += e.cameras[i].translation().squaredNorm();
  }
  const double lever_m = std::sqrt(squares / static_cast<double>(indices.size()));
  HandEyeTransforms best;
  double least = std::numeric_limits<double>::infinity();
  const auto consider = [&](const HandEyeTransforms& t) {
    const double here = score(e, t, indices, lever_m);
    if (!(here < least)) return;
    least = here;
    best = t;
  };
  if (problem.mount() == HandEyeMount::kIdentity) {
    for (const std::size_t i : indices) consider(fromOnePose(e, i));
    return best;
  }
  const auto solveOver = [&](const std::vector<std::size_t>& some) {
    HandEyeEquations few;
    for (const std::size_t i : some) few.add(e.hands[i], e.cameras[i]);
    consider(solveParkMartin(few));
    consider(solveShah(few));
  };
  solveOver(indices);
  if (indices.size() <= kDrawn) return best;
  std::mt19937 engine(static_cast<unsigned>(settings.seed));
  std::vector<std::size_t> shuffled = indices;
  for (int draw = 0; draw < settings.starts; ++draw) {
    for (std::size_t k = 0; k < kDrawn; ++k) {
      // std::uniform_int_distribution is not the same on every machine; the bias of a remainder is of no account here.
      std::swap(shuffled[k], shuffled[k + engine() % (shuffled.size() - k)]);
    }
    solveOver({shuffled.begin(), shuffled.begin() + kDrawn});
  }
  return best;
}

}  // namespace angio::calibration
