// SPDX-License-Identifier: GPL-2.0-or-later
#include "bead_refinement.hpp"

#include <algorithm>
#include <utility>

#include "angio/calibration/direct_linear.hpp"
#include "least_squares.hpp"

namespace angio::calibration {
namespace {

constexpr int kMinMatched = 10, kMinForBend = 40;
constexpr int kCubic = 10;  // Monomials of two variables up to the third degree.

using Pairs = std::vector<std::pair<Eigen::Index, Eigen::Index>>;  // Bead, detection.

class Refiner {
 public:
  Refiner(const BeadPhantom& phantom, const std::vector<BeadDetection>& detections, const BeadScale& scale)
      : points_m_(phantom.positions_m().colwise() - phantom.center_m()),
        scale_(scale),
        seen_px_(placesOf(detections)) {}

  Eigen::Index detections() const { return seen_px_.cols(); }

  Eigen::Matrix2Xd start(const OrientationVote& vote) const {
    return (scale_.px_per_m * vote.R_camera_phantom.topRows<2>() * points_m_).colwise() + vote.center_px;
  }

  // Beads and detections of one size that are each other's nearest.
  Pairs pairs(const Eigen::Matrix2Xd& thought_px, double tolerance_px) const {
    const Eigen::Index beads = thought_px.cols();
    std::vector<Eigen::Index> nearest_bead(detections(), -1), nearest_seen(beads, -1);
    std::vector<double> distance(detections(), tolerance_px * tolerance_px);
    for (Eigen::Index b = 0; b < beads; ++b) {
      double least = tolerance_px * tolerance_px;
      for (Eigen::Index d = 0; d < detections(); ++d) {
        if (scale_.bead_size[b] != scale_.detection_size[d]) continue;
        const double now = (thought_px.col(b) - seen_px_.col(d)).squaredNorm();
        if (now < least) {
          least = now;
          nearest_seen[b] = d;
        }
        if (now < distance[d]) {
          distance[d] = now;
          nearest_bead[d] = b;
        }
      }
    }
    Pairs found;
    for (Eigen::Index b = 0; b < beads; ++b) {
      const Eigen::Index d = nearest_seen[b];
      if (d >= 0 && nearest_bead[d] == b) found.emplace_back(b, d);
    }
    return found;
  }

  std::optional<Matrix34d> affine(const Pairs& matched) const {
    const auto [points, pixels] = columns(matched);
    const LeastSquares map = leastSquares(points.colwise().homogeneous().transpose(), pixels.transpose());
    if (map.rank < 4) return std::nullopt;
    Matrix34d P = Matrix34d::Zero();
    P.topRows<2>() = map.solution.transpose();
    P(2, 3) = 1;
    return P;
  }

  // Of beads as they would be seen without the bend, which moves each by so much.
  std::optional<Matrix34d> perspective(const Pairs& matched, const Eigen::Matrix2Xd& bend_px) const {
    auto [points, pixels] = columns(matched);
    for (std::size_t k = 0; k < matched.size(); ++k) {
      pixels.col(k) -= bend_px.col(matched[k].first);
    }
    return directLinearTransform(points, pixels);
  }

  Eigen::Matrix2Xd projected(const Matrix34d& P) const { return projectedBy(P, points_m_); }

  // Thought places moved by a cubic polynomial of place that explains what is off.
  Eigen::Matrix2Xd bent(const Eigen::Matrix2Xd& thought_px, const Pairs& matched) const {
    const Eigen::Vector2d mean = seen_px_.rowwise().mean();
    const double unit = (seen_px_.colwise() - mean).colwise().norm().maxCoeff();
    const auto monomials = [&](const Eigen::Vector2d& px) {
      const double x = (px.x() - mean.x()) / unit, y = (px.y() - mean.y()) / unit;
      return (Eigen::Matrix<double, 1, kCubic>() << 1, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y,
              y * y * y)
          .finished();
    };
    Eigen::MatrixXd A(matched.size(), kCubic), b(matched.size(), 2);
    for (std::size_t k = 0; k < matched.size(); ++k) {
      A.row(k) = monomials(thought_px.col(matched[k].first));
      b.row(k) = (seen_px_.col(matched[k].second) - thought_px.col(matched[k].first)).transpose();
    }
    const Eigen::MatrixXd c = leastSquares(A, b).solution;
    Eigen::Matrix2Xd moved = thought_px;
    for (Eigen::Index i = 0; i < moved.cols(); ++i) moved.col(i) += (monomials(thought_px.col(i)) * c).transpose();
    return moved;
  }

  // Beads that lie where something was seen: all around them, not beyond what the image shows.
  int expected(const Eigen::Matrix2Xd& thought_px) const {
    const Eigen::Vector2d low = seen_px_.rowwise().minCoeff(), high = seen_px_.rowwise().maxCoeff();
    int count = 0;
    for (Eigen::Index i = 0; i < thought_px.cols(); ++i) {
      count += (thought_px.col(i).array() >= low.array()).all() && (thought_px.col(i).array() <= high.array()).all();
    }
    return count;
  }

 private:
  std::pair<Eigen::Matrix3Xd, Eigen::Matrix2Xd> columns(const Pairs& matched) const {
    std::pair<Eigen::Matrix3Xd, Eigen::Matrix2Xd> both{Eigen::Matrix3Xd(3, matched.size()),
                                                       Eigen::Matrix2Xd(2, matched.size())};
    for (std::size_t k = 0; k < matched.size(); ++k) {
      both.first.col(k) = points_m_.col(matched[k].first);
      both.second.col(k) = seen_px_.col(matched[k].second);
    }
    return both;
  }

  Eigen::Matrix3Xd points_m_;
  const BeadScale& scale_;
  Eigen::Matrix2Xd seen_px_;
};

}  // namespace

Eigen::Matrix2Xd placesOf(const std::vector<BeadDetection>& detections) {
  Eigen::Matrix2Xd places_px(2, detections.size());
  for (std::size_t i = 0; i < detections.size(); ++i) places_px.col(i) = detections[i].center_px;
  return places_px;
}

Refinement refinedMatch(const BeadPhantom& phantom, const std::vector<BeadDetection>& detections,
                        const BeadScale& scale, const OrientationVote& start, double bin_px, double tolerance_px) {
  const Refiner refiner(phantom, detections, scale);
  Refinement result;
  result.bead.assign(detections.size(), std::nullopt);
  result.R_camera_phantom = start.R_camera_phantom;
  Eigen::Matrix2Xd thought_px = refiner.start(start);
  for (const double tolerance : {1.5 * bin_px, 1.2 * bin_px, bin_px, 0.8 * bin_px, 0.6 * bin_px}) {
    const Pairs matched = refiner.pairs(thought_px, tolerance);
    if (static_cast<int>(matched.size()) < kMinMatched) return result;
    const auto P = refiner.affine(matched);
    if (!P) return result;
    thought_px = refiner.projected(*P);
  }
  Eigen::Matrix2Xd projected_px = thought_px;
  // By and by: how a detector bends the image at its edge shows only when the beads on the way there are matched.
  for (const double share : {0.6, 0.6, 0.5, 0.5, 0.4, 0.4, 0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.0, 0.0}) {
    const Pairs matched = refiner.pairs(thought_px, std::max(share * bin_px, tolerance_px));
    if (static_cast<int>(matched.size()) < kMinMatched) return result;
    const auto P = refiner.perspective(matched, thought_px - projected_px);
    if (!P) return result;
    projected_px = refiner.projected(*P);
    thought_px = static_cast<int>(matched.size()) < kMinForBend ? projected_px : refiner.bent(projected_px, matched);
  }
  const Pairs matched = refiner.pairs(thought_px, tolerance_px);
  for (const auto& [bead, seen] : matched) result.bead[seen] = static_cast<int>(bead);
  result.matched = static_cast<int>(matched.size());
  const auto of = [&](double all) { return result.matched / std::max(1.0, all); };
  result.share = std::min(of(static_cast<double>(detections.size())), of(refiner.expected(thought_px)));
  return result;
}

}  // namespace angio::calibration
