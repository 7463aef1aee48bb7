// SPDX-License-Identifier: GPL-2.0-or-later
#include "hand_eye_estimate.hpp"

#include <algorithm>
#include <cmath>

namespace angio::calibration {
namespace {

constexpr double kQuantile = 0.4;            // Below half, so that half of the poses may be another machine's.
constexpr double kChi3AtQuantile = 1.36669;  // Of the length of three standard normal numbers.
constexpr double kChi6SquaredAtQuantile = 4.57;
constexpr int kRobustRounds = 5, kGateRounds = 10;
constexpr double kFirstGate = 1.5;  // The first noise is of few poses.

double quantile(std::vector<double> values) {
  const auto at = static_cast<std::ptrdiff_t>(kQuantile * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

}  // namespace

std::size_t count(const PoseChoice& chosen) {
  return static_cast<std::size_t>(std::count(chosen.begin(), chosen.end(), true));
}

HandEyeEstimate::HandEyeEstimate(const HandEyeProblem& problem, const HandEyeSettings& settings,
                                 const PoseChoice& among)
    : used(among), problem_(problem), settings_(settings), among_(among) {
  transforms = robustStart(problem, among, settings);
  for (int round = 0; round < kRobustRounds; ++round) {
    measureRobustly();
    transforms = problem_.solved(transforms, among_, covariances, HandEyeProblem::Loss::kRobust);
  }
  measureRobustly();
  for (int round = 0; round < kGateRounds; ++round) {
    const PoseChoice before = used;
    gate(round == 0 ? kFirstGate : 1);
    if (round > 1 && before == used) break;
    if (count(used) < minPoses()) break;
    if (!problem_.noiseGiven()) measure();
    transforms = problem_.solved(transforms, used, covariances, HandEyeProblem::Loss::kSquares);
    if (!problem_.noiseGiven()) measure();
    covariances = problem_.covariances(transforms, noise);
    inflation_ = std::max(1.0, chi2PerFreedom());
  }
}

double HandEyeEstimate::chi2PerFreedom() const {
  double chi2 = 0;
  for (std::size_t i = 0; i < problem_.size(); ++i) {
    if (used[i]) chi2 += squaredDistance(problem_.residual(i, transforms), covariances[i]);
  }
  return chi2 / freedom(6);
}

double HandEyeEstimate::freedom(double per_pose) const {
  return std::max(1.0, per_pose * static_cast<double>(count(used)) - parameters() * per_pose / 6);
}

double HandEyeEstimate::sigmas(std::size_t i) const {
  return std::sqrt(squaredDistance(problem_.residual(i, transforms), covariances[i]));
}

// Noise from those residuals that are smallest, whatever the others are.
void HandEyeEstimate::measureRobustly() {
  std::vector<double> turns, shifts, squares;
  if (!problem_.noiseGiven()) {
    for (std::size_t i = 0; i < problem_.size(); ++i) {
      if (!among_[i]) continue;
      const Vector6d r = problem_.residual(i, transforms);
      shifts.push_back(r.head<3>().norm());
      turns.push_back(r.tail<3>().norm());
    }
    noise = {quantile(turns) / kChi3AtQuantile, quantile(shifts) / kChi3AtQuantile};
  }
  covariances = problem_.covariances(transforms, noise);
  for (std::size_t i = 0; i < problem_.size(); ++i) {
    if (among_[i]) squares.push_back(squaredDistance(problem_.residual(i, transforms), covariances[i]));
  }
  inflation_ = std::max(1.0, quantile(squares) / kChi6SquaredAtQuantile);
}

// Noise from all residuals that are used. What is known of it already is in the poses' covariances and taken off.
void HandEyeEstimate::measure() {
  const std::vector<Matrix6d> known = problem_.covariances(transforms, {});
  double turns = 0, shifts = 0, known_turns = 0, known_shifts = 0;
  for (std::size_t i = 0; i < problem_.size(); ++i) {
    if (!used[i]) continue;
    const Vector6d r = problem_.residual(i, transforms);
    shifts += r.head<3>().squaredNorm();
    turns += r.tail<3>().squaredNorm();
    known_shifts += known[i].topLeftCorner<3, 3>().trace();
    known_turns += known[i].bottomRightCorner<3, 3>().trace();
  }
  const double numbers = 3 * static_cast<double>(count(used));
  noise.rotation_rad = std::sqrt(std::max(0.0, turns / freedom(3) - known_turns / numbers));
  noise.translation_m = std::sqrt(std::max(0.0, shifts / freedom(3) - known_shifts / numbers));
  covariances = problem_.covariances(transforms, noise);
}

void HandEyeEstimate::gate(double factor) {
  for (std::size_t i = 0; i < problem_.size(); ++i) {
    used[i] = among_[i] && sigmas(i) < factor * settings_.outlier_gate * std::sqrt(inflation_);
  }
}

}  // namespace angio::calibration
