// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/extraction_run.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <nanoflann.hpp>

#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::evaluation {
namespace {

constexpr double kShadowStep_px = 0.5;  // Between the places where a sum of shadows is looked at.

// Branches that differ by more run across each other.
constexpr double kAlong_rad = kPi / 6;

// A point of another branch is beside one when it is no further ahead or behind [px]: truths have a point every pixel.
constexpr double kBeside_px = 0.75;

// Vessels whose walls are so many standard deviations of the blur apart have a gap between their shadows.
constexpr double kReachBlurs = 3;

// Which points of an image are near a place.
class NearPlaces {
 public:
  using Found = std::vector<std::pair<Eigen::Index, double>>;  // Which point, and its squared distance.

  explicit NearPlaces(const Eigen::Matrix2Xd& points_px)
      : rows_(points_px.transpose()), tree_(2, std::cref(rows_), 10) {}

  // Those nearer than `reach_px`, in no order. Valid until the next call.
  const Found& within(const Eigen::Vector2d& place_px, double reach_px) {
    constexpr bool kSorted = false;
    tree_.index->radiusSearch(place_px.data(), reach_px * reach_px, found_, nanoflann::SearchParams(32, 0, kSorted));
    return found_;
  }

 private:
  Eigen::MatrixX2d rows_;
  nanoflann::KDTreeEigenMatrixAdaptor<Eigen::MatrixX2d, 2> tree_;
  Found found_;
};

// With u = r sin(t) the chord's steep ends are sampled as finely as they fall.
constexpr int kSteps = 64;
struct Quadrature {
  std::array<double, kSteps> sine{}, cosine2{};

  Quadrature() {
    for (int i = 0; i < kSteps; ++i) {
      const double t = kPi * ((i + 0.5) / kSteps - 0.5);
      sine[i] = std::sin(t);
      cosine2[i] = std::cos(t) * std::cos(t);
    }
  }
};

// The chord of a circle under the blur, up to a factor of the radius alone: 1 through the axis without a blur.
double shadowAt(double x_px, double radius_px, double blur_px) {
  if (blur_px < 0.02 * radius_px) {
    const double off = x_px / radius_px;
    return std::sqrt(std::max(0.0, 1 - off * off));
  }
  static const Quadrature kQuadrature;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double d = (x_px - radius_px * kQuadrature.sine[i]) / blur_px;
    if (std::abs(d) < 5) sum += kQuadrature.cosine2[i] * std::exp(-0.5 * d * d);
  }
  return sum * (kPi / kSteps) * radius_px / (blur_px * std::sqrt(2 * kPi));
}

// The sum of two shadows from the axis of the one to that of the other, which all its maxima lie between.
std::vector<double> sumBetween(const ShadowProfile& one, const ShadowProfile& other, double apart_px, double blur_px) {
  const int steps = std::max(8, static_cast<int>(std::ceil(apart_px / kShadowStep_px)));
  std::vector<double> sum(static_cast<std::size_t>(steps) + 1);
  for (int i = 0; i <= steps; ++i) {
    const double x = apart_px * i / steps;
    sum[i] = one.contrast * shadowAt(x, one.radius_px, blur_px) +
             other.contrast * shadowAt(apart_px - x, other.radius_px, blur_px);
  }
  return sum;
}

// Down and, later, up again by more than rounding.
bool dips(const std::vector<double>& sum) {
  const double min_fall = 1e-9 * *std::max_element(sum.begin(), sum.end());
  double top = sum.front(), bottom = sum.front();
  for (const double value : sum) {
    if (value > bottom + min_fall && bottom < top - min_fall) return true;
    if (value > top) top = bottom = value;
    bottom = std::min(bottom, value);
  }
  return false;
}

// Whether a point keeps the line that it and another branch beside it cast. Equal ones share it.
bool keepsLine(const ShadowProfile& own, const ShadowProfile& other, double apart_px, double blur_px) {
  const std::vector<double> sum = sumBetween(own, other, apart_px, blur_px);
  if (dips(sum)) return true;
  const auto top = std::max_element(sum.begin(), sum.end()) - sum.begin();
  return 2 * top <= static_cast<std::ptrdiff_t>(sum.size() - 1);
}

}  // namespace

bool resolved(const ShadowProfile& one, const ShadowProfile& other, double apart_px, double blur_px) {
  return dips(sumBetween(one, other, apart_px, blur_px));
}

std::vector<bool> haveOwnLine(const Centerline2d& vessels, double blur_px) {
  const int count = vessels.size();
  if (count > 0 && (vessels.radius_px.size() != count || vessels.contrast.size() != count || !vessels.ordered())) {
    throw InputError("vessels", "radius, contrast and branch", "", "are needed of every point");
  }
  std::vector<bool> own(static_cast<std::size_t>(count), true);
  if (count == 0) return own;
  NearPlaces places(vessels.points_px);
  const double widest_px = vessels.radius_px.maxCoeff();
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d p = vessels.points_px.col(i);
    const Eigen::Vector2d along(std::cos(vessels.tangent_rad[i]), std::sin(vessels.tangent_rad[i]));
    const double radius_px = vessels.radius_px[i], max_px = radius_px + widest_px + kReachBlurs * blur_px;
    std::map<int, std::pair<double, Eigen::Index>> beside;  // By branch: how far to the side, and which point.
    for (const auto& [j, distance2] : places.within(p, max_px)) {
      const int branch = vessels.branch[j];
      if (branch == vessels.branch[i]) continue;
      const Eigen::Vector2d to = vessels.points_px.col(j) - p;
      const double ahead = to.dot(along), off = std::abs(to.x() * along.y() - to.y() * along.x());
      if (std::abs(ahead) > kBeside_px || off > radius_px + vessels.radius_px[j] + kReachBlurs * blur_px) continue;
      if (std::abs(undirected(vessels.tangent_rad[j] - vessels.tangent_rad[i])) > kAlong_rad) continue;
      const auto [place, fresh] = beside.try_emplace(branch, off, j);
      if (!fresh && off < place->second.first) place->second = {off, j};
    }
    for (const auto& [branch, place] : beside) {
      const auto& [off_px, j] = place;
      if (keepsLine({radius_px, vessels.contrast[i]}, {vessels.radius_px[j], vessels.contrast[j]}, off_px, blur_px)) {
        continue;
      }
      own[i] = false;
      break;
    }
  }
  return own;
}

std::vector<bool> lostInAWider(const Centerline2d& vessels) {
  const int count = vessels.size();
  std::vector<bool> lost(static_cast<std::size_t>(count), false);
  if (count == 0) return lost;
  NearPlaces places(vessels.points_px);
  const double widest_px = vessels.radius_px.maxCoeff();
  for (int i = 0; i < count; ++i) {
    const auto& near = places.within(vessels.points_px.col(i), widest_px);
    lost[i] = std::any_of(near.begin(), near.end(), [&](const auto& found) {
      const auto& [j, distance2] = found;
      return vessels.branch[j] != vessels.branch[i] && vessels.radius_px[j] > vessels.radius_px[i] &&
             distance2 < vessels.radius_px[j] * vessels.radius_px[j];
    });
  }
  return lost;
}

}  // namespace angio::evaluation
