// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/patient_motion.hpp"

#include <algorithm>
#include <cmath>

#include "uniform.hpp"

namespace angio::simulation {

PatientMotion::PatientMotion(const MotionSettings& settings, const Eigen::Vector3d& center_model,
                             const Eigen::Matrix3d& R_lps_model, std::uint64_t seed)
    : settings_(settings), center_model_(center_model), R_lps_model_(R_lps_model), seed_(seed) {
  checkSettings("motion", settings);
  constexpr int kWaves = 4;
  Uniform uniform(seed_ + 77);
  const auto direction = [&] {
    const double z = uniform(-1, 1), angle = uniform(0, 2 * kPi), r = std::sqrt(1 - z * z);
    return Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), z);
  };
  for (int k = 0; settings_.deformation.rms_mm > 0 && k < kWaves; ++k) {
    // The mean square of a sine is a half.
    const Eigen::Vector3d amplitude_m = 1e-3 * settings_.deformation.rms_mm * std::sqrt(2.0 / kWaves) * direction();
    const double wavelength_m = 1e-3 * TreeDeformationSettings::wavelength_mm * uniform(1, 2);
    const Eigen::Vector3d along = direction();
    deformation_.push_back({amplitude_m, 2 * kPi / wavelength_m * along, uniform(0, 2 * kPi)});
  }
}

// Breathing in, 0..1 of the usual depth: sin^2n over each breath, which has an amplitude of its own.
double PatientMotion::lung(double time_s) const {
  const BreathingSettings& s = settings_.breathing;
  const double breaths = time_s / s.period_s, number = std::floor(breaths);
  Uniform uniform(seed_ + 1000003 * static_cast<std::uint64_t>(static_cast<std::int64_t>(number)));
  // Of three uniform numbers within +-1 the sum has the variance 1 and no tails.
  const double deviate = uniform(-1, 1) + uniform(-1, 1) + uniform(-1, 1);
  const double depth = std::max(0.0, 1 + s.variation * deviate);
  return depth * std::pow(std::abs(std::sin(kPi * (breaths - number))), 2 * s.sharpness);
}

PatientMotion::Breath PatientMotion::breath(double time_s) const {
  const BreathingSettings& s = settings_.breathing;
  const double down = lung(time_s), lag_s = s.hysteresis * s.period_s;
  // What lags is as far at time 0 as it was in the breath before; from there on it is counted.
  const double forward = lung(time_s - lag_s) - lung(-lag_s);
  const double amplitude = 1e-3 * s.amplitude_mm;
  return {amplitude * down + 1e-3 * s.drift_mm_per_min * time_s / 60, 0.1 * s.forward_mm * amplitude * forward};
}

// Contraction of the heart, 0..1: the first third of a beat.
double PatientMotion::systole(double time_s) const {
  const double beats = time_s * settings_.heartbeat.rate_per_min / 60, part = 3 * (beats - std::floor(beats));
  const double wave = part < 1 ? std::sin(kPi * part) : 0;
  return wave * wave;
}

Eigen::Vector3d PatientMotion::displacement(const Eigen::Vector3d& p_model, double time_s) const {
  const Eigen::Vector3d p = R_lps_model_ * (p_model - center_model_);
  Eigen::Vector3d moved = Eigen::Vector3d::Zero();

  const BreathingSettings& b = settings_.breathing;
  const double below = std::max(0.0, 1e-3 * b.diaphragm_mm - p.z()) / (1e-3 * b.reach_mm);
  const Breath now = breath(time_s);
  moved += std::exp(-0.5 * below * below) * Eigen::Vector3d(0, -now.forward_m, -now.down_m);

  const HeartbeatSettings& h = settings_.heartbeat;
  if (h.amplitude_mm > 0) {
    const Eigen::Vector3d from = p - 1e-3 * Eigen::Map<const Eigen::Vector3d>(h.center_mm);
    const double reach = 1e-3 * h.reach_mm, amplitude = 1e-3 * h.amplitude_mm;
    // x exp(-(x^2 - 1) / 2) is largest, and 1, at x = 1.
    const double fading = systole(time_s) * std::exp(0.5 - 0.5 * from.squaredNorm() / (reach * reach));
    const Eigen::Vector3d axis = Eigen::Vector3d(0.6, -0.5, -0.62).normalized();  // The heart's, base to apex.
    const double turn_rad = degToRad(h.turn_deg) * h.amplitude_mm / 10 * fading * std::exp(-0.5);
    moved += -amplitude / reach * fading * from + turn_rad * axis.cross(from);
  }
  for (const Wave& wave : deformation_) moved += wave.amplitude_m * std::sin(wave.number_per_m.dot(p) + wave.phase_rad);
  return R_lps_model_.transpose() * moved;
}

Eigen::Matrix3Xd PatientMotion::displacements(const Eigen::Matrix3Xd& points_model, double time_s) const {
  Eigen::Matrix3Xd result(3, points_model.cols());
  for (Eigen::Index i = 0; i < points_model.cols(); ++i) result.col(i) = displacement(points_model.col(i), time_s);
  return result;
}

Pose PatientMotion::shift(double time_s) const {
  const ShiftSettings& s = settings_.shift;
  Eigen::Vector3d moved = 1e-3 * time_s / 60 * Eigen::Map<const Eigen::Vector3d>(s.drift_mm_per_min);
  double turn_rad = 0;
  if (time_s >= s.sudden_at_s) {
    moved += 1e-3 * Eigen::Map<const Eigen::Vector3d>(s.sudden_mm);
    turn_rad = degToRad(s.sudden_turn_deg);
  }
  const Eigen::Matrix3d R_model_lps = R_lps_model_.transpose();
  Pose T = Pose::Identity();
  T.linear() = expSO3(turn_rad * R_model_lps.col(2));
  T.translation() = center_model_ - T.linear() * center_model_ + R_model_lps * moved;
  return T;
}

bool PatientMotion::moves() const {
  const BreathingSettings& b = settings_.breathing;
  const ShiftSettings& s = settings_.shift;
  const auto any = [](const double* v) { return v[0] != 0 || v[1] != 0 || v[2] != 0; };
  return !deformation_.empty() || b.amplitude_mm > 0 || b.drift_mm_per_min != 0 ||
         settings_.heartbeat.amplitude_mm > 0 || any(s.drift_mm_per_min) || any(s.sudden_mm) || s.sudden_turn_deg != 0;
}

}  // namespace angio::simulation
