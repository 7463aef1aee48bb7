// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/bead_detection.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/imaging/collimator_opening.hpp"
#include "bead_profile.hpp"

namespace angio::calibration {
namespace {

constexpr double kBlobScaleStep = 1.25;  // Between the radii that are looked for.
constexpr double kBlobOfRadius = 0.58;   // Standard deviation of the blob that answers a ball's shadow best, in radii.
constexpr int kFieldMargin_px = 2;       // Of the open field, where its edge is soft.
// One shadow that is fitted by two balls, nearer than so many radii: one explains it with so little more misfit.
constexpr double kMaybeOne = 0.8, kMisfitOfOne = 1.25;

// What may be a ball, and how much of a blob it is.
struct BeadCandidate {
  BallShadow ball;
  double response = 0;
};

// Pixels that the collimator leaves open, without its soft edge: not zero there (CV_8UC1).
cv::Mat openPixels(const cv::Mat& image) {
  const OpenField field = findOpenField(image);
  if (field.polygon_px.empty()) return cv::Mat(image.size(), CV_8UC1, cv::Scalar(255));
  cv::Mat inner;
  cv::erode(field.mask, inner, cv::Mat(), {-1, -1}, kFieldMargin_px, cv::BORDER_CONSTANT, cv::Scalar(255));
  return inner;
}

// Absorption above its surroundings (CV_32FC1) of grey values (CV_32FC1): what is wider than a ball is ground.
cv::Mat withoutGround(const cv::Mat& values, double max_radius_px) {
  cv::Mat absorption;
  cv::log(cv::max(values, 1), absorption);
  absorption = -absorption;
  cv::Mat smooth, small, ground;
  cv::GaussianBlur(absorption, smooth, {0, 0}, 1.0);
  cv::resize(smooth, small, {}, 0.5, 0.5, cv::INTER_AREA);
  const int side = 2 * static_cast<int>(std::ceil(1.2 * max_radius_px)) + 1;  // At half the size: 2.4 radii each way.
  cv::morphologyEx(small, small, cv::MORPH_OPEN, cv::getStructuringElement(cv::MORPH_RECT, {side, side}));
  cv::GaussianBlur(small, small, {0, 0}, 0.25 * side);
  cv::resize(small, ground, absorption.size(), 0, 0, cv::INTER_LINEAR);
  return absorption - ground;
}

// Blobs over all scales, strongest first, each where it answers more than its neighbours in place and scale do, and
// `min_response` at least, where `mask` (CV_8UC1) is not zero.
std::vector<BeadCandidate> blobs(const cv::Mat& above_ground, const cv::Mat& mask,
                                 const BeadDetectionSettings& settings, double min_response) {
  std::vector<double> radii;
  for (double r = settings.min_radius_px; r < settings.max_radius_px * kBlobScaleStep; r *= kBlobScaleStep) {
    radii.push_back(r);
  }
  std::vector<cv::Mat> responses;
  for (const double r : radii) {
    const double sigma = kBlobOfRadius * r;
    cv::Mat smooth, laplacian;
    // Ground goes on beyond the border: a mirror image there would draw the blob of a ball that is cut onto it.
    cv::GaussianBlur(above_ground, smooth, {0, 0}, sigma, 0, cv::BORDER_CONSTANT);
    cv::Laplacian(smooth, laplacian, CV_32F, 1, 1, 0, cv::BORDER_CONSTANT);
    responses.push_back(-sigma * sigma * laplacian);
  }
  std::vector<BeadCandidate> found;
  const int border = std::max(1, static_cast<int>(settings.border_px));
  for (std::size_t s = 0; s < responses.size(); ++s) {
    for (int y = border; y < above_ground.rows - border; ++y) {
      const float* const row = responses[s].ptr<float>(y);
      for (int x = border; x < above_ground.cols - border; ++x) {
        const float value = row[x];
        if (value < min_response || !mask.at<unsigned char>(y, x)) continue;
        bool largest = true;
        for (std::size_t other = s > 0 ? s - 1 : 0; other <= std::min(s + 1, responses.size() - 1) && largest;
             ++other) {
          for (int dy = -1; dy <= 1 && largest; ++dy) {
            const float* const near = responses[other].ptr<float>(y + dy);
            largest = near[x - 1] <= value && near[x] <= value && near[x + 1] <= value;
          }
        }
        if (largest) found.push_back({{Eigen::Vector2d(x, y), radii[s], 1}, value});
      }
    }
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const BeadCandidate& a, const BeadCandidate& b) { return a.response > b.response; });
  return found;
}

constexpr double kApart = 0.5;     // Centres of two balls, in radii of the larger one, at least.
constexpr double kSameBall = 0.3;  // Nearer, after the fit, it is one.

bool isNear(const BallShadow& a, const BallShadow& b, double radii) {
  return (a.center_px - b.center_px).norm() < radii * std::max(a.radius_px, b.radius_px);
}

bool areSame(const std::vector<BallShadow>& a, const std::vector<BallShadow>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const BallShadow& one, const BallShadow& other) {
    return one.center_px == other.center_px && one.radius_px == other.radius_px;
  });
}

// Groups of shadows that touch, by first ball.
std::vector<std::vector<BallShadow>> touching(const std::vector<BallShadow>& balls) {
  std::vector<std::size_t> group(balls.size());
  std::iota(group.begin(), group.end(), std::size_t{0});
  std::vector<std::size_t> sizes(balls.size(), 1);
  for (std::size_t i = 0; i < balls.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double reach = 1.15 * (balls[i].radius_px + balls[j].radius_px) + 2;
      if (group[i] == group[j] || (balls[i].center_px - balls[j].center_px).norm() > reach) continue;
      const std::size_t from = std::max(group[i], group[j]), to = std::min(group[i], group[j]);
      if (sizes[from] + sizes[to] > kMaxBalls) continue;
      sizes[to] += sizes[from];
      std::replace(group.begin(), group.end(), from, to);
    }
  }
  std::vector<std::vector<BallShadow>> groups(balls.size());
  for (std::size_t i = 0; i < balls.size(); ++i) groups[group[i]].push_back(balls[i]);
  groups.erase(std::remove_if(groups.begin(), groups.end(), [](const auto& g) { return g.empty(); }), groups.end());
  return groups;
}

class BeadFinder {
 public:
  BeadFinder(const cv::Mat& image, const BeadDetectionSettings& settings) : settings_(settings) {
    image.convertTo(values_, CV_32F);
    mask_ = openPixels(image);
    above_ground_ = withoutGround(values_, settings.max_radius_px);
    cv::Mat second;
    cv::Laplacian(above_ground_, second, CV_32F, 1);
    std::vector<float> sample;
    for (int y = 0; y < second.rows; y += 3) {
      for (int x = 0; x < second.cols; x += 3) {
        if (mask_.at<unsigned char>(y, x)) sample.push_back(std::abs(second.at<float>(y, x)));
      }
    }
    if (sample.empty()) return;
    std::nth_element(sample.begin(), sample.begin() + sample.size() / 2, sample.end());
    noise_ = 1.4826 * sample[sample.size() / 2] / std::sqrt(20.0);  // Laplacian's weights squared: 16 + 4.
  }

  std::vector<BeadDetection> find() {
    std::vector<BallShadow> balls = apart(blobs(above_ground_, mask_, settings_, minResponse()), {});
    std::vector<ShadowGroup> groups = fitted(balls, {});
    // Balls that others hide show in what the others leave over.
    balls.clear();
    for (const ShadowGroup& group : groups) balls.insert(balls.end(), group.balls.begin(), group.balls.end());
    const auto hidden = apart(blobs(leftOver(groups), mask_, settings_, minResponse()), balls);
    if (!hidden.empty()) {
      balls.insert(balls.end(), hidden.begin(), hidden.end());
      groups = fitted(balls, groups);
    }
    std::vector<BeadDetection> found;
    for (const ShadowGroup& group : onePerBall(std::move(groups))) {
      for (std::size_t k = 0; k < group.balls.size(); ++k) {
        const BallShadow& ball = group.balls[k];
        found.push_back({ball.center_px, group.stds_px[k], ball.radius_px, group.contrast(k), {}});
      }
    }
    std::sort(found.begin(), found.end(), [](const BeadDetection& a, const BeadDetection& b) {
      return std::make_pair(a.center_px.y(), a.center_px.x()) < std::make_pair(b.center_px.y(), b.center_px.x());
    });
    return found;
  }

 private:
  // A ball's blob answers with a third of its contrast or more.
  double minResponse() const { return 0.3 * settings_.min_contrast; }

  std::vector<BallShadow> apart(const std::vector<BeadCandidate>& candidates,
                                const std::vector<BallShadow>& others) const {
    std::vector<BallShadow> kept;
    for (const BeadCandidate& candidate : candidates) {
      const auto near = [&](const BallShadow& other) { return isNear(candidate.ball, other, 2 * kApart); };
      const auto on = [&](const BallShadow& other) { return isNear(candidate.ball, other, kApart); };
      if (std::any_of(kept.begin(), kept.end(), near) || std::any_of(others.begin(), others.end(), on)) continue;
      kept.push_back(candidate.ball);
      kept.back().depth = std::max(0.2, 2 * candidate.response);
    }
    return kept;
  }

  bool isBall(const ShadowGroup& group, std::size_t k) const {
    const BallShadow& ball = group.balls[k];
    const double contrast = group.contrast(k);
    const double area_px = kPi * ball.radius_px * ball.radius_px;
    const Eigen::Vector2d p = ball.center_px;
    const double edge = settings_.border_px;
    const bool inside =
        p.x() >= edge && p.y() >= edge && p.x() <= values_.cols - 1 - edge && p.y() <= values_.rows - 1 - edge &&
        mask_.at<unsigned char>(static_cast<int>(std::lround(p.y())), static_cast<int>(std::lround(p.x())));
    return inside && ball.radius_px > settings_.min_radius_px / kBlobScaleStep &&
           ball.radius_px < settings_.max_radius_px * kBlobScaleStep && contrast > settings_.min_contrast &&
           contrast * std::sqrt(area_px) > settings_.min_significance * noise_ && group.stds_px[k] < 0.5;
  }

  // The noise of quanta as fits see it: grey values' standard deviation over their root.
  double grainOf(const ShadowGroup& group) const { return noise_ * std::sqrt(std::max(1.0, group.ground[0])); }

  bool fits(const ShadowGroup& group) const {
    return group.fitted && !group.balls.empty() &&
           group.noise <= settings_.max_misfit * std::max(grainOf(group), 0.02 * std::sqrt(group.ground[0]));
  }

  // Fitted without what is no ball.
  ShadowGroup cleaned(ShadowGroup group) const {
    while (!group.balls.empty()) {
      group = fittedGroup(values_, mask_, group);
      if (!group.fitted) break;
      std::vector<BallShadow> kept;
      for (std::size_t k = 0; k < group.balls.size(); ++k) {
        const auto before = [&](const BallShadow& other) { return isNear(group.balls[k], other, kSameBall); };
        if (isBall(group, k) && std::none_of(kept.begin(), kept.end(), before)) kept.push_back(group.balls[k]);
      }
      if (kept.size() == group.balls.size()) break;
      group.balls = std::move(kept);
    }
    return group;
  }

  // With the widest shadow taken for two side by side, whichever way explains it best.
  ShadowGroup split(const ShadowGroup& group) const {
    const auto widest =
        std::max_element(group.balls.begin(), group.balls.end(),
                         [](const BallShadow& a, const BallShadow& b) { return a.radius_px < b.radius_px; }) -
        group.balls.begin();
    ShadowGroup best;
    for (int k = 0; k < 4; ++k) {
      ShadowGroup parts = group;
      BallShadow& one = parts.balls[widest];
      const Eigen::Vector2d side = 0.5 * one.radius_px * Eigen::Vector2d(std::cos(k * kPi / 4), std::sin(k * kPi / 4));
      BallShadow other = one;
      one.radius_px = other.radius_px = 0.75 * one.radius_px;
      one.center_px += side;
      other.center_px -= side;
      parts.balls.push_back(other);
      parts = cleaned(parts);
      if (fits(parts) && (!best.fitted || parts.noise < best.noise)) best = std::move(parts);
    }
    return best;
  }

  // With two balls in one place taken for one wherever that explains the shadows about as well: blobs of two scales in
  // one shadow give two balls, each beside its middle, which fit it as well as the one that it is of.
  ShadowGroup merged(ShadowGroup group) const {
    for (std::size_t a = 0; a < group.balls.size(); ++a) {
      for (std::size_t b = a + 1; b < group.balls.size(); ++b) {
        if (!isNear(group.balls[a], group.balls[b], kMaybeOne)) continue;
        ShadowGroup less = group;
        BallShadow& one = less.balls[a];
        one.center_px = 0.5 * (group.balls[a].center_px + group.balls[b].center_px);
        one.radius_px = std::max(group.balls[a].radius_px, group.balls[b].radius_px);
        less.balls.erase(less.balls.begin() + static_cast<std::ptrdiff_t>(b));
        less = cleaned(less);
        if (less.balls.empty() || !fits(less) || less.noise > kMisfitOfOne * group.noise) continue;
        return merged(std::move(less));
      }
    }
    return group;
  }

  // Fits of a wire's pieces may end on a bead that another group has: it is fitted anew, by itself, and the pixels that
  // are off, as the wire's, count less.
  std::vector<ShadowGroup> onePerBall(std::vector<ShadowGroup> groups) const {
    std::vector<ShadowGroup> contested;
    for (std::size_t g = 0; g < groups.size(); ++g) {
      for (std::size_t k = 0; k < groups[g].balls.size(); ++k) {
        ShadowGroup alone;
        alone.balls = {groups[g].balls[k]};
        alone.max_stretch = settings_.max_stretch;
        bool shared = false;
        for (std::size_t other = g + 1; other < groups.size(); ++other) {
          shared |= removeNear(alone.balls.front(), groups[other]);
        }
        if (!shared) continue;
        ShadowGroup fit = fittedGroup(values_, mask_, alone, PixelLoss::kHuber);
        removeNear(alone.balls.front(), groups[g]);
        --k;
        if (fit.fitted && isBall(fit, 0)) contested.push_back(std::move(fit));
      }
    }
    groups.insert(groups.end(), contested.begin(), contested.end());
    return groups;
  }

  // Takes the balls in one place with another out of a group; whether there were any. The other is as wide as they.
  static bool removeNear(BallShadow& ball, ShadowGroup& group) {
    bool removed = false;
    for (std::size_t k = group.balls.size(); k-- > 0;) {
      if (!isNear(ball, group.balls[k], kSameBall)) continue;
      ball.radius_px = std::max(ball.radius_px, group.balls[k].radius_px);
      group.balls.erase(group.balls.begin() + static_cast<std::ptrdiff_t>(k));
      group.stds_px.erase(group.stds_px.begin() + static_cast<std::ptrdiff_t>(k));
      removed = true;
    }
    return removed;
  }

  // Group by group; one that is not explained is tried with a ball more, and one that was explained before stays.
  std::vector<ShadowGroup> fitted(const std::vector<BallShadow>& balls, const std::vector<ShadowGroup>& before) const {
    std::vector<ShadowGroup> groups;
    for (auto& members : touching(balls)) {
      const auto same = std::find_if(before.begin(), before.end(),
                                     [&](const ShadowGroup& group) { return areSame(group.balls, members); });
      if (same != before.end()) {
        groups.push_back(*same);
        continue;
      }
      ShadowGroup start;
      start.balls = std::move(members);
      start.max_stretch = settings_.max_stretch;
      ShadowGroup group = cleaned(start);
      if (!fits(group) && start.balls.size() < kMaxBalls) group = split(start);
      if (fits(group)) groups.push_back(merged(std::move(group)));
    }
    return groups;
  }

  cv::Mat leftOver(const std::vector<ShadowGroup>& groups) const {
    cv::Mat rest = above_ground_.clone();
    for (const ShadowGroup& group : groups) {
      for (std::size_t k = 0; k < group.balls.size(); ++k) {
        const BallShadow& ball = group.balls[k];
        const int reach = static_cast<int>(1.6 * ball.radius_px + 4);
        const int cx = static_cast<int>(ball.center_px.x()), cy = static_cast<int>(ball.center_px.y());
        for (int y = std::max(0, cy - reach); y <= std::min(rest.rows - 1, cy + reach); ++y) {
          for (int x = std::max(0, cx - reach); x <= std::min(rest.cols - 1, cx + reach); ++x) {
            const double g = group.thickness(k, Eigen::Vector2d(x, y));
            rest.at<float>(y, x) +=
                static_cast<float>(std::log(group.scatter + (1 - group.scatter) * std::exp(-ball.depth * g)));
          }
        }
      }
    }
    return rest;
  }

  BeadDetectionSettings settings_;
  cv::Mat values_, mask_, above_ground_;
  double noise_ = 0;  // Of a pixel's absorption.
};

}  // namespace

std::vector<BeadDetection> detectBeads(const cv::Mat& image, const BeadDetectionSettings& settings) {
  checkSettings("bead detection", settings);
  if (image.empty() || (image.type() != CV_8UC1 && image.type() != CV_16UC1)) {
    throw InputError("bead detection", "image", "", "must be grey, of 8 or 16 bits");
  }
  return BeadFinder(image, settings).find();
}

}  // namespace angio::calibration
