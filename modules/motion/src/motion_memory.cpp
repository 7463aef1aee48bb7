// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion_memory.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace angio::motion {
namespace {

// Of the variance that is not slow: breathing is most of it, the heart a good part of what breathing leaves.
constexpr double kBreathingShare = 0.75, kHeartShare = 0.25;
// The heart is looked for in this time, and needs so many beats.
constexpr double kHeartMemory_s = 8, kBeatsToLearn = 4;
// Highest wave that a frame rate shows, in parts of it: half is the limit.
constexpr double kOfFrameRate = 0.45;
// A search's step, in parts of what a window can tell apart.
constexpr double kBreathingStep = 0.1, kHeartStep = 0.15;
constexpr double kMinBreaths = 1.2;
constexpr double kReplay_s = 8, kReplayPeriods = 2;
constexpr int kHeartHarmonicsSearched = 3;
constexpr std::size_t kMinSamples = 10;
constexpr double kFirstOffsetStd_m = 0.01;

double medianStep_s(const std::deque<MotionSample>& samples, std::size_t first) {
  std::vector<double> steps;
  for (std::size_t i = first + 1; i < samples.size(); ++i) steps.push_back(samples[i].time_s - samples[i - 1].time_s);
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

// Squared Mahalanobis distance beyond which a single error counts no more.
constexpr double kMaxSurprise = 50;
constexpr double kCovarianceMemory = 3;  // Of scoring_memory_s: six numbers need more than one.

constexpr double kMinShare = 0.22;  // Of a covariance that is left when predictions come true far too well.

// P + E, in no direction less than kMinShare of P.
Eigen::Matrix3d sum(const Eigen::Matrix3d& P, const Eigen::Matrix3d& E) {
  // Mostly there is nothing to keep it from.
  const Eigen::Matrix3d above = (1 - kMinShare) * P + E;
  if (above.llt().info() == Eigen::Success) return P + E;
  const Eigen::LLT<Eigen::Matrix3d> root(P);
  if (root.info() != Eigen::Success) return P;
  const Eigen::Matrix3d L = root.matrixL();
  const Eigen::Matrix3d L_inverse = L.triangularView<Eigen::Lower>().solve(Eigen::Matrix3d::Identity());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> relative(L_inverse * E * L_inverse.transpose());
  const Eigen::Matrix3d A = L * relative.eigenvectors();
  return A * (relative.eigenvalues().array() + 1).max(kMinShare).matrix().asDiagonal() * A.transpose();
}

}  // namespace

void HarmonicMotion::take(const MotionSample& last, const MotionSample& sample, double scoring_horizon_s) {
  filter.correct(sample.position, sample.covariance);
  record.score(last.time_s, last.position, sample.time_s, sample.position, sample.covariance);
  record.add(sample.time_s + scoring_horizon_s, filter.ahead(scoring_horizon_s));
}

std::vector<Oscillator> findPeriods(const std::deque<MotionSample>& samples, double from_s,
                                    const MotionPredictorSettings& settings) {
  const std::size_t first = firstFrom(samples, from_s);
  if (samples.size() - first < kMinSamples) return {};
  const double end_s = samples.back().time_s, window_s = end_s - samples[first].time_s;
  const double rate_hz = 1 / medianStep_s(samples, first), highest_hz = kOfFrameRate * rate_hz;
  const auto harmonics = [&](int wanted, double frequency_hz) {
    return std::min(wanted, static_cast<int>(std::floor(highest_hz / frequency_hz)));
  };
  std::vector<Oscillator> periods;
  std::vector<double> known_hz;
  {
    PeriodSearch search{};
    // Slower ones than can be learnt yet are looked at as well: a part of one may pass for a faster one.
    search.low_hz = std::max(settings.breathing_low_hz, kMinBreaths / window_s);
    search.high_hz = std::min(settings.breathing_high_hz, highest_hz);
    search.harmonics = harmonics(settings.breathing_harmonics, search.high_hz);
    search.step_hz = kBreathingStep / window_s;
    search.min_share = kBreathingShare;
    const auto breath = findPeriod(samples, from_s, search);
    if (breath && breath->frequency_hz * window_s >= settings.breaths_to_learn) {
      periods.push_back({breath->frequency_hz, search.step_hz, settings.breathing_low_hz, settings.breathing_high_hz,
                         breath->amplitude_m});
      for (int h = 1; h <= search.harmonics; ++h) known_hz.push_back(h * breath->frequency_hz);
    }
  }
  const double heart_window_s = std::min(window_s, kHeartMemory_s);
  if (settings.heart_harmonics > 0 && heart_window_s * settings.heart_low_hz >= kBeatsToLearn) {
    // All that is slower than a heart.
    for (double f = 1 / heart_window_s; f < 0.9 * settings.heart_low_hz; f += 1 / heart_window_s) known_hz.push_back(f);
    PeriodSearch search{};
    search.low_hz = settings.heart_low_hz;
    search.high_hz = std::min(settings.heart_high_hz, highest_hz);
    search.harmonics = std::min(kHeartHarmonicsSearched, harmonics(settings.heart_harmonics, search.high_hz));
    search.step_hz = kHeartStep / heart_window_s;
    // A heart alone, before breathing is known, would only be in the way: unless it is most of what there is.
    search.min_share = periods.empty() ? kBreathingShare : kHeartShare;
    if (!periods.empty()) search.known_hz = known_hz;
    if (const auto beat = findPeriod(samples, end_s - heart_window_s, search)) {
      // Harmonics that were not searched begin small.
      Eigen::Matrix3Xd amplitude = Eigen::Matrix3Xd::Zero(3, harmonics(settings.heart_harmonics, beat->frequency_hz));
      const Eigen::Index found = std::min(amplitude.cols(), beat->amplitude_m.cols());
      amplitude.leftCols(found) = beat->amplitude_m.leftCols(found);
      periods.push_back({beat->frequency_hz, search.step_hz, settings.heart_low_hz, settings.heart_high_hz, amplitude});
    }
  }
  return periods;
}

HarmonicMotion learnt(const std::deque<MotionSample>& samples, double from_s, const std::vector<Oscillator>& periods,
                      const MotionPredictorSettings& settings) {
  double slowest_s = 0;
  for (const Oscillator& period : periods) slowest_s = std::max(slowest_s, 1 / period.frequency_hz);
  // No longer than is needed to converge: this is done within one frame.
  const double begin_s = samples.back().time_s - std::max(kReplay_s, kReplayPeriods * slowest_s);
  const std::size_t first = std::min(firstFrom(samples, std::max(from_s, begin_s)), samples.size() - 1);
  HarmonicNoise noise{settings.amplitude_memory_s, 1e-3 * settings.offset_walk_mm, 1e-3 * settings.drift_std_mm_per_s,
                      kFirstOffsetStd_m};
  for (const Oscillator& period : periods) noise.first_offset_std_m += period.amplitude_m.norm();
  const double horizon_s = 1e-3 * settings.scoring_horizon_ms;
  HarmonicMotion motion{HarmonicFilter(periods, noise, samples[first].position),
                        PredictionRecord(settings.scoring_memory_s, horizon_s, 0)};
  for (std::size_t k = 0; k < periods.size(); ++k) {
    (periods[k].low_hz >= settings.heart_low_hz ? motion.heart : motion.breathing) = static_cast<int>(k);
  }
  motion.filter.correct(samples[first].position, samples[first].covariance);
  for (std::size_t i = first + 1; i < samples.size(); ++i) {
    motion.filter.advance(samples[i].time_s - samples[i - 1].time_s);
    motion.take(samples[i - 1], samples[i], horizon_s);
  }
  return motion;
}

double PredictionRecord::error() const {
  return weight_ > 0 ? error_sum_ / weight_ : std::numeric_limits<double>::infinity();
}

Eigen::Matrix3d PredictionRecord::honest(const Eigen::Matrix3d& covariance, double horizon_s) const {
  return sum(covariance, std::max(1.0, horizon_s / horizon_s_) * lacking_);
}

void PredictionRecord::score(double last_time_s, const Eigen::Vector3d& last_position, double time_s,
                             const Eigen::Vector3d& position, const Eigen::Matrix3d& R) {
  while (!open_.empty() && open_.front().time_s <= time_s) {
    const Prediction prediction = open_.front();
    open_.pop_front();
    if (prediction.time_s < last_time_s) continue;
    const double part = (prediction.time_s - last_time_s) / std::max(time_s - last_time_s, 1e-9);
    const Eigen::Vector3d error = last_position + part * (position - last_position) - prediction.estimate.position;
    // Every prediction counts for its own share of time, whatever the frame rate.
    const double kept = std::exp(-(time_s - last_time_s) / scoring_memory_s_);
    error_sum_ = kept * error_sum_ + (1 - kept) * squaredMahalanobis(error, R);
    weight_ = kept * weight_ + (1 - kept);
    const Eigen::Matrix3d claimed = prediction.estimate.covariance + R;
    const double surprise = squaredMahalanobis(error, sum(prediction.estimate.covariance, lacking_) + R);
    const double learnt = 1 - std::exp(-(time_s - last_time_s) / (kCovarianceMemory * scoring_memory_s_));
    lacking_ += learnt * (std::min(1.0, kMaxSurprise / surprise) * error * error.transpose() - claimed - lacking_);
  }
}

}  // namespace angio::motion
