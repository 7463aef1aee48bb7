// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "angio/motion/namespace.hpp"

namespace angio::motion {

constexpr double kTwoPi = 6.283185307179586;  ///< Of a phase in a period [rad].

/// A position with its covariance.
struct PositionEstimate {
  Eigen::Vector3d position;
  Eigen::Matrix3d covariance;
};

/// z^T S^-1 z.
double squaredMahalanobis(const Eigen::Vector3d& z, const Eigen::Matrix3d& S);

/// Kalman filter of a point with constant velocity and white acceleration.
class TrendFilter {
 public:
  /// @param acceleration_density  Of the white acceleration, per axis [m^2/s^3].
  TrendFilter(const Eigen::Vector3d& position, const Eigen::Matrix3d& R, double first_speed_std_m_per_s,
              double acceleration_density);

  void advance(double dt_s);
  PositionEstimate ahead(double horizon_s) const;  ///< Constant velocity.
  PositionEstimate held(double horizon_s) const;   ///< No velocity: its square is part of the covariance.
  void correct(const Eigen::Vector3d& z, const Eigen::Matrix3d& R);

  /// Begins again at a place, with the speed unknown.
  void restart(const Eigen::Vector3d& z, const Eigen::Matrix3d& R);

 private:
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  Eigen::Matrix<double, 6, 1> x_;  // Position, velocity.
  Matrix6d P_;
  double first_speed_std_, density_;
};

/// An oscillator as it is first known: its frequency, and how large each harmonic is along each axis.
struct Oscillator {
  double frequency_hz = 0;
  double frequency_std_hz = 0;
  double low_hz = 0, high_hz = 0;  ///< It does not leave this band.
  Eigen::Matrix3Xd amplitude_m;    ///< 3 x harmonics, of the sum of cosine and sine.
};

/// What changes in a harmonic motion as time goes on.
struct HarmonicNoise {
  double amplitude_memory_s;  ///< Time constant of each harmonic.
  double offset_walk_m;       ///< Per square root of a second.
  double drift_std_m_per_s;   ///< Changes over the same time constant.
  double first_offset_std_m;
};

/// Extended Kalman filter of resting position, drift and oscillators whose frequencies are unknown.
///
/// State, each entry but the frequencies a 3-vector: offset, drift; of each harmonic h the pair (c, s), which turns by
/// h omega dt; omega of each oscillator. The position is the offset and the sum of all c. Noise enters the pairs as in
/// a quasi-periodic Gaussian process, but they are not damped: what repeats itself exactly is predicted exactly.
class HarmonicFilter {
 public:
  static constexpr int kMaxStates = 64;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxStates, 1>;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxStates, kMaxStates>;

  HarmonicFilter(const std::vector<Oscillator>& oscillators, const HarmonicNoise& noise,
                 const Eigen::Vector3d& first_position);

  void advance(double dt_s);
  PositionEstimate ahead(double horizon_s) const;
  void correct(const Eigen::Vector3d& z, const Eigen::Matrix3d& R);

  /// The whole has been moved to where it is seen; how it moves is as before.
  void shift(const Eigen::Vector3d& by, double std_m);

  /// How it moves is no longer known: amplitudes as unsure as at first.
  void widen();

  int oscillators() const { return static_cast<int>(parts_.size()); }
  double frequency_hz(int oscillator) const;

 private:
  struct Part {
    int first = 0;  // Component of the first harmonic's c; s and the next harmonics follow.
    int turn = 0;   // Of the first harmonic, among the turns of all.
    int harmonics = 0;
    int frequency = 0;  // Index in the state.
    double low_hz = 0, high_hz = 0, frequency_variance = 0;
    Eigen::Matrix3Xd variance;  // 3 x harmonics, of each of c and s.
  };

  // How a harmonic turns in a time.
  struct Turn {
    double c, s;  // Cosine and sine.
  };
  using Turns = std::array<Turn, kMaxStates / 6>;  // Of all harmonics of all parts.
  Turns turnsIn(double dt_s) const;
  double damping(double dt_s) const;
  Eigen::Vector3d byFrequency(const Part& part, const Turns& turns, double horizon_s) const;
  void timesTransposed(double dt_s, const Turns& turns, const Vector& before);
  void keepFrequencies();

  std::vector<Part> parts_;
  HarmonicNoise noise_;
  int components_ = 2;
  Vector x_;
  Matrix P_;
};

}  // namespace angio::motion
