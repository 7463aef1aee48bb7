// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/centerline2d.hpp"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>
#include <string>

#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"

namespace angio {
namespace {

// Nine points span a few pixels of a vessel: enough to beat pixel noise, short enough to follow a bend.
constexpr int kNeighbours = 9;

double axisAngle(const Eigen::Matrix2d& scatter) {
  return undirected(0.5 * std::atan2(2 * scatter(0, 1), scatter(0, 0) - scatter(1, 1)));
}

Eigen::VectorXd tangentsOfCloud(const Eigen::Matrix2Xd& points) {
  const Eigen::MatrixX2d rows = points.transpose();
  using Tree = nanoflann::KDTreeEigenMatrixAdaptor<Eigen::MatrixX2d, 2>;
  const Tree tree(2, rows, 10);
  const std::size_t k = std::min<std::size_t>(kNeighbours, static_cast<std::size_t>(points.cols()));
  std::vector<Eigen::Index> index(k);
  std::vector<double> distance2(k);
  Eigen::VectorXd tangent(points.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector2d here = points.col(i);
    const std::size_t found = tree.index->knnSearch(here.data(), k, index.data(), distance2.data());
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (std::size_t j = 0; j < found; ++j) mean += points.col(index[j]) / static_cast<double>(found);
    Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
    for (std::size_t j = 0; j < found; ++j) {
      const Eigen::Vector2d d = points.col(index[j]) - mean;
      scatter += d * d.transpose();
    }
    tangent[i] = axisAngle(scatter);
  }
  return tangent;
}

// A chord this long is turned by a few degrees only when a pixel of noise shifts its ends; a shorter one shows the noise.
constexpr double kChord_px = 12;
constexpr int kMostSteps = 12;  // On each side of a point.

Eigen::VectorXd tangentsAlongBranches(const Eigen::Matrix2Xd& points, const std::vector<int>& branch) {
  const Eigen::Index n = points.cols();
  Eigen::VectorXd tangent(n);
  const auto joined = [&](Eigen::Index i, Eigen::Index k) { return k >= 0 && k < n && branch[k] == branch[i]; };
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::Index a = i, b = i;
    for (int step = 0; step < kMostSteps; ++step) {
      if (joined(i, a - 1)) --a;
      if (joined(i, b + 1)) ++b;
      if ((points.col(b) - points.col(a)).squaredNorm() >= kChord_px * kChord_px) break;
    }
    const Eigen::Vector2d chord = points.col(b) - points.col(a);
    tangent[i] = undirected(std::atan2(chord.y(), chord.x()));
  }
  return tangent;
}

}  // namespace

double undirected(double angle_rad) { return angle_rad - kPi * std::floor(angle_rad / kPi + 0.5); }

Centerline2d makeCenterline(Eigen::Matrix2Xd points_px, std::vector<int> branch, Eigen::VectorXd radius_px) {
  const auto n = points_px.cols();
  if (!branch.empty() && static_cast<Eigen::Index>(branch.size()) != n) {
    throw InputError("centreline", "branch", std::to_string(branch.size()), "must be as many as points");
  }
  if (radius_px.size() != 0 && radius_px.size() != n) {
    throw InputError("centreline", "radius_px", std::to_string(radius_px.size()), "must be as many as points");
  }
  for (Eigen::Index i = 0; i < n && !points_px.allFinite(); ++i) {
    requireFinite("centreline, point " + std::to_string(i), "x_px", points_px(0, i));
    requireFinite("centreline, point " + std::to_string(i), "y_px", points_px(1, i));
  }
  Centerline2d result;
  if (n > 0) result.tangent_rad = branch.empty() ? tangentsOfCloud(points_px) : tangentsAlongBranches(points_px, branch);
  result.points_px = std::move(points_px);
  result.branch = std::move(branch);
  result.radius_px = std::move(radius_px);
  return result;
}

Centerline2d densified(const Centerline2d& centerline, double spacing_px) {
  if (!centerline.ordered() || !(spacing_px > 0)) return centerline;
  const bool has_radius = centerline.radius_px.size() > 0;
  std::vector<Eigen::Vector2d> points;
  std::vector<int> branch;
  std::vector<double> radius, tangent;
  for (int i = 0; i < centerline.size(); ++i) {
    if (i > 0 && centerline.branch[i] == centerline.branch[i - 1]) {
      const Eigen::Vector2d a = centerline.points_px.col(i - 1), b = centerline.points_px.col(i);
      const double step_px = (b - a).norm();
      const int pieces = step_px > kLongestStep_px ? 1 : static_cast<int>(std::ceil(step_px / spacing_px - 1e-9));
      for (int p = 1; p < pieces; ++p) {
        const double w = static_cast<double>(p) / pieces;
        points.push_back((1 - w) * a + w * b);
        branch.push_back(centerline.branch[i]);
        tangent.push_back(undirected(std::atan2(b.y() - a.y(), b.x() - a.x())));
        if (has_radius) radius.push_back((1 - w) * centerline.radius_px[i - 1] + w * centerline.radius_px[i]);
      }
    }
    points.push_back(centerline.points_px.col(i));
    branch.push_back(centerline.branch[i]);
    tangent.push_back(centerline.tangent_rad[i]);
    if (has_radius) radius.push_back(centerline.radius_px[i]);
  }
  Centerline2d result;
  result.points_px.resize(2, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) result.points_px.col(static_cast<Eigen::Index>(i)) = points[i];
  result.branch = std::move(branch);
  result.tangent_rad = Eigen::Map<Eigen::VectorXd>(tangent.data(), static_cast<Eigen::Index>(tangent.size()));
  if (has_radius) result.radius_px = Eigen::Map<Eigen::VectorXd>(radius.data(), static_cast<Eigen::Index>(radius.size()));
  return result;
}

}  // namespace angio
