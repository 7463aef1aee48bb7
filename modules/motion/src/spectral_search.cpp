// SPDX-License-Identifier: GPL-2.0-or-later
#include "spectral_search.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "harmonic_filter.hpp"

namespace angio::motion {
namespace {

constexpr double kNearlyAsGood = 1.15;  // Of what the best leaves unexplained.
// Squared Mahalanobis distance of a sample from what is slow, on average, up to which nothing moves: noise has 3.
constexpr double kStill = 1;

// Cosine and sine of f, 2 f ...: N x 2 harmonics.
void writeWaves(const Eigen::VectorXd& t, double frequency_hz, int harmonics, Eigen::Ref<Eigen::MatrixXd> A) {
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
}

// What is not slow, with an orthonormal basis of what is.
struct Residual {
  Eigen::VectorXd t;
  Eigen::MatrixXd slow;  // N x k, orthonormal.
  Eigen::MatrixXd Y;     // N x 3, in units of the noise: L^-1 of each position.
  Eigen::Matrix3d L_m;   // Root of the mean covariance: what is seen well and what is not need not be axes.
};

// Of the samples from `first` on.
Residual withoutSlow(const std::deque<MotionSample>& samples, std::size_t first, const PeriodSearch& search) {
  const auto n = static_cast<Eigen::Index>(samples.size() - first);
  Residual r;
  r.t.resize(n);
  r.Y.resize(n, 3);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (Eigen::Index i = 0; i < n; ++i) {
    const MotionSample& sample = samples[first + i];
    r.t[i] = sample.time_s - samples[first].time_s;
    r.Y.row(i) = (sample.position - samples[first].position).transpose();
    covariance += sample.covariance / static_cast<double>(n);
  }
  r.L_m = covariance.llt().matrixL();
  r.Y = r.L_m.triangularView<Eigen::Lower>().solve(r.Y.transpose()).transpose().eval();

  const Eigen::Index known = static_cast<Eigen::Index>(search.known_hz.size());
  r.slow.resize(n, 3 + 2 * known);
  const Eigen::ArrayXd u = r.t.array() / std::max(r.t[n - 1], 1e-9) - 0.5;
  r.slow.col(0).setOnes();
  r.slow.col(1) = u;
  r.slow.col(2) = u.square();
  for (Eigen::Index k = 0; k < known; ++k) {
    writeWaves(r.t, search.known_hz[k], 1, r.slow.middleCols<2>(3 + 2 * k));
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

// The waves of one frequency after the other, fitted to a residual.
class WaveFit {
 public:
  WaveFit(const Residual& r, int harmonics)
      : fixed_(r.slow.cols() + 3),
        harmonics_(harmonics),
        t_(r.t),
        whole_(r.Y.squaredNorm()),
        columns_(r.t.size(), fixed_ + 2 * harmonics),
        products_(columns_.cols(), 2 * harmonics) {
    columns_ << r.slow, r.Y, Eigen::MatrixXd::Zero(t_.size(), 2 * harmonics);
  }

  // What the waves leave of Y, which has nothing slow, when what they have slow themselves is let go: with A without
  // its slow part, |Y - A c|^2 of normal equations that are damped by d is |Y|^2 - c.(A^T Y) - d |c|^2.
  double left(double frequency_hz) {
    fit(frequency_hz);
    return whole_ - coefficients_.cwiseProduct(right_).sum() - damping() * coefficients_.squaredNorm();
  }

  // 2 harmonics x 3.
  const Eigen::MatrixXd& coefficients(double frequency_hz) {
    fit(frequency_hz);
    return coefficients_;
  }

 private:
  // A wave that the known ones hold already must not blow up.
  double damping() const { return 1e-4 * static_cast<double>(t_.size()); }

  void fit(double frequency_hz) {
    writeWaves(t_, frequency_hz, harmonics_, columns_.rightCols(2 * harmonics_));
    products_.noalias() = columns_.transpose() * columns_.rightCols(2 * harmonics_);
    const auto slow = products_.topRows(fixed_ - 3);
    Eigen::MatrixXd N = products_.bottomRows(2 * harmonics_) - slow.transpose() * slow;
    N.diagonal().array() += damping();
    right_ = products_.middleRows(fixed_ - 3, 3).transpose();
    coefficients_ = N.ldlt().solve(right_);
  }

  Eigen::Index fixed_;
  int harmonics_;
  Eigen::VectorXd t_;
  double whole_;
  Eigen::MatrixXd columns_;   // Slow, Y, waves.
  Eigen::MatrixXd products_;  // Of all of them with the waves.
  Eigen::MatrixXd right_, coefficients_;
};

}  // namespace

std::size_t firstFrom(const std::deque<MotionSample>& samples, double from_s) {
  const auto first = std::lower_bound(samples.begin(), samples.end(), from_s,
                                      [](const MotionSample& s, double t) { return s.time_s < t; });
  return static_cast<std::size_t>(first - samples.begin());
}

std::optional<FoundPeriod> findPeriod(const std::deque<MotionSample>& samples, double from_s,
                                      const PeriodSearch& search) {
  if (search.harmonics < 1 || samples.empty() || !(search.low_hz <= search.high_hz)) return std::nullopt;
  const std::size_t first = firstFrom(samples, from_s);
  if (samples.size() - first < 3 * (3 + 2 * (search.harmonics + search.known_hz.size()))) return std::nullopt;
  const Residual r = withoutSlow(samples, first, search);
  const double whole = r.Y.squaredNorm();
  if (!(whole > kStill * static_cast<double>(r.t.size()))) return std::nullopt;
  WaveFit fit(r, search.harmonics);
  const auto steps = static_cast<int>(std::floor((search.high_hz - search.low_hz) / search.step_hz)) + 1;
  std::vector<double> left(static_cast<std::size_t>(steps));
  for (int k = 0; k < steps; ++k) {
    left[k] = fit.left(search.low_hz + k * search.step_hz);
  }
  const auto least = std::min_element(left.begin(), left.end());
  const double best = *least;
  if (!(best <= (1 - search.min_share) * whole)) return std::nullopt;
  // A best that lies at the slow end is the flank of something slower.
  if (left.front() <= best) return std::nullopt;
  // The shortest period among the minima that leave hardly more, rounding of exact fits included.
  const double bound = kNearlyAsGood * best + 1e-3 * whole;
  int chosen = static_cast<int>(least - left.begin());
  for (int k = steps - 1; k > chosen; --k) {
    const bool minimum = left[k] <= left[k - 1] && (k + 1 == steps || left[k] <= left[k + 1]);
    if (!minimum || left[k] > bound) continue;
    chosen = k;
    break;
  }
  FoundPeriod found;
  found.frequency_hz = search.low_hz + chosen * search.step_hz;
  found.share = 1 - left[chosen] / whole;
  const Eigen::MatrixXd coefficients = fit.coefficients(found.frequency_hz) * r.L_m.transpose();
  found.amplitude_m.resize(3, search.harmonics);
  for (int h = 0; h < search.harmonics; ++h) {
    found.amplitude_m.col(h) = coefficients.middleRows<2>(2 * h).colwise().norm().transpose();
  }
  return found;
}

}  // namespace angio::motion
