// SPDX-License-Identifier: GPL-2.0-or-later
#include "bead_profile.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "angio/geometry/decompositions.hpp"
#include "information.hpp"

namespace angio::calibration {
namespace {

// What is not a ball's: ground (3), scatter, blur, stretch (2). All but the ground shape all rims alike and are held
// near what they usually are, with this standard deviation.
constexpr int kShared = 7, kOfBall = 4;
constexpr double kUsualScatter = 0.15, kScatterSpread = 0.15, kUsualBlur_px = 0.8, kBlurSpread_px = 0.4,
                 kStretchSpread = 0.05;
constexpr int kHuberRounds = 4;
constexpr double kHuberStds = 1.5, kMedianToStd = 1.4826;
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

// Pixels' sum of squares, and its normal equations.
struct Sums {
  double squares = 0;
  Eigen::MatrixXd H;
  Eigen::VectorXd gradient;
};

Eigen::Index placeOf(std::size_t ball) { return kShared + kOfBall * static_cast<Eigen::Index>(ball); }

// Of a group of so many balls: matrices of a size that is known are summed without a call for each pixel.
template <std::size_t kBalls>
Sums sumsOf(const std::vector<Pixel>& pixels, const Eigen::Vector2d& origin_px, const ShadowGroup& group) {
  constexpr int kSize = kShared + kOfBall * static_cast<int>(kBalls);
  using Vector = Eigen::Matrix<double, kSize, 1>;
  Eigen::Matrix<double, kSize, kSize> H = Eigen::Matrix<double, kSize, kSize>::Zero();
  Vector gradient = Vector::Zero();
  double squares = 0;
  std::array<ShapeJacobian, kBalls> shapes;
  std::array<double, kBalls> thickness;
  for (const Pixel& pixel : pixels) {
    double depth = 0;
    for (std::size_t k = 0; k < kBalls; ++k) {
      thickness[k] = softThickness(group, group.balls[k], pixel.at_px, &shapes[k]);
      depth += group.balls[k].depth * thickness[k];
    }
    const Eigen::Vector3d place(1, pixel.at_px.x() - origin_px.x(), pixel.at_px.y() - origin_px.y());
    const double ground = group.ground.dot(place), passed = std::exp(-depth);
    const double left = group.scatter + (1 - group.scatter) * passed;
    const double r = pixel.weight * (ground * left - pixel.value);
    squares += r * r;
    Vector J;
    J.template head<3>() = left * place;
    J[3] = ground * (1 - passed);
    J.template segment<3>(4).setZero();
    const double by_depth = -ground * (1 - group.scatter) * passed;
    for (std::size_t k = 0; k < kBalls; ++k) {
      J.template segment<3>(placeOf(k)) = by_depth * group.balls[k].depth * shapes[k].template head<3>();
      J[placeOf(k) + 3] = by_depth * thickness[k];
      J.template segment<3>(4) += by_depth * group.balls[k].depth * shapes[k].template tail<3>();
    }
    J *= pixel.weight;
    H.noalias() += J * J.transpose();
    gradient += r * J;
  }
  return {squares, H, gradient};
}

using Summing = Sums (*)(const std::vector<Pixel>&, const Eigen::Vector2d&, const ShadowGroup&);

template <std::size_t... kLess>
Summing summingOf(std::size_t balls, std::index_sequence<kLess...>) {
  static constexpr std::array<Summing, sizeof...(kLess)> kSummings{sumsOf<kLess + 1>...};
  return kSummings.at(balls - 1);
}

// Of the pixels around a group.
class GroupFit {
 public:
  GroupFit(std::vector<Pixel> pixels, const ShadowGroup& start)
      : pixels_(std::move(pixels)),
        origin_px_(start.balls.front().center_px),
        pixel_sums_(summingOf(start.balls.size(), std::make_index_sequence<kMaxBalls>())) {}

  std::size_t pixels() const { return pixels_.size(); }

  // The ground to start from: the brighter part of what is seen.
  void startIn(ShadowGroup& group) const {
    std::vector<double> values;
    for (const Pixel& pixel : pixels_) values.push_back(pixel.value);
    const auto bright = values.begin() + static_cast<std::ptrdiff_t>(0.75 * static_cast<double>(values.size()));
    std::nth_element(values.begin(), bright, values.end());
    group.ground = {*bright, 0, 0};
  }

  Sums sums(const ShadowGroup& group) const {
    Sums sums = pixel_sums_(pixels_, origin_px_, group);
    addPriors(group, sums);
    return sums;
  }

  static ShadowGroup moved(ShadowGroup group, const Eigen::VectorXd& step) {
    group.ground += step.head<3>();
    group.scatter = std::clamp(group.scatter + step[3], 0.0, 0.6);
    group.blur_px = std::clamp(group.blur_px + step[4], 0.2, 3.0);
    group.stretch = (group.stretch + step.segment<2>(5)).cwiseMax(-group.max_stretch).cwiseMin(group.max_stretch);
    for (std::size_t k = 0; k < group.balls.size(); ++k) {
      const Eigen::Index at = placeOf(k);
      BallShadow& ball = group.balls[k];
      ball.center_px += step.segment<2>(at);
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
    sums.H.diagonal().segment<2>(5).array() += strength / (kStretchSpread * kStretchSpread);
    sums.gradient.segment<2>(5) += strength / (kStretchSpread * kStretchSpread) * group.stretch;
  }

  std::vector<Pixel> pixels_;
  Eigen::Vector2d origin_px_;
  Summing pixel_sums_;
};

ShadowGroup fittedTo(std::vector<Pixel> pixels, ShadowGroup group) {
  const auto size = static_cast<std::size_t>(placeOf(group.balls.size()));
  group.ground_origin_px = group.balls.front().center_px;
  const GroupFit fit(std::move(pixels), group);
  if (fit.pixels() < 3 * size) return group;
  fit.startIn(group);
  Sums sums = fit.sums(group);
  double damping = 1e-3;
  for (int i = 0; i < 40; ++i) {
    Eigen::MatrixXd damped = sums.H;
    damped.diagonal() *= 1 + damping;
    const Eigen::VectorXd step = -solveSymmetric(damped, sums.gradient);
    if (!step.allFinite()) return group;
    const ShadowGroup next = GroupFit::moved(group, step);
    const Sums now = fit.sums(next);
    if (now.squares < sums.squares) {
      double largest = 0;
      for (std::size_t k = 0; k < group.balls.size(); ++k) {
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
  const double variance = sums.squares / static_cast<double>(fit.pixels() - size);
  const Eigen::VectorXd variances = covarianceOf(sums.H, 1e-10).diagonal();
  group.stds_px.clear();
  for (std::size_t k = 0; k < group.balls.size(); ++k) {
    const double both = variances.segment<2>(placeOf(k)).sum();
    group.stds_px.push_back(std::sqrt(std::max(0.0, 0.5 * variance * both)));
  }
  group.noise = std::sqrt(variance);
  group.fitted = group.ground[0] > 0;
  return group;
}

// With less weight for pixels that are far off the fit, by the median of all.
std::vector<Pixel> huberWeighted(std::vector<Pixel> pixels, const ShadowGroup& group) {
  std::vector<double> off;
  for (const Pixel& pixel : pixels) {
    double depth = 0;
    for (std::size_t k = 0; k < group.balls.size(); ++k) {
      depth += group.balls[k].depth * group.thickness(k, pixel.at_px);
    }
    const Eigen::Vector2d from = pixel.at_px - group.ground_origin_px;
    const double ground = group.ground.dot(Eigen::Vector3d(1, from.x(), from.y()));
    const double left = group.scatter + (1 - group.scatter) * std::exp(-depth);
    off.push_back(pixel.weight * std::abs(ground * left - pixel.value));
  }
  std::vector<double> sorted = off;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const double bound = kHuberStds * kMedianToStd * *middle;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (off[i] > bound) pixels[i].weight *= std::sqrt(bound / off[i]);
  }
  return pixels;
}

}  // namespace

double ShadowGroup::thickness(std::size_t ball, const Eigen::Vector2d& at_px) const {
  return softThickness(*this, balls[ball], at_px, nullptr);
}

double ShadowGroup::contrast(std::size_t ball) const {
  const double g = thickness(ball, balls[ball].center_px);
  return -std::log(scatter + (1 - scatter) * std::exp(-balls[ball].depth * g));
}

ShadowGroup fittedGroup(const cv::Mat& image, const cv::Mat& mask, ShadowGroup group, PixelLoss loss) {
  group.fitted = false;
  const std::vector<Pixel> pixels = pixelsOf(image, mask, group);
  group = fittedTo(pixels, std::move(group));
  for (int round = 0; loss == PixelLoss::kHuber && round < kHuberRounds; ++round) {
    group = fittedTo(huberWeighted(pixels, group), std::move(group));
  }
  return group;
}

}  // namespace angio::calibration
