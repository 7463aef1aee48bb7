// SPDX-License-Identifier: GPL-2.0-or-later
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/calibration/bead_detection.hpp"
#include "bead_refinement.hpp"

namespace angio::calibration {
namespace {

constexpr double kSizeStep = 1.2;       // Radii within this factor are of one size.
constexpr double kRadiusSpread = 0.08;  // Standard deviation of an apparent radius's logarithm.
constexpr double kScaleStep = 0.02;     // Of the scale's logarithm.
constexpr double kAlsoLikely = 0.7;     // Of the best scale's agreement.
constexpr std::size_t kMaxScales = 3;
constexpr std::size_t kMinCount = 12;
constexpr std::size_t kRefined = 80;        // Orientations that are refined, those with most votes.
constexpr double kConclusive = 0.8;         // Share of agreement that ends the search.
constexpr double kNeighbourhood_rad = 0.7;  // Around likely orientations.
constexpr std::size_t kLikely = 4;
constexpr double kRotationStep_rad = degToRad(8);  // Between the orientations that are tried.
constexpr double kMinShare = 0.6;      // Of the beads that should be in the image, and of those seen, that must agree.
constexpr double kTolerance_px = 2.5;  // Between a bead and its projection when all is done.

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

// Scales at which most apparent radii are those of beads, best first, at least one.
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

// Rotations so that each is within about a step of one: directions on a Fibonacci sphere, each turned about itself.
std::vector<Eigen::Matrix3d> orientationGrid(double step_rad) {
  const int directions = static_cast<int>(std::ceil(4 * kPi / (step_rad * step_rad)));
  const int turns = static_cast<int>(std::ceil(2 * kPi / step_rad));
  const double golden_rad = kPi * (3 - std::sqrt(5.0));
  std::vector<Eigen::Matrix3d> grid;
  grid.reserve(directions * turns);
  for (int i = 0; i < directions; ++i) {
    const double z = 1 - (2 * i + 1.0) / directions, a = golden_rad * i;
    // The shortest turn of the direction (r cos a, r sin a, z) onto the z axis.
    const Eigen::AngleAxisd towards(std::acos(z), Eigen::Vector3d(std::sin(a), -std::cos(a), 0));
    for (int k = 0; k < turns; ++k) {
      grid.push_back((Eigen::AngleAxisd(2 * kPi * k / turns, Eigen::Vector3d::UnitZ()) * towards).toRotationMatrix());
    }
  }
  return grid;
}

// Lets pairs of beads and detections vote for shifts of the phantom, seen without perspective.
class OrientationVotes {
 public:
  OrientationVotes(const BeadPhantom& phantom, const std::vector<BeadDetection>& detections, const BeadScale& scale,
                   double step_rad)
      : points_px_(scale.px_per_m * (phantom.positions_m().colwise() - phantom.center_m())) {
    const auto beads = static_cast<double>(points_px_.cols());
    const double spread_px = std::sqrt(points_px_.squaredNorm() / beads);
    bin_px_ = 0.5 * step_rad * spread_px;
    const double reach_px = points_px_.colwise().norm().maxCoeff() + bin_px_;
    const Eigen::Matrix2Xd detections_px = placesOf(detections);
    low_px_ = detections_px.rowwise().minCoeff().array() - reach_px;
    const Eigen::Vector2d extent_px = detections_px.rowwise().maxCoeff().array() + reach_px - low_px_.array();
    columns_ = static_cast<int>(extent_px.x() / bin_px_) + 2;
    rows_ = static_cast<int>(extent_px.y() / bin_px_) + 2;
    const int sizes = 1 + std::min(*std::max_element(scale.bead_size.begin(), scale.bead_size.end()),
                                   *std::max_element(scale.detection_size.begin(), scale.detection_size.end()));
    sizes_.resize(sizes);
    for (std::size_t i = 0; i < detections.size(); ++i) {
      const int size = scale.detection_size[i];
      if (size >= sizes) continue;
      const Eigen::Vector2d at = (detections[i].center_px - low_px_) / bin_px_;
      sizes_[size].x.push_back(static_cast<float>(at.x()));
      sizes_[size].y.push_back(static_cast<float>(at.y()));
    }
    for (std::size_t b = 0; b < scale.bead_size.size(); ++b) {
      if (scale.bead_size[b] < sizes) sizes_[scale.bead_size[b]].beads.push_back(b);
    }
  }

  // Width of what counts as one shift: about how far a step of rotation moves beads.
  double bin_px() const { return bin_px_; }

  // The `count` best of these orientations, best first.
  std::vector<OrientationVote> best(const std::vector<Eigen::Matrix3d>& orientations, std::size_t count) const {
    Votes bins(columns_ * rows_);
    std::vector<OrientationVote> votes;
    votes.reserve(orientations.size());
    for (const auto& R : orientations) votes.push_back(vote(R, bins));
    const std::size_t kept = std::min(count, votes.size());
    std::partial_sort(votes.begin(), votes.begin() + kept, votes.end(),
                      [](const OrientationVote& a, const OrientationVote& b) { return a.votes > b.votes; });
    votes.resize(kept);
    return votes;
  }

 private:
  using Votes = std::vector<short>;  // By bin, row after row.
  // Detections of one size [bins], and which beads have that size.
  struct Size {
    std::vector<float> x, y;
    std::vector<Eigen::Index> beads;
  };

  OrientationVote vote(const Eigen::Matrix3d& R, Votes& bins) const {
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
          for (std::size_t k = 0; k < some; ++k) ++bins[index[k]];
        }
      }
    }
    OrientationVote best = mostIn(bins);
    best.R_camera_phantom = R;
    return best;
  }

  // Four neighbours count as one: a peak may lie on a corner.
  OrientationVote mostIn(const Votes& bins) const {
    OrientationVote best;
    for (int y = 0; y + 1 < rows_; ++y) {
      const short* const row = &bins[y * columns_];
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

  Eigen::Matrix3Xd points_px_;  // About the centre, times the scale.
  std::vector<Size> sizes_;
  double bin_px_;
  Eigen::Vector2d low_px_;
  int columns_, rows_;
};

std::vector<double> radiiOf(const std::string& place, const std::vector<BeadDetection>& detections) {
  std::vector<double> radii;
  for (const BeadDetection& seen : detections) {
    if (!seen.radius_px)
      throw InputError(place, "radius_px", "", "is missing: neither numbers nor sizes tell the beads apart");
    radii.push_back(*seen.radius_px);
  }
  if (radii.size() < kMinCount) {
    throw InputError(place, "beads", std::to_string(radii.size()),
                     "must be at least " + std::to_string(kMinCount) + " to be told apart");
  }
  return radii;
}

}  // namespace

BeadMatch matchBeads(const std::string& place, const BeadPhantom& phantom, const std::vector<BeadDetection>& detections,
                     const std::vector<Eigen::Matrix3d>& likely) {
  const std::vector<double> radii = radiiOf(place, detections);
  Refinement best;
  std::vector<BeadScale> scales = likelyScales(phantom, radii);
  for (const BeadScale& scale : scales) {
    const OrientationVotes votes(phantom, detections, scale, kRotationStep_rad);
    const auto search = [&](const std::vector<Eigen::Matrix3d>& orientations) {
      for (const OrientationVote& vote : votes.best(orientations, kRefined)) {
        Refinement refined = refinedMatch(phantom, detections, scale, vote, votes.bin_px(), kTolerance_px);
        if (refined.share > best.share) best = std::move(refined);
        if (best.share >= kConclusive) return true;
      }
      return false;
    };
    const std::vector<Eigen::Matrix3d> grid = orientationGrid(kRotationStep_rad);
    bool done = false;
    for (std::size_t k = 0; k < std::min(kLikely, likely.size()) && !done; ++k) {
      std::vector<Eigen::Matrix3d> near;
      for (const auto& R : grid) {
        if (rotationAngle(R * likely[k].transpose()) < kNeighbourhood_rad) near.push_back(R);
      }
      done = search(near);
    }
    if (done || search(grid)) break;
  }
  if (!(best.share >= kMinShare)) {
    throw InputError(place, "beads", std::to_string(best.matched) + " of " + std::to_string(detections.size()),
                     "cannot be told apart: no orientation of " + phantom.name +
                         " explains them; is it the right phantom, and most of it in the image?");
  }
  return best;
}

}  // namespace angio::calibration
