// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/hand_eye.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/joined.hpp"
#include "hand_eye_problem.hpp"

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
  return values[at];
}

std::size_t countOfPoses(const PoseChoice& chosen) {
  return static_cast<std::size_t>(std::count(chosen.begin(), chosen.end(), true));
}

// One estimate over a choice of the poses, from the robust start to the gate and the measured noise.
class HandEyeEstimate {
 public:
  HandEyeEstimate(const HandEyeProblem& problem, const HandEyeSettings& settings)
      : used(problem.size(), true), problem_(problem), settings_(settings) {
    transforms = robustStart(problem.equations(), problem.mount(), settings);
    const PoseChoice all = used;
    for (int round = 0; round < kRobustRounds; ++round) {
      measureRobustly();
      transforms = problem_.solved(transforms, all, covariances, HandEyeProblem::Loss::kRobust);
    }
    measureRobustly();
    for (int round = 0; round < kGateRounds; ++round) {
      const PoseChoice before = used;
      gate(round == 0 ? kFirstGate : 1);
      if (round > 1 && before == used) break;
      if (countOfPoses(used) < minPoses()) break;
      if (!problem_.noiseGiven()) measure();
      transforms = problem_.solved(transforms, used, covariances, HandEyeProblem::Loss::kSquares);
      if (!problem_.noiseGiven()) measure();
      covariances = problem_.covariances(transforms, noise);
      inflation_ = std::max(1.0, chi2PerFreedom());
    }
  }

  std::size_t minPoses() const { return problem_.mount() == HandEyeMount::kIdentity ? 1 : 3; }

  double chi2PerFreedom() const {
    double chi2 = 0;
    for (std::size_t i = 0; i < problem_.size(); ++i) {
      if (used[i]) chi2 += squaredDistance(problem_.residual(i, transforms), covariances[i]);
    }
    return chi2 / freedom(6);
  }

  // Degrees of freedom of so many numbers a pose.
  double freedom(double per_pose) const {
    const int parameters = problem_.mount() == HandEyeMount::kIdentity ? 6 : 12;
    return std::max(1.0, per_pose * static_cast<double>(countOfPoses(used)) - parameters * per_pose / 6);
  }

  // Distance of a pose from its prediction by its covariance.
  double sigmas(std::size_t i) const {
    return std::sqrt(squaredDistance(problem_.residual(i, transforms), covariances[i]));
  }

  HandEyeTransforms transforms;
  PoseSigma noise;  // Measured, beside what the poses' covariances say; zero when the set says all noise.
  std::vector<Matrix6d> covariances;
  PoseChoice used;  // No outliers.

 private:
  // Noise from those residuals that are smallest, whatever the others are.
  void measureRobustly() {
    std::vector<double> turns, shifts, squares;
    if (!problem_.noiseGiven()) {
      for (std::size_t i = 0; i < problem_.size(); ++i) {
        const Vector6d r = problem_.residual(i, transforms);
        shifts.push_back(r.head<3>().norm());
        turns.push_back(r.tail<3>().norm());
      }
      noise = {quantile(turns) / kChi3AtQuantile, quantile(shifts) / kChi3AtQuantile};
    }
    covariances = problem_.covariances(transforms, noise);
    for (std::size_t i = 0; i < problem_.size(); ++i) {
      squares.push_back(squaredDistance(problem_.residual(i, transforms), covariances[i]));
    }
    inflation_ = std::max(1.0, quantile(squares) / kChi6SquaredAtQuantile);
  }

  // Noise from all residuals that are used. What is known of it already is in the poses' covariances and taken off.
  void measure() {
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
    const double numbers = 3 * static_cast<double>(countOfPoses(used));
    noise.rotation_rad = std::sqrt(std::max(0.0, turns / freedom(3) - known_turns / numbers));
    noise.translation_m = std::sqrt(std::max(0.0, shifts / freedom(3) - known_shifts / numbers));
    covariances = problem_.covariances(transforms, noise);
  }

  void gate(double factor) {
    for (std::size_t i = 0; i < problem_.size(); ++i) {
      used[i] = sigmas(i) < factor * settings_.outlier_gate * std::sqrt(inflation_);
    }
  }

  const HandEyeProblem& problem_;
  const HandEyeSettings& settings_;
  double inflation_ = 1;  // Of chi^2, where the noise is larger than it is said to be.
};

constexpr std::size_t kMinOther = 4;  // Poses that make a second transform believable,
constexpr double kOtherShare = 0.75;  // and their share of what the first one does not explain.
constexpr std::size_t kMaxFolds = 40;
constexpr double kMaxScatter = 10;         // Times the noise that is said: more is no noise but another set-up.
const double kMaxNoise_rad = degToRad(5);  // And where nothing is said;
constexpr double kMaxShareOfTurns = 0.2;   // nor may it be more of the turns between the poses.
constexpr double kNoiseOff = 5;            // Standard deviations of chi^2 from which on noise is worth a warning,
constexpr double kScaleOff = 5;            // and of a scale.

std::string namesOfPoses(const PoseSet& set, const PoseChoice& chosen) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    if (chosen[i]) names.push_back(set.poses[i].name);
  }
  return joined(names, 8);
}

HandEyeEquations equationsOf(const HandEyeEquations& all, const PoseChoice& chosen) {
  HandEyeEquations some;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (chosen[i]) some.add(all.hands[i], all.cameras[i]);
  }
  return some;
}

// Poses that one transform does not explain may agree on another one: a second machine, or a camera that was moved.
void refuseTwoMachines(const PoseSet& set, const HandEyeProblem& problem, const HandEyeSettings& settings,
                       const HandEyeEstimate& first) {
  PoseChoice others(first.used);
  others.flip();
  if (countOfPoses(others) < kMinOther) return;
  const HandEyeEquations equations = equationsOf(problem.equations(), others);
  if (settings.mount == HandEyeMount::kUnknown &&
      motionSpread(equations).across_rad < degToRad(settings.min_turn_deg)) {
    return;
  }
  const HandEyeTransforms start = robustStart(equations, settings.mount, settings);
  const std::vector<Matrix6d> covariances = problem.covariances(start, first.noise);
  const HandEyeTransforms second = problem.solved(start, others, covariances, HandEyeProblem::Loss::kRobust);
  PoseChoice agree(others.size(), false), agree_first = first.used;
  for (std::size_t i = 0; i < others.size(); ++i) {
    // Its noise is the other one's: twice the gate.
    agree[i] = others[i] &&
               std::sqrt(squaredDistance(problem.residual(i, second), covariances[i])) < 2 * settings.outlier_gate;
    agree_first[i] = !agree[i] && first.sigmas(i) < 2 * settings.outlier_gate;
  }
  if (static_cast<double>(countOfPoses(agree)) < kOtherShare * static_cast<double>(countOfPoses(others))) return;
  throw InputError(set.path, "poses", "two machines, or a camera or object that was moved in between",
                   namesOfPoses(set, agree) + " fit one transform and " + namesOfPoses(set, agree_first) +
                       " another: all must be of one set-up");
}

void requireAgreement(const PoseSet& set, const HandEyeProblem& problem, const HandEyeSettings& settings,
                      const HandEyeEstimate& estimate) {
  refuseTwoMachines(set, problem, settings, estimate);
  const std::size_t used = countOfPoses(estimate.used);
  if (static_cast<double>(used) < settings.min_share * static_cast<double>(set.poses.size()) ||
      used < estimate.minPoses()) {
    throw InputError(
        set.path, "poses", std::to_string(used) + " of " + std::to_string(set.poses.size()) + " fit one transform",
        formatted("at least %g %% must: are hands and images of the same moments?", 100 * settings.min_share));
  }
  if (problem.noiseGiven() && estimate.chi2PerFreedom() > kMaxScatter * kMaxScatter) {
    throw InputError(set.path, "poses",
                     formatted("%.0f", std::sqrt(estimate.chi2PerFreedom())) + " times their noise off",
                     "no transform explains them" + std::string(settings.mount == HandEyeMount::kIdentity
                                                                    ? ": is the camera where the C-arm file has it?"
                                                                    : ": are hands and images of the same moments?"));
  }
  const bool known = settings.mount == HandEyeMount::kIdentity;
  const double turns = known ? kMaxNoise_rad / kMaxShareOfTurns : motionSpread(problem.equations()).along_rad;
  if (estimate.noise.rotation_rad > std::min(kMaxNoise_rad, kMaxShareOfTurns * turns)) {
    throw InputError(set.path, "poses", formatted("%.2g deg off, per axis", radToDeg(estimate.noise.rotation_rad)),
                     "no transform explains them: are hands and images of the same moments?");
  }
  if (known) return;
  const std::string place = used == set.poses.size() ? set.path : set.path + ": without outliers";
  requireMotions(place, set.setup, motionSpread(equationsOf(problem.equations(), estimate.used)), used,
                 degToRad(settings.min_turn_deg));
}

// Each pose predicted from the others (from those of the other folds, when there are many).
std::optional<HandEyeResiduals> heldOut(const HandEyeProblem& problem, const HandEyeSettings& settings,
                                        const HandEyeEstimate& estimate) {
  const std::size_t used = countOfPoses(estimate.used);
  if (used <= estimate.minPoses()) return std::nullopt;
  const std::size_t folds = std::min(used, kMaxFolds);
  double turns = 0, shifts = 0, predicted = 0;
  for (std::size_t fold = 0; fold < folds; ++fold) {
    PoseChoice others = estimate.used, out(others.size(), false);
    std::size_t at = 0;
    for (std::size_t i = 0; i < others.size(); ++i) {
      if (!estimate.used[i] || at++ % folds != fold) continue;
      others[i] = false;
      out[i] = true;
    }
    if (settings.mount == HandEyeMount::kUnknown &&
        motionSpread(equationsOf(problem.equations(), others)).across_rad < degToRad(settings.min_turn_deg)) {
      continue;  // The others alone could not tell.
    }
    const HandEyeTransforms t =
        problem.solved(estimate.transforms, others, estimate.covariances, HandEyeProblem::Loss::kSquares);
    for (std::size_t i = 0; i < out.size(); ++i) {
      if (!out[i]) continue;
      const Vector6d r = problem.residual(i, t);
      shifts += r.head<3>().squaredNorm();
      turns += r.tail<3>().squaredNorm();
      ++predicted;
    }
  }
  if (predicted == 0) return std::nullopt;
  return HandEyeResiduals{std::sqrt(turns / predicted), std::sqrt(shifts / predicted)};
}

// What each pose says of the estimate, and all together.
void fillResiduals(const PoseSet& set, const HandEyeProblem& problem, const HandEyeEstimate& estimate,
                   HandEyeResult& result) {
  double turns = 0, shifts = 0;
  for (std::size_t i = 0; i < problem.size(); ++i) {
    const Vector6d r = problem.residual(i, estimate.transforms);
    result.poses.push_back({set.poses[i].name, r.tail<3>().norm(), r.head<3>().norm(), estimate.sigmas(i),
                            !estimate.used[i], reprojectionError(set, problem.equations(), estimate.transforms, i)});
    if (!estimate.used[i]) continue;
    turns += r.tail<3>().squaredNorm();
    shifts += r.head<3>().squaredNorm();
  }
  const auto used = static_cast<double>(countOfPoses(estimate.used));
  result.residuals = {std::sqrt(turns / used), std::sqrt(shifts / used)};
  result.noise = {std::sqrt(turns / estimate.freedom(3)), std::sqrt(shifts / estimate.freedom(3))};
  result.noise_given = problem.noiseGiven();
  result.chi2_per_freedom = estimate.chi2PerFreedom();
}

// Widens the covariance where the given noise is not what the poses show.
void warnOfNoise(const HandEyeEstimate& estimate, HandEyeResult& result) {
  const double too_much = 1 + kNoiseOff * std::sqrt(2 / estimate.freedom(6));
  if (!result.noise_given || result.chi2_per_freedom <= too_much) return;
  result.covariance *= result.chi2_per_freedom;
  result.warnings.push_back(
      formatted("the poses scatter %.2g times as much as their noise is said to be; the covariance is widened by that",
                std::sqrt(result.chi2_per_freedom)));
}

void warnOfScale(const HandEyeEquations& used, HandEyeResult& result) {
  result.scale = translationScale(used);
  if (!result.scale || std::abs(result.scale->value - 1) <= std::max(0.01, kScaleOff * result.scale->sigma)) return;
  result.warnings.push_back(
      formatted("the camera's translations fit the hands' better when multiplied by %.4f +- %.4f: "
                "is the object's size right, and the focal length?",
                result.scale->value, result.scale->sigma));
}

}  // namespace

int HandEyeResult::outliers() const {
  return static_cast<int>(std::count_if(poses.begin(), poses.end(), [](const auto& pose) { return pose.outlier; }));
}

HandEyeResult calibrateHandEye(const PoseSet& set, const HandEyeSettings& settings) {
  checkSettings("hand_eye", settings);
  checkPoseSet(set);
  const HandEyeProblem problem(set, settings.mount);
  const HandEyeEquations& equations = problem.equations();
  if (settings.mount == HandEyeMount::kUnknown) {
    requireMotions(set.path, set.setup, motionSpread(equations), equations.size(), degToRad(settings.min_turn_deg));
    requireConventions(set.path, set.setup, equations);
  }
  HandEyeEstimate estimate(problem, settings);
  requireAgreement(set, problem, settings, estimate);

  HandEyeResult result;
  if (settings.residual == HandEyeResidual::kReprojection) {
    const ReprojectionFit fit = solvedByReprojection(set, problem, estimate.transforms, estimate.used,
                                                     problem.covariances(estimate.transforms, estimate.noise, false));
    estimate.transforms = fit.transforms;
    result.covariance = fit.covariance;
  } else {
    result.covariance = problem.covarianceOf(estimate.transforms, estimate.used, estimate.covariances);
  }
  result.transforms = estimate.transforms;
  fillResiduals(set, problem, estimate, result);
  result.held_out = heldOut(problem, settings, estimate);
  warnOfNoise(estimate, result);
  if (settings.mount == HandEyeMount::kUnknown) warnOfScale(equationsOf(equations, estimate.used), result);
  return result;
}

}  // namespace angio::calibration
