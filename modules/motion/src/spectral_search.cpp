// SPDX-License-Identifier: GPL-2.0-or-later
#include "spectral_search.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace angio {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr double kNearlyAsGood = 1.15;  // Of what the best leaves unexplained.

// Cosine and sine of f, 2 f ...: N x 2 harmonics.
Eigen::MatrixXd waves(const Eigen::VectorXd& t, double frequency_hz, int harmonics) {
  Eigen::MatrixXd A(t.size(), 2 * harmonics);
  for (Eigen::Index i = 0; i < t.size(); ++i) {
    const double angle = kTwoPi * frequency_hz * t[i], c = std::cos(angle), s = std::sin(angle);
    double ch = c, sh = s;
    for (int h = 0; h < harmonics; ++h) {
      A(i, 2 * h) = ch;
      A(i, 2 * h + 1) = sh;
      const double next = c * ch - s * sh;
      sh = s * ch + c * sh;
      ch = next;
    }
  }
  return A;
}

// Normal equations with a touch of damping: a wave that the known ones hold already must not blow up.
Eigen::MatrixXd fitted(const Eigen::MatrixXd& A, const Eigen::MatrixXd& Y) {
  Eigen::MatrixXd N = A.transpose() * A;
  N.diagonal().array() += 1e-4 * static_cast<double>(A.rows());
  return N.ldlt().solve(A.transpose() * Y);
}

// What is not slow, with an orthonormal basis of what is.
struct Residual {
  Eigen::VectorXd t;
  Eigen::MatrixXd slow;  // N x k, orthonormal.
  Eigen::MatrixXd Y;     // N x 3, each axis in units of its noise.
  Eigen::Vector3d noise_m;
};

Residual withoutSlow(const std::deque<MotionSample>& samples, double from_s, const PeriodSearch& search) {
  const auto first = std::lower_bound(samples.begin(), samples.end(), from_s,
                                      [](const MotionSample& s, double t) { return s.time_s < t; });
  const Eigen::Index n = samples.end() - first;
  Residual r;
  r.t.resize(n);
  r.Y.resize(n, 3);
  Eigen::Vector3d variance = Eigen::Vector3d::Zero();
  for (Eigen::Index i = 0; i < n; ++i) {
    const MotionSample& sample = first[i];
    r.t[i] = sample.time_s - first->time_s;
    r.Y.row(i) = (sample.position - first->position).transpose();
    variance += sample.covariance.diagonal();
  }
  r.noise_m = (variance / static_cast<double>(std::max<Eigen::Index>(n, 1))).cwiseSqrt();
  r.Y = (r.Y * r.noise_m.cwiseInverse().asDiagonal()).eval();

  const Eigen::Index known = static_cast<Eigen::Index>(search.known_hz.size());
  r.slow.resize(n, 3 + 2 * known);
  const Eigen::ArrayXd u = r.t.array() / std::max(r.t[n - 1], 1e-9) - 0.5;
  r.slow.col(0).setOnes();
  r.slow.col(1) = u;
  r.slow.col(2) = u.square();
  for (Eigen::Index k = 0; k < known; ++k) {
    r.slow.middleCols<2>(3 + 2 * k) = waves(r.t, search.known_hz[static_cast<std::size_t>(k)], 1);
  }
  // Gram and Schmidt, twice for accuracy; a column that has nothing of its own is let go.
  Eigen::Index kept = 0;
  for (Eigen::Index k = 0; k < r.slow.cols(); ++k) {
    Eigen::VectorXd column = r.slow.col(k);
    const double before = column.norm();
    for (int pass = 0; pass < 2; ++pass) {
      column -= r.slow.leftCols(kept) * (r.slow.leftCols(kept).transpose() * column);
    }
    if (column.norm() > 1e-3 * before) r.slow.col(kept++) = column.normalized();
  }
  r.slow.conservativeResize(n, kept);
  r.Y -= r.slow * (r.slow.transpose() * r.Y);
  return r;
}

}  // namespace

std::optional<FoundPeriod> findPeriod(const std::deque<MotionSample>& samples, double from_s,
                                      const PeriodSearch& search) {
  if (search.harmonics < 1 || samples.empty() || !(search.low_hz <= search.high_hz)) return std::nullopt;
  const auto enough = static_cast<std::size_t>(3 * (3 + 2 * (search.harmonics + search.known_hz.size())));
  const auto first = std::lower_bound(samples.begin(), samples.end(), from_s,
                                      [](const MotionSample& s, double t) { return s.time_s < t; });
  if (static_cast<std::size_t>(samples.end() - first) < enough) return std::nullopt;
  const Residual r = withoutSlow(samples, from_s, search);
  const double whole = r.Y.squaredNorm();
  const auto steps = static_cast<int>(std::floor((search.high_hz - search.low_hz) / search.step_hz)) + 1;
  std::vector<double> left(static_cast<std::size_t>(steps));
  for (int k = 0; k < steps; ++k) {
    Eigen::MatrixXd A = waves(r.t, search.low_hz + k * search.step_hz, search.harmonics);
    A -= r.slow * (r.slow.transpose() * A);
    left[static_cast<std::size_t>(k)] = (r.Y - A * fitted(A, r.Y)).squaredNorm();
  }
  const double best = *std::min_element(left.begin(), left.end());
  if (!(whole > 0) || !(best <= (1 - search.least_share) * whole)) return std::nullopt;
  // A best that lies at the slow end is the flank of something slower.
  if (left.front() <= best) return std::nullopt;
  // The shortest period among the minima that leave hardly more, rounding of exact fits included.
  const double bound = kNearlyAsGood * best + 1e-3 * whole;
  int chosen = static_cast<int>(std::min_element(left.begin(), left.end()) - left.begin());
  for (int k = steps - 1; k > chosen; --k) {
    const auto i = static_cast<std::size_t>(k);
    const bool minimum = left[i] <= left[i - 1] && (k + 1 == steps || left[i] <= left[i + 1]);
    if (!minimum || left[i] > bound) continue;
    chosen = k;
    break;
  }
  FoundPeriod found;
  found.frequency_hz = search.low_hz + chosen * search.step_hz;
  found.share = 1 - left[static_cast<std::size_t>(chosen)] / whole;
  Eigen::MatrixXd A = waves(r.t, found.frequency_hz, search.harmonics);
  A -= r.slow * (r.slow.transpose() * A);
  const Eigen::MatrixXd coefficients = fitted(A, r.Y) * r.noise_m.asDiagonal();
  found.amplitude_m.resize(3, search.harmonics);
  for (int h = 0; h < search.harmonics; ++h) {
    found.amplitude_m.col(h) = coefficients.middleRows<2>(2 * h).colwise().norm().transpose();
  }
  return found;
}

}  // namespace angio
