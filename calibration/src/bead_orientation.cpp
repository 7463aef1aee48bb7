// SPDX-License-Identifier: GPL-2.0-or-later
#include "bead_orientation.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace angio::calibration {
namespace {

constexpr double kSizeStep = 1.2;       // Radii within this factor are of one size.
constexpr double kRadiusSpread = 0.08;  // Standard deviation of an apparent radius's logarithm.
constexpr double kScaleStep = 0.02;     // Of the scale's logarithm.
constexpr double kAlsoLikely = 0.7;     // Of the best scale's agreement.
constexpr std::size_t kMaxScales = 3;

std::vector<double> sizesOf(const BeadPhantom& phantom) {
  std::vector<double> radii;
  for (const Bead& bead : phantom.beads) radii.push_back(bead.radius_m);
  std::sort(radii.begin(), radii.end());
  std::vector<double> sizes;
  for (const double r : radii) {
    if (sizes.empty() || r > kSizeStep * sizes.back()) sizes.push_back(r);
  }
  return sizes;
}

int nearestSize(const std::vector<double>& sizes, double radius) {
  int best = 0;
  for (int k = 1; k < static_cast<int>(sizes.size()); ++k) {
    if (std::abs(std::log(sizes[k] / radius)) < std::abs(std::log(sizes[best] / radius))) best = k;
  }
  return best;
}

}  // namespace

std::vector<BeadScale> likelyScales(const BeadPhantom& phantom, const std::vector<double>& radii_px) {
  const std::vector<double> sizes = sizesOf(phantom);
  const auto [smallest, largest] = std::minmax_element(radii_px.begin(), radii_px.end());
  std::vector<std::pair<double, double>> agreements;  // With the scale's logarithm.
  const double from = std::log(*smallest / sizes.back()) - 0.1, to = std::log(*largest / sizes.front()) + 0.1;
  for (double log_scale = from; log_scale < to; log_scale += kScaleStep) {
    double agreement = 0;
    for (const double radius_px : radii_px) {
      double nearest = 1e9;
      for (const double size : sizes) nearest = std::min(nearest, std::abs(std::log(radius_px / size) - log_scale));
      agreement += std::exp(-0.5 * std::pow(nearest / kRadiusSpread, 2));
    }
    agreements.emplace_back(agreement, log_scale);
  }
  std::vector<std::pair<double, double>> peaks;
  for (std::size_t i = 0; i < agreements.size(); ++i) {
    const bool rises = i == 0 || agreements[i - 1].first <= agreements[i].first;
    const bool falls = i + 1 == agreements.size() || agreements[i + 1].first < agreements[i].first;
    if (rises && falls) peaks.push_back(agreements[i]);
  }
  std::sort(peaks.rbegin(), peaks.rend());
  std::vector<BeadScale> scales;
  for (const auto& [agreement, log_scale] : peaks) {
    if (scales.size() == kMaxScales || agreement < kAlsoLikely * peaks.front().first) break;
    BeadScale scale;
    scale.px_per_m = std::exp(log_scale);
    for (const Bead& bead : phantom.beads) scale.bead_size.push_back(nearestSize(sizes, bead.radius_m));
    for (const double r : radii_px) scale.detection_size.push_back(nearestSize(sizes, r / scale.px_per_m));
    scales.push_back(std::move(scale));
  }
  return scales;
}

std::vector<Eigen::Matrix3d> orientationGrid(double step_rad) {
  const int directions = static_cast<int>(std::ceil(4 * kPi / (step_rad * step_rad)));
  const int turns = static_cast<int>(std::ceil(2 * kPi / step_rad));
  const double golden_rad = kPi * (3 - std::sqrt(5.0));
  std::vector<Eigen::Matrix3d> grid;
  grid.reserve(static_cast<std::size_t>(directions * turns));
  for (int i = 0; i < directions; ++i) {
    const double z = 1 - (2 * i + 1.0) / directions, r = std::sqrt(1 - z * z), a = golden_rad * i;
    const Eigen::Matrix3d towards = Eigen::Quaterniond::FromTwoVectors(
                                        Eigen::Vector3d(r * std::cos(a), r * std::sin(a), z), Eigen::Vector3d::UnitZ())
                                        .toRotationMatrix();
    for (int k = 0; k < turns; ++k) {
      grid.push_back(Eigen::AngleAxisd(2 * kPi * k / turns, Eigen::Vector3d::UnitZ()) * towards);
    }
  }
  return grid;
}

OrientationVotes::OrientationVotes(const BeadPhantom& phantom, const std::vector<BeadDetection>& detections,
                                   const BeadScale& scale, double step_rad)
    : points_px_(scale.px_per_m * (phantom.positions_m().colwise() - phantom.center_m())) {
  const auto beads = static_cast<double>(points_px_.cols());
  const double spread_px = std::sqrt(points_px_.squaredNorm() / beads);
  bin_px_ = 0.5 * step_rad * spread_px;
  const double reach_px = points_px_.colwise().norm().maxCoeff() + bin_px_;
  Eigen::Matrix2Xd detections_px(2, detections.size());
  for (std::size_t i = 0; i < detections.size(); ++i) {
    detections_px.col(static_cast<Eigen::Index>(i)) = detections[i].center_px;
  }
  low_px_ = detections_px.rowwise().minCoeff().array() - reach_px;
  const Eigen::Vector2d extent_px = detections_px.rowwise().maxCoeff().array() + reach_px - low_px_.array();
  columns_ = static_cast<int>(extent_px.x() / bin_px_) + 2;
  rows_ = static_cast<int>(extent_px.y() / bin_px_) + 2;
  const auto sizes = static_cast<std::size_t>(
      1 + std::min(*std::max_element(scale.bead_size.begin(), scale.bead_size.end()),
                   *std::max_element(scale.detection_size.begin(), scale.detection_size.end())));
  sizes_.resize(sizes);
  for (std::size_t i = 0; i < detections.size(); ++i) {
    const auto size = static_cast<std::size_t>(scale.detection_size[i]);
    if (size >= sizes) continue;
    const Eigen::Vector2d at = (detections[i].center_px - low_px_) / bin_px_;
    sizes_[size].x.push_back(static_cast<float>(at.x()));
    sizes_[size].y.push_back(static_cast<float>(at.y()));
  }
  for (std::size_t b = 0; b < scale.bead_size.size(); ++b) {
    const auto size = static_cast<std::size_t>(scale.bead_size[b]);
    if (size < sizes) sizes_[size].beads.push_back(static_cast<Eigen::Index>(b));
  }
}

OrientationVote OrientationVotes::vote(const Eigen::Matrix3d& R, Votes& bins) const {
  std::fill(bins.begin(), bins.end(), 0);
  const Eigen::Matrix2Xf seen = (R.topRows<2>() / bin_px_ * points_px_).cast<float>();
  std::array<int, 64> index;
  for (const Size& size : sizes_) {
    const std::size_t count = size.x.size();
    for (const Eigen::Index b : size.beads) {
      const float x = seen(0, b), y = seen(1, b);
      // Where to first, then the votes: the former are then reckoned some at a time.
      for (std::size_t first = 0; first < count; first += index.size()) {
        const std::size_t some = std::min(index.size(), count - first);
        const float *at_x = size.x.data() + first, *at_y = size.y.data() + first;
        for (std::size_t k = 0; k < some; ++k) {
          index[k] = static_cast<int>(at_y[k] - y) * columns_ + static_cast<int>(at_x[k] - x);
        }
        for (std::size_t k = 0; k < some; ++k) ++bins[static_cast<std::size_t>(index[k])];
      }
    }
  }
  OrientationVote best = mostIn(bins);
  best.R_camera_phantom = R;
  return best;
}

// Four neighbours count as one: a peak may lie on a corner.
OrientationVote OrientationVotes::mostIn(const Votes& bins) const {
  OrientationVote best;
  for (int y = 0; y + 1 < rows_; ++y) {
    const short* const row = &bins[static_cast<std::size_t>(y * columns_)];
    const short* const below = row + columns_;
    const auto votes = [&](int x) { return static_cast<short>(row[x] + row[x + 1] + below[x] + below[x + 1]); };
    short most = 0;
    for (int x = 0; x + 1 < columns_; ++x) most = std::max(most, votes(x));
    if (most <= best.votes) continue;
    best.votes = most;
    int x = 0;
    while (votes(x) != most) ++x;
    best.center_px = low_px_ + bin_px_ * Eigen::Vector2d(x + 1, y + 1);
  }
  return best;
}

std::vector<OrientationVote> OrientationVotes::best(const std::vector<Eigen::Matrix3d>& orientations,
                                                    std::size_t count) const {
  Votes bins(static_cast<std::size_t>(columns_ * rows_));
  std::vector<OrientationVote> votes;
  votes.reserve(orientations.size());
  for (const auto& R : orientations) votes.push_back(vote(R, bins));
  const std::size_t kept = std::min(count, votes.size());
  std::partial_sort(votes.begin(), votes.begin() + static_cast<std::ptrdiff_t>(kept), votes.end(),
                    [](const OrientationVote& a, const OrientationVote& b) { return a.votes > b.votes; });
  votes.resize(kept);
  return votes;
}

}  // namespace angio::calibration
