// SPDX-License-Identifier: GPL-2.0-or-later
#include "harmonic_filter.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace angio::motion {

constexpr int kDrift = 3;  // Where it begins in the state; the offset is at 0.

HarmonicFilter::HarmonicFilter(const std::vector<Oscillator>& oscillators, const HarmonicNoise& noise,
                               const Eigen::Vector3d& first_position)
    : noise_(noise) {
  for (const Oscillator& oscillator : oscillators) {
    Part part;
    part.first = components_;
    part.turn = components_ / 2 - 1;  // Behind offset and drift, two components a harmonic.
    part.harmonics = static_cast<int>(oscillator.amplitude_m.cols());
    part.low_hz = oscillator.low_hz;
    part.high_hz = oscillator.high_hz;
    part.frequency_variance = std::pow(kTwoPi * oscillator.frequency_std_hz, 2);
    // An axis or harmonic without motion so far may get some: a twentieth of all there is.
    part.variance = oscillator.amplitude_m.cwiseAbs2().array() + 0.0025 * oscillator.amplitude_m.squaredNorm() + 1e-10;
    components_ += 2 * part.harmonics;
    parts_.push_back(part);
  }
  const int n = 3 * components_ + static_cast<int>(parts_.size());
  x_ = Vector::Zero(n);
  P_ = Matrix::Zero(n, n);
  x_.head<3>() = first_position;
  P_.diagonal().head<3>().setConstant(noise.first_offset_std_m * noise.first_offset_std_m);
  P_.diagonal().segment<3>(kDrift).setConstant(noise.drift_std_m_per_s * noise.drift_std_m_per_s);
  for (std::size_t k = 0; k < parts_.size(); ++k) {
    Part& part = parts_[k];
    part.frequency = 3 * components_ + static_cast<int>(k);
    x_[part.frequency] = kTwoPi * oscillators[k].frequency_hz;
    P_(part.frequency, part.frequency) = part.frequency_variance;
    for (int h = 0; h < part.harmonics; ++h) {
      for (int i = 0; i < 2; ++i) P_.diagonal().segment<3>(3 * (part.first + 2 * h + i)) = part.variance.col(h);
    }
  }
}

double HarmonicFilter::frequency_hz(int oscillator) const { return x_[parts_[oscillator].frequency] / kTwoPi; }

double HarmonicFilter::damping(double dt_s) const { return std::exp(-dt_s / noise_.amplitude_memory_s); }

HarmonicFilter::Turns HarmonicFilter::turnsIn(double dt_s) const {
  Turns turns;
  for (const Part& part : parts_) {
    for (int h = 0; h < part.harmonics; ++h) {
      const double angle = (h + 1) * x_[part.frequency] * dt_s;
      turns[part.turn + h] = {std::cos(angle), std::sin(angle)};
    }
  }
  return turns;
}

// Of a position ahead.
Eigen::Vector3d HarmonicFilter::byFrequency(const Part& part, const Turns& turns, double horizon_s) const {
  Eigen::Vector3d by = Eigen::Vector3d::Zero();
  for (int h = 0; h < part.harmonics; ++h) {
    const Turn t = turns[part.turn + h];
    const int at_c = 3 * (part.first + 2 * h);
    by -= (h + 1) * horizon_s * (t.s * x_.segment<3>(at_c) + t.c * x_.segment<3>(at_c + 3));
  }
  return by;
}

// P <- P F^T, with `before` the state that the motion began in.
void HarmonicFilter::timesTransposed(double dt_s, const Turns& turns, const Vector& before) {
  P_.middleCols<3>(0) += dt_s * P_.middleCols<3>(kDrift);
  P_.middleCols<3>(kDrift) *= damping(dt_s);
  for (const Part& part : parts_) {
    for (int h = 0; h < part.harmonics; ++h) {
      const Turn t = turns[part.turn + h];
      const int at_c = 3 * (part.first + 2 * h), at_s = at_c + 3;
      for (int axis = 0; axis < 3; ++axis) {
        const double c = before[at_c + axis], s = before[at_s + axis], by = (h + 1) * dt_s;
        const Vector old_c = P_.col(at_c + axis), old_s = P_.col(at_s + axis);
        // d/d omega of the turned pair.
        P_.col(at_c + axis) = t.c * old_c - t.s * old_s - by * (t.s * c + t.c * s) * P_.col(part.frequency);
        P_.col(at_s + axis) = t.s * old_c + t.c * old_s + by * (t.c * c - t.s * s) * P_.col(part.frequency);
      }
    }
  }
}

void HarmonicFilter::advance(double dt_s) {
  const Vector before = x_;
  const Turns turns = turnsIn(dt_s);
  const double kept = damping(dt_s), renewed = 1 - kept * kept;
  // F P F^T of a symmetric P.
  timesTransposed(dt_s, turns, before);
  P_.transposeInPlace();
  timesTransposed(dt_s, turns, before);

  P_.diagonal().head<3>().array() += noise_.offset_walk_m * noise_.offset_walk_m * dt_s;
  P_.diagonal().segment<3>(kDrift).array() += renewed * noise_.drift_std_m_per_s * noise_.drift_std_m_per_s;
  x_.head<3>() += dt_s * before.segment<3>(kDrift);
  x_.segment<3>(kDrift) *= kept;
  for (const Part& part : parts_) {
    // A frequency wanders by its first deviation within the same time.
    P_(part.frequency, part.frequency) += renewed * part.frequency_variance;
    for (int h = 0; h < part.harmonics; ++h) {
      const Turn t = turns[part.turn + h];
      const int at_c = 3 * (part.first + 2 * h), at_s = at_c + 3;
      const Eigen::Vector3d c = before.segment<3>(at_c), s = before.segment<3>(at_s);
      x_.segment<3>(at_c) = t.c * c - t.s * s;
      x_.segment<3>(at_s) = t.s * c + t.c * s;
      P_.diagonal().segment<3>(at_c) += renewed * part.variance.col(h);
      P_.diagonal().segment<3>(at_s) += renewed * part.variance.col(h);
    }
  }
}

PositionEstimate HarmonicFilter::ahead(double horizon_s) const {
  const Turns turns = turnsIn(horizon_s);
  const double kept = damping(horizon_s), renewed = 1 - kept * kept;
  // The position's derivative by the state, G, is a multiple of the identity for every component, and a column for
  // every frequency: G P G^T by those.
  Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kMaxStates, 3> PGt =
      P_.leftCols<3>() + horizon_s * P_.middleCols<3>(kDrift);
  PositionEstimate estimate{x_.head<3>() + horizon_s * x_.segment<3>(kDrift), Eigen::Matrix3d::Zero()};
  Eigen::Vector3d grown = Eigen::Vector3d::Constant(noise_.offset_walk_m * noise_.offset_walk_m * horizon_s);
  for (const Part& part : parts_) {
    for (int h = 0; h < part.harmonics; ++h) {
      const Turn t = turns[part.turn + h];
      const int at_c = 3 * (part.first + 2 * h), at_s = at_c + 3;
      PGt += t.c * P_.middleCols<3>(at_c) - t.s * P_.middleCols<3>(at_s);
      estimate.position += t.c * x_.segment<3>(at_c) - t.s * x_.segment<3>(at_s);
      grown += renewed * part.variance.col(h);
    }
    PGt += P_.col(part.frequency) * byFrequency(part, turns, horizon_s).transpose();
  }
  estimate.covariance = PGt.topRows<3>() + horizon_s * PGt.middleRows<3>(kDrift);
  for (const Part& part : parts_) {
    for (int h = 0; h < part.harmonics; ++h) {
      const Turn t = turns[part.turn + h];
      const int at_c = 3 * (part.first + 2 * h);
      estimate.covariance += t.c * PGt.middleRows<3>(at_c) - t.s * PGt.middleRows<3>(at_c + 3);
    }
    estimate.covariance += byFrequency(part, turns, horizon_s) * PGt.row(part.frequency);
  }
  estimate.covariance = (0.5 * (estimate.covariance + estimate.covariance.transpose())).eval();
  estimate.covariance.diagonal() += grown;
  return estimate;
}

void HarmonicFilter::correct(const Eigen::Vector3d& z, const Eigen::Matrix3d& R) {
  Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kMaxStates, 3> PHt = P_.leftCols<3>();
  Eigen::Vector3d expected = x_.head<3>();
  for (const Part& part : parts_) {
    for (int h = 0; h < part.harmonics; ++h) {
      PHt += P_.middleCols<3>(3 * (part.first + 2 * h));
      expected += x_.segment<3>(3 * (part.first + 2 * h));
    }
  }
  Eigen::Matrix3d S = PHt.topRows<3>() + R;
  for (const Part& part : parts_) {
    for (int h = 0; h < part.harmonics; ++h) S += PHt.middleRows<3>(3 * (part.first + 2 * h));
  }
  const Eigen::LDLT<Eigen::Matrix3d> solver(0.5 * (S + S.transpose()));
  x_ += PHt * solver.solve(z - expected);
  P_ -= PHt * solver.solve(PHt.transpose());
  P_ = (0.5 * (P_ + P_.transpose())).eval();
  keepFrequencies();
}

void HarmonicFilter::keepFrequencies() {
  for (const Part& part : parts_) {
    x_[part.frequency] = std::clamp(x_[part.frequency], kTwoPi * part.low_hz, kTwoPi * part.high_hz);
  }
}

void HarmonicFilter::shift(const Eigen::Vector3d& by, double std_m) {
  x_.head<3>() += by;
  P_.diagonal().head<3>().array() += std_m * std_m;
}

void HarmonicFilter::widen() {
  P_.diagonal().head<3>().array() += noise_.first_offset_std_m * noise_.first_offset_std_m;
  for (const Part& part : parts_) {
    P_(part.frequency, part.frequency) += part.frequency_variance;
    for (int h = 0; h < part.harmonics; ++h) {
      for (int i = 0; i < 2; ++i) P_.diagonal().segment<3>(3 * (part.first + 2 * h + i)) += part.variance.col(h);
    }
  }
}

double squaredMahalanobis(const Eigen::Vector3d& z, const Eigen::Matrix3d& S) { return z.dot(S.ldlt().solve(z)); }

TrendFilter::TrendFilter(const Eigen::Vector3d& position, const Eigen::Matrix3d& R, double first_speed_std_m_per_s,
                         double acceleration_density)
    : first_speed_std_(first_speed_std_m_per_s), density_(acceleration_density) {
  restart(position, R);
}

void TrendFilter::restart(const Eigen::Vector3d& z, const Eigen::Matrix3d& R) {
  x_ << z, Eigen::Vector3d::Zero();
  P_.setZero();
  P_.topLeftCorner<3, 3>() = R;
  P_.bottomRightCorner<3, 3>().diagonal().setConstant(first_speed_std_ * first_speed_std_);
}

void TrendFilter::advance(double dt) {
  x_.head<3>() += dt * x_.tail<3>();
  P_.topRows<3>() += dt * P_.bottomRows<3>().eval();
  P_.leftCols<3>() += dt * P_.rightCols<3>().eval();
  for (int i = 0; i < 3; ++i) {
    P_(i, i) += density_ * dt * dt * dt / 3;
    P_(i, i + 3) += density_ * dt * dt / 2;
    P_(i + 3, i) += density_ * dt * dt / 2;
    P_(i + 3, i + 3) += density_ * dt;
  }
}

PositionEstimate TrendFilter::ahead(double horizon_s) const {
  TrendFilter then = *this;
  then.advance(horizon_s);
  return {then.x_.head<3>(), then.P_.topLeftCorner<3, 3>()};
}

PositionEstimate TrendFilter::held(double horizon_s) const {
  const Eigen::Vector3d moved = horizon_s * x_.tail<3>();
  return {x_.head<3>(), ahead(horizon_s).covariance + moved * moved.transpose()};
}

void TrendFilter::correct(const Eigen::Vector3d& z, const Eigen::Matrix3d& R) {
  const Eigen::Matrix3d S = P_.topLeftCorner<3, 3>() + R;
  const Eigen::Matrix<double, 6, 3> K = S.ldlt().solve(P_.topRows<3>()).transpose();
  x_ += K * (z - x_.head<3>());
  // Joseph's form stays positive.
  Matrix6d A = Matrix6d::Identity();
  A.leftCols<3>() -= K;
  P_ = Matrix6d(A * P_ * A.transpose() + K * R * K.transpose());
}

}  // namespace angio::motion
