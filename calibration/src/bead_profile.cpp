// SPDX-License-Identifier: GPL-2.0-or-later
#include "bead_profile.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace angio::calibration {
namespace {

// What is not a ball's: ground (3), scatter, blur, stretch (2). All but the ground shape all rims alike and are held
// near what they usually are, with this standard deviation.
constexpr int kShared = 7, kOfBall = 4;
constexpr double kUsualScatter = 0.15, kScatterSpread = 0.15, kUsualBlur_px = 0.8, kBlurSpread_px = 0.4,
                 kStretchSpread = 0.05;
constexpr double kMargin_px = 4, kMargin = 0.5;  // Around a shadow, in pixels and in radii.

struct Pixel {
  Eigen::Vector2d at_px;
  double value, weight;
};

std::vector<Pixel> pixelsOf(const cv::Mat& image, const cv::Mat& mask, const ShadowGroup& group) {
  double left = 1e9, right = -1e9, top = 1e9, bottom = -1e9;
  const auto reach = [](const BallShadow& ball) { return ball.radius_px * (1 + kMargin) + kMargin_px; };
  for (const BallShadow& ball : group.balls) {
    left = std::min(left, ball.center_px.x() - reach(ball));
    right = std::max(right, ball.center_px.x() + reach(ball));
    top = std::min(top, ball.center_px.y() - reach(ball));
    bottom = std::max(bottom, ball.center_px.y() + reach(ball));
  }
  std::vector<Pixel> pixels;
  for (int y = std::max(0, static_cast<int>(top)); y <= std::min(image.rows - 1, static_cast<int>(bottom)); ++y) {
    for (int x = std::max(0, static_cast<int>(left)); x <= std::min(image.cols - 1, static_cast<int>(right)); ++x) {
      if (!mask.at<unsigned char>(y, x)) continue;
      const Eigen::Vector2d at_px(x, y);
      const bool near = std::any_of(group.balls.begin(), group.balls.end(), [&](const BallShadow& ball) {
        return (at_px - ball.center_px).squaredNorm() < reach(ball) * reach(ball);
      });
      if (!near) continue;
      const double value = image.at<float>(y, x);
      pixels.push_back({at_px, value, 1 / std::sqrt(std::max(1.0, value))});
    }
  }
  return pixels;
}

// Thickness with its derivatives by centre, radius, blur and stretch. With w = 1 - (d/r)^2 and e = 2 blur / r, the
// thickness is the root of e log(1 + exp(w / e)): w itself well inside, falling off exponentially outside.
using ShapeJacobian = Eigen::Matrix<double, 6, 1>;
double softThickness(const ShadowGroup& group, const BallShadow& ball, const Eigen::Vector2d& at_px, ShapeJacobian* J) {
  const Eigen::Vector2d d = at_px - ball.center_px;
  const double a = group.stretch.x(), b = group.stretch.y(), blur_px = group.blur_px;
  const Eigen::Vector2d Md((1 + a) * d.x() + b * d.y(), b * d.x() + (1 - a) * d.y());
  const double r = ball.radius_px, d2 = d.dot(Md), w = 1 - d2 / (r * r), e = 2 * blur_px / r, z = w / e;
  if (z < -30) {
    if (J) J->setZero();
    return 0;
  }
  const double tail = std::exp(-std::abs(z));
  const double plus = std::max(z, 0.0) + std::log1p(tail), slope = (z > 0 ? 1 : tail) / (1 + tail);
  const double g = std::sqrt(e * plus);
  if (J) {
    const double by_w = slope / (2 * g), by_e = (plus - z * slope) / (2 * g), by_d2 = -by_w / (r * r);
    J->head<2>() = -2 * by_d2 * Md;
    (*J)[2] = by_w * 2 * d2 / (r * r * r) - by_e * e / r;
    (*J)[3] = by_e * 2 / r;
    (*J)[4] = by_d2 * (d.x() * d.x() - d.y() * d.y());
    (*J)[5] = by_d2 * 2 * d.x() * d.y();
  }
  return g;
}

// Of a group of so many balls: matrices of a size that is known are summed without a call for each pixel.
template <int kBalls>
class GroupFit {
 public:
  static constexpr int kSize = kShared + kOfBall * kBalls;
  using Vector = Eigen::Matrix<double, kSize, 1>;
  using Matrix = Eigen::Matrix<double, kSize, kSize>;

  // Sum of squares, and its normal equations.
  struct Sums {
    double squares = 0;
    Matrix H = Matrix::Zero();
    Vector gradient = Vector::Zero();
  };

  GroupFit(std::vector<Pixel> pixels, const ShadowGroup& start)
      : pixels_(std::move(pixels)), origin_px_(start.balls.front().center_px) {}

  std::size_t pixels() const { return pixels_.size(); }

  // The ground and depths to start from: the brighter half of what is seen is ground.
  void startIn(ShadowGroup& group) const {
    std::vector<double> values;
    for (const Pixel& pixel : pixels_) values.push_back(pixel.value);
    const auto bright = values.begin() + static_cast<std::ptrdiff_t>(0.75 * static_cast<double>(values.size()));
    std::nth_element(values.begin(), bright, values.end());
    group.ground = {*bright, 0, 0};
  }

  Sums sums(const ShadowGroup& group) const {
    Sums sums;
    std::array<ShapeJacobian, kBalls> shapes;
    std::array<double, kBalls> thickness;
    for (const Pixel& pixel : pixels_) {
      double depth = 0;
      for (std::size_t k = 0; k < kBalls; ++k) {
        thickness[k] = softThickness(group, group.balls[k], pixel.at_px, &shapes[k]);
        depth += group.balls[k].depth * thickness[k];
      }
      const Eigen::Vector3d place(1, pixel.at_px.x() - origin_px_.x(), pixel.at_px.y() - origin_px_.y());
      const double ground = group.ground.dot(place), passed = std::exp(-depth);
      const double left = group.scatter + (1 - group.scatter) * passed;
      const double r = pixel.weight * (ground * left - pixel.value);
      sums.squares += r * r;
      Vector J;
      J.template head<3>() = left * place;
      J[3] = ground * (1 - passed);
      J.template segment<3>(4).setZero();
      const double by_depth = -ground * (1 - group.scatter) * passed;
      for (std::size_t k = 0; k < kBalls; ++k) {
        const auto at = kShared + kOfBall * static_cast<Eigen::Index>(k);
        J.template segment<3>(at) = by_depth * group.balls[k].depth * shapes[k].template head<3>();
        J[at + 3] = by_depth * thickness[k];
        J.template segment<3>(4) += by_depth * group.balls[k].depth * shapes[k].template tail<3>();
      }
      J *= pixel.weight;
      sums.H.noalias() += J * J.transpose();
      sums.gradient += r * J;
    }
    addPriors(group, sums);
    return sums;
  }

  static ShadowGroup moved(ShadowGroup group, const Vector& step) {
    group.ground += step.template head<3>();
    group.scatter = std::clamp(group.scatter + step[3], 0.0, 0.6);
    group.blur_px = std::clamp(group.blur_px + step[4], 0.2, 3.0);
    group.stretch =
        (group.stretch + step.template segment<2>(5)).cwiseMax(-group.max_stretch).cwiseMin(group.max_stretch);
    for (std::size_t k = 0; k < group.balls.size(); ++k) {
      const auto at = kShared + kOfBall * static_cast<Eigen::Index>(k);
      BallShadow& ball = group.balls[k];
      ball.center_px += step.template segment<2>(at);
      ball.radius_px *= std::exp(std::clamp(step[at + 2] / ball.radius_px, -0.3, 0.3));
      ball.depth = std::clamp(ball.depth + step[at + 3], 1e-3, 20.0);
    }
    return group;
  }

 private:
  // In units of the noise: of one per cent at ten thousand quanta, which is the order of an X-ray's.
  void addPriors(const ShadowGroup& group, Sums& sums) const {
    const double strength = std::max(1e-12, sums.squares / static_cast<double>(pixels_.size()));
    const double ds = (group.scatter - kUsualScatter) / kScatterSpread,
                 db = (group.blur_px - kUsualBlur_px) / kBlurSpread_px;
    sums.H(3, 3) += strength / (kScatterSpread * kScatterSpread);
    sums.H(4, 4) += strength / (kBlurSpread_px * kBlurSpread_px);
    sums.gradient[3] += strength * ds / kScatterSpread;
    sums.gradient[4] += strength * db / kBlurSpread_px;
    sums.H.diagonal().template segment<2>(5).array() += strength / (kStretchSpread * kStretchSpread);
    sums.gradient.template segment<2>(5) += strength / (kStretchSpread * kStretchSpread) * group.stretch;
  }

  std::vector<Pixel> pixels_;
  Eigen::Vector2d origin_px_;
};

template <int kBalls>
ShadowGroup fittedTo(std::vector<Pixel> pixels, ShadowGroup group) {
  using Fit = GroupFit<kBalls>;
  const Fit fit(std::move(pixels), group);
  if (fit.pixels() < 3 * static_cast<std::size_t>(Fit::kSize)) return group;
  fit.startIn(group);
  typename Fit::Sums sums = fit.sums(group);
  double damping = 1e-3;
  for (int i = 0; i < 40; ++i) {
    typename Fit::Matrix damped = sums.H;
    damped.diagonal() *= 1 + damping;
    const typename Fit::Vector step = -damped.ldlt().solve(sums.gradient);
    if (!step.allFinite()) return group;
    const ShadowGroup next = Fit::moved(group, step);
    const typename Fit::Sums now = fit.sums(next);
    if (now.squares < sums.squares) {
      double largest = 0;
      for (std::size_t k = 0; k < kBalls; ++k) {
        largest = std::max(largest, (next.balls[k].center_px - group.balls[k].center_px).norm());
      }
      const bool still = sums.squares - now.squares < 1e-6 * sums.squares && largest < 1e-4;
      group = next;
      sums = now;
      damping = std::max(1e-7, 0.2 * damping);
      if (still) break;
    } else if ((damping *= 8) > 1e8) {
      break;
    }
  }
  const double variance = sums.squares / static_cast<double>(fit.pixels() - static_cast<std::size_t>(Fit::kSize));
  const typename Fit::Vector scale = sums.H.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  typename Fit::Matrix scaled = scale.asDiagonal() * sums.H * scale.asDiagonal();
  scaled.diagonal().array() += 1e-10;
  const typename Fit::Matrix covariance = scaled.ldlt().solve(Fit::Matrix::Identity());
  group.stds_px.clear();
  for (std::size_t k = 0; k < kBalls; ++k) {
    const auto at = kShared + kOfBall * static_cast<Eigen::Index>(k);
    const double x = covariance(at, at) * scale[at] * scale[at];
    const double y = covariance(at + 1, at + 1) * scale[at + 1] * scale[at + 1];
    group.stds_px.push_back(std::sqrt(std::max(0.0, 0.5 * variance * (x + y))));
  }
  group.noise = std::sqrt(variance);
  group.fitted = group.ground[0] > 0;
  return group;
}

template <std::size_t... kLess>
ShadowGroup fittedOf(const cv::Mat& image, const cv::Mat& mask, ShadowGroup group, std::index_sequence<kLess...>) {
  using Fitting = ShadowGroup (*)(std::vector<Pixel>, ShadowGroup);
  static constexpr std::array<Fitting, sizeof...(kLess)> kFittings{fittedTo<static_cast<int>(kLess) + 1>...};
  group.fitted = false;
  std::vector<Pixel> pixels = pixelsOf(image, mask, group);
  return kFittings.at(group.balls.size() - 1)(std::move(pixels), std::move(group));
}

}  // namespace

double ShadowGroup::thickness(std::size_t ball, const Eigen::Vector2d& at_px) const {
  return softThickness(*this, balls[ball], at_px, nullptr);
}

double ShadowGroup::contrast(std::size_t ball) const {
  const double g = thickness(ball, balls[ball].center_px);
  return -std::log(scatter + (1 - scatter) * std::exp(-balls[ball].depth * g));
}

ShadowGroup fittedGroup(const cv::Mat& image, const cv::Mat& mask, ShadowGroup group) {
  return fittedOf(image, mask, std::move(group), std::make_index_sequence<kMaxBalls>());
}

}  // namespace angio::calibration
