// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_samples.hpp"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>
#include <vector>

namespace angio::registration {
namespace {

// Visits the middles of equal pieces of a curve: the segment of each, where in it (0 to 1), and the pieces' length.
// `lengths` are those of the curve's segments.
template <typename Visit>
void eachPiece(const std::vector<double>& lengths, double spacing, const Visit& visit) {
  double total = 0;
  for (const double length : lengths) total += length;
  if (!(total > 0)) return;
  const int count = std::max(1, static_cast<int>(std::ceil(total / spacing - 1e-9)));
  std::size_t segment = 0;
  double before = 0;  // Length of the segments before this one.
  for (int k = 0; k < count; ++k) {
    const double at = (k + 0.5) * total / count;
    while (segment + 1 < lengths.size() && before + lengths[segment] < at) before += lengths[segment++];
    const double share = lengths[segment] > 0 ? std::clamp((at - before) / lengths[segment], 0.0, 1.0) : 0.0;
    visit(segment, share, total / count);
  }
}

// What is gathered of an image, before it is known how much there is.
struct GatheredImage {
  std::vector<double> u, v, cos2, sin2, length;

  void add(const Eigen::Vector2d& at, const Eigen::Vector2d& direction, double length_px) {
    u.push_back(at.x());
    v.push_back(at.y());
    cos2.push_back(direction.x());
    sin2.push_back(direction.y());
    length.push_back(length_px);
  }
  ImageSamples samples() const {
    const auto row = [](const std::vector<double>& values) {
      return Eigen::Map<const Eigen::RowVectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
    };
    ImageSamples s;
    s.points_px.resize(2, static_cast<Eigen::Index>(u.size()));
    s.direction.resizeLike(s.points_px);
    s.points_px << row(u), row(v);
    s.direction << row(cos2), row(sin2);
    s.length_px = row(length).transpose();
    return s;
  }
};

Eigen::Vector2d doubledDirection(double tangent_rad) { return {std::cos(2 * tangent_rad), std::sin(2 * tangent_rad)}; }

// Mean distance from a point to the nearest other one [px].
double meanNeighborDistance_px(const Eigen::Matrix2Xd& points_px) {
  const Eigen::MatrixX2d rows = points_px.transpose();
  if (rows.rows() < 2) return 0;
  const nanoflann::KDTreeEigenMatrixAdaptor<Eigen::MatrixX2d, 2> index(2, rows, 10);
  double sum_px = 0;
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const Eigen::Vector2d query = points_px.col(i);
    Eigen::Index found[2] = {0, 0};
    double distance2[2] = {0, 0};
    index.index->knnSearch(query.data(), 2, found, distance2);
    sum_px += std::sqrt(distance2[1]);
  }
  return sum_px / static_cast<double>(rows.rows());
}

// Points first to last of one branch, a curve without gaps.
void sampleCurve(const Centerline2d& c, int first, int last, double spacing_px, GatheredImage& to) {
  std::vector<double> lengths;
  for (int j = first; j < last; ++j) lengths.push_back((c.points_px.col(j + 1) - c.points_px.col(j)).norm());
  eachPiece(lengths, spacing_px, [&](std::size_t segment, double share, double length_px) {
    const int j = first + static_cast<int>(segment);
    const Eigen::Vector2d at = (1 - share) * c.points_px.col(j) + share * c.points_px.col(j + 1);
    to.add(at, doubledDirection(c.tangent_rad[share < 0.5 ? j : j + 1]), length_px);
  });
}

}  // namespace

ModelSamples modelSamples(const VesselTree& tree, double spacing_m) {
  std::vector<Eigen::Vector3d> points, tangents;
  std::vector<double> lengths_m;
  for (const std::vector<int>& chain : tree.branches()) {
    std::vector<double> lengths;
    for (std::size_t k = 1; k < chain.size(); ++k) {
      lengths.push_back((tree.points().col(chain[k]) - tree.points().col(chain[k - 1])).norm());
    }
    eachPiece(lengths, spacing_m, [&](std::size_t segment, double share, double length_m) {
      const Eigen::Vector3d a = tree.points().col(chain[segment]), b = tree.points().col(chain[segment + 1]);
      points.emplace_back((1 - share) * a + share * b - tree.centroid());
      tangents.emplace_back((b - a).normalized());
      lengths_m.push_back(length_m);
    });
  }
  ModelSamples s;
  const auto n = static_cast<Eigen::Index>(points.size());
  s.points.resize(3, n);
  s.tangents.resize(3, n);
  s.length_m.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    s.points.col(i) = points[static_cast<std::size_t>(i)];
    s.tangents.col(i) = tangents[static_cast<std::size_t>(i)];
    s.length_m[i] = lengths_m[static_cast<std::size_t>(i)];
  }
  return s;
}

ImageSamples imageSamples(const Centerline2d& centerline, double spacing_px) {
  GatheredImage gathered;
  if (!centerline.ordered()) {
    const double length_px = meanNeighborDistance_px(centerline.points_px);
    for (int j = 0; j < centerline.size(); ++j) {
      gathered.add(centerline.points_px.col(j), doubledDirection(centerline.tangent_rad[j]), length_px);
    }
    return gathered.samples();
  }
  const auto continues = [&](int j) {  // From j to the next point.
    return centerline.branch[static_cast<std::size_t>(j)] == centerline.branch[static_cast<std::size_t>(j) + 1] &&
           (centerline.points_px.col(j + 1) - centerline.points_px.col(j)).norm() <= kMaxStep_px;
  };
  for (int first = 0; first < centerline.size();) {
    int last = first;
    while (last + 1 < centerline.size() && continues(last)) ++last;
    sampleCurve(centerline, first, last, spacing_px, gathered);
    first = last + 1;
  }
  return gathered.samples();
}

}  // namespace angio::registration
