// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/motion/motion_predictor.hpp"

#include <Eigen/Cholesky>
#include <cmath>

#include "angio/base/errors.hpp"
#include "motion_memory.hpp"

namespace angio::motion {
namespace {

constexpr double kFirstSpeed_m_per_s = 25e-3, kFirstError_m = 2e-3;
// Measurements in a row that may be left out, whatever they say.
constexpr int kMaxSuspects = 3;
// How much worse than the simple models the harmonic one may be before it is not used, and before it is dropped.
constexpr double kTrusted = 1.1, kLost = 1.5;
constexpr double kLostAfter_s = 0.5;
// How often periods are looked for while there are none, and at least while some are missing.
constexpr double kSearchEvery_s = 1, kSearchAtLeastEvery_s = 16;

MotionPredictorSettings checked(const MotionPredictorSettings& s) {
  checkSettings("motion prediction", s);
  const auto band = [](const char* field, double low, double high) {
    if (!(low < high))
      throw InputError("motion prediction", field, formatValue(low), "must be below " + formatValue(high));
  };
  band("breathing_low_hz", s.breathing_low_hz, s.breathing_high_hz);
  band("heart_low_hz", s.heart_low_hz, s.heart_high_hz);
  band("breathing_high_hz", s.breathing_high_hz, s.heart_low_hz);
  return s;
}

}  // namespace

struct MotionPredictor::State {
  explicit State(const MotionPredictorSettings& s)
      : settings(s), held(s.scoring_memory_s, 1e-3 * s.scoring_horizon_ms, kFirstError_m), velocity(held) {}

  MotionPredictorSettings settings;
  std::deque<MotionSample> samples;  // The last memory_s.
  std::optional<TrendFilter> trend;
  std::optional<HarmonicMotion> harmonic;
  PredictionRecord held, velocity;
  double time_s = 0;  // Of the filters.
  std::optional<MotionSample> suspect;
  int suspects = 0, late = 0;  // In a row.
  double learn_from_s = 0;     // What came before belongs to another motion.
  double searched_s = 0, search_every_s = kSearchEvery_s;
  std::optional<double> worse_since_s;  // Since when the simple models have been much better than the harmonic one.
  bool lost = false;

  void begin(const MotionSample& sample) {
    *this = State(settings);
    const double density = std::pow(1e-3 * settings.acceleration_std_mm_per_s2, 2) * settings.acceleration_mean_s;
    trend.emplace(sample.position, sample.covariance, kFirstSpeed_m_per_s, density);
    time_s = learn_from_s = searched_s = sample.time_s;
    samples.push_back(sample);
  }

  std::optional<std::string> refusal(const Eigen::Vector3d& z, const Eigen::Matrix3d& R) const {
    if (!z.allFinite() || !R.allFinite()) return "the measurement is not finite";
    const double largest = R.cwiseAbs().maxCoeff();
    if ((R - R.transpose()).cwiseAbs().maxCoeff() > 1e-6 * largest ||
        Eigen::LDLT<Eigen::Matrix3d>(R).vectorD().minCoeff() < -1e-12 * largest) {
      return "the covariance is none";
    }
    return std::nullopt;
  }

  MotionModel chosen() const {
    const double simple = std::min(held.error(), velocity.error());
    if (harmonic && !lost && harmonic->record.scored() && harmonic->record.error() <= kTrusted * simple) {
      return MotionModel::kHarmonic;
    }
    return velocity.error() < held.error() ? MotionModel::kVelocity : MotionModel::kHeld;
  }

  PositionEstimate estimate(MotionModel model, double horizon_s) const {
    const bool oscillates = model == MotionModel::kHarmonic, moves = model == MotionModel::kVelocity;
    const PositionEstimate raw = oscillates ? harmonic->filter.ahead(horizon_s)
                                 : moves    ? trend->ahead(horizon_s)
                                            : trend->held(horizon_s);
    const PredictionRecord& record = oscillates ? harmonic->record : moves ? velocity : held;
    return {raw.position, record.honest(raw.covariance, horizon_s)};
  }

  std::optional<double> frequency_hz(int HarmonicMotion::*oscillator) const {
    if (!harmonic || (*harmonic).*oscillator < 0) return std::nullopt;
    return harmonic->filter.frequency_hz((*harmonic).*oscillator);
  }

  bool surprising(const MotionSample& sample) const {
    const auto surprised = [&](MotionModel model) {
      const PositionEstimate expected = estimate(model, 0);
      return squaredMahalanobis(sample.position - expected.position, expected.covariance + sample.covariance) >
             settings.gate;
    };
    return surprised(MotionModel::kVelocity) && (!harmonic || surprised(MotionModel::kHarmonic));
  }

  // Two surprises that agree are a change; two that do not are two errors.
  bool confirmed(const MotionSample& sample) const {
    if (!suspect) return false;
    if (suspects >= kMaxSuspects) return true;
    const double moved_m = kFirstSpeed_m_per_s * (sample.time_s - suspect->time_s);
    const Eigen::Matrix3d S = sample.covariance + suspect->covariance + moved_m * moved_m * Eigen::Matrix3d::Identity();
    return squaredMahalanobis(sample.position - suspect->position, S) <= settings.gate;
  }

  // The whole has moved: what is remembered moves with it, and how it breathes is kept.
  void shiftTo(const MotionSample& sample) {
    const Eigen::Vector3d by = sample.position - estimate(chosen(), 0).position;
    for (MotionSample& old : samples) old.position += by;
    trend->restart(sample.position, sample.covariance);
    held.forgetOpen();
    velocity.forgetOpen();
    if (harmonic) {
      harmonic->filter.shift(by, by.norm());
      harmonic->record.forgetOpen();
    }
  }

  void take(const MotionSample& sample) {
    const MotionSample last = samples.back();
    trend->correct(sample.position, sample.covariance);
    for (PredictionRecord* record : {&held, &velocity}) {
      record->score(last.time_s, last.position, sample.time_s, sample.position, sample.covariance);
    }
    const double horizon_s = 1e-3 * settings.scoring_horizon_ms;
    held.add(sample.time_s + horizon_s, trend->held(horizon_s));
    velocity.add(sample.time_s + horizon_s, trend->ahead(horizon_s));
    if (harmonic) harmonic->take(last, sample, horizon_s);
    samples.push_back(sample);
    while (samples.front().time_s < sample.time_s - settings.memory_s) samples.pop_front();
  }

  // Whether the motion has just stopped to be what was learnt.
  bool lose() {
    if (!harmonic) return false;
    const double simple = std::min(held.error(), velocity.error());
    if (harmonic->record.error() <= kTrusted * simple) lost = false;
    if (harmonic->record.error() <= kLost * simple) {
      worse_since_s.reset();
      return false;
    }
    if (!worse_since_s) worse_since_s = time_s;
    if (lost || time_s - *worse_since_s < kLostAfter_s) return false;
    lost = true;
    learn_from_s = *worse_since_s;
    harmonic->filter.widen();
    return true;
  }

  void search() {
    const bool sound = harmonic && !lost;
    if (sound && harmonic->heart >= 0 && harmonic->breathing >= 0) return;
    if (time_s - searched_s < search_every_s) return;
    searched_s = time_s;
    // What has not been found in a sound motion is perhaps not there.
    search_every_s = sound ? std::min(2 * search_every_s, kSearchAtLeastEvery_s) : kSearchEvery_s;
    const std::vector<Oscillator> periods = findPeriods(samples, learn_from_s, settings);
    if (periods.empty() || (sound && periods.size() <= static_cast<std::size_t>(harmonic->filter.oscillators())))
      return;
    HarmonicMotion found = learnt(samples, learn_from_s, periods, settings);
    // It has to be better than what there is, by the same measurements.
    if (harmonic && !(found.record.error() < harmonic->record.error())) return;
    harmonic = std::move(found);
    search_every_s = kSearchEvery_s;
    if (harmonic->record.error() <= kTrusted * std::min(held.error(), velocity.error())) lost = false;
  }
};

MotionPredictor::MotionPredictor(const MotionPredictorSettings& settings)
    : state_(std::make_unique<State>(checked(settings))) {}
MotionPredictor::MotionPredictor(MotionPredictor&&) noexcept = default;
MotionPredictor& MotionPredictor::operator=(MotionPredictor&&) noexcept = default;
MotionPredictor::~MotionPredictor() = default;

MotionUpdate MotionPredictor::update(double time_s, const Eigen::Vector3d& position_m,
                                     const Eigen::Matrix3d& covariance_m2) {
  State& s = *state_;
  if (const auto why = s.refusal(position_m, covariance_m2)) return {MotionStatus::kRefused, *why};
  if (!std::isfinite(time_s)) return {MotionStatus::kRefused, "the time is not finite"};
  const double floor_m = 1e-3 * s.settings.measured_std_mm;
  const MotionSample sample{time_s, position_m, covariance_m2 + floor_m * floor_m * Eigen::Matrix3d::Identity()};
  if (!s.trend) {
    s.begin(sample);
    return {};
  }
  if (!(time_s > s.time_s)) {
    if (++s.late <= kMaxSuspects) return {MotionStatus::kRefused, "the measurement is not later than the last one"};
    s.begin(sample);
    return {MotionStatus::kChanged, "the clock was set back"};
  }
  s.late = 0;
  const double gap_s = time_s - s.samples.back().time_s;
  if (gap_s > s.settings.max_gap_s) {
    s.begin(sample);
    return {MotionStatus::kChanged, "nothing was measured for " + formatValue(gap_s) + " s"};
  }
  s.trend->advance(time_s - s.time_s);
  if (s.harmonic) s.harmonic->filter.advance(time_s - s.time_s);
  s.time_s = time_s;

  MotionUpdate result;
  if (s.surprising(sample)) {
    if (!s.confirmed(sample)) {
      s.suspect = sample;
      ++s.suspects;
      return {MotionStatus::kSuspect, "the measurement is far from what was expected"};
    }
    result = {MotionStatus::kChanged, "the position has shifted"};
    s.shiftTo(sample);
  }
  s.suspect.reset();
  s.suspects = 0;
  s.take(sample);
  if (s.lose()) result = {MotionStatus::kChanged, "the motion is no longer periodic as it was"};
  return result;
}

void MotionPredictor::learn() {
  if (state_->trend) state_->search();
}

std::optional<MotionPrediction> MotionPredictor::predict(double time_s) const {
  return predict(time_s, state_->chosen());
}

std::optional<MotionPrediction> MotionPredictor::predict(double time_s, MotionModel model) const {
  const State& s = *state_;
  if (!s.trend || !std::isfinite(time_s)) return std::nullopt;
  if (model == MotionModel::kHarmonic && !s.harmonic) return std::nullopt;
  const double horizon_s = time_s - s.time_s;
  if (horizon_s < 0) return std::nullopt;
  if (horizon_s > 1e-3 * s.settings.max_horizon_ms) {
    return MotionPrediction{s.estimate(model, 0).position, s.estimate(MotionModel::kHeld, horizon_s).covariance,
                            MotionModel::kHeld, true};
  }
  const PositionEstimate e = s.estimate(model, horizon_s);
  return MotionPrediction{e.position, 0.5 * (e.covariance + e.covariance.transpose()), model, false};
}

std::optional<double> MotionPredictor::breathing_hz() const { return state_->frequency_hz(&HarmonicMotion::breathing); }

std::optional<double> MotionPredictor::heart_hz() const { return state_->frequency_hz(&HarmonicMotion::heart); }

void MotionPredictor::reset() { state_ = std::make_unique<State>(state_->settings); }

}  // namespace angio::motion
