// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/centerline2d.hpp"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>
#include <string>

#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/vessel/projection.hpp"
#include "angio/vessel/undistort.hpp"

namespace angio::vessel {
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

// A chord this long is turned by a few degrees only when a pixel of noise shifts its ends; a shorter one shows the
// noise.
constexpr double kChord_px = 12;
constexpr int kMaxSteps = 12;  // On each side of a point.

Eigen::VectorXd tangentsAlongBranches(const Eigen::Matrix2Xd& points, const std::vector<int>& branch) {
  const Eigen::Index n = points.cols();
  Eigen::VectorXd tangent(n);
  const auto joined = [&](Eigen::Index i, Eigen::Index k) { return k >= 0 && k < n && branch[k] == branch[i]; };
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::Index a = i, b = i;
    for (int step = 0; step < kMaxSteps; ++step) {
      if (joined(i, a - 1)) --a;
      if (joined(i, b + 1)) ++b;
      if ((points.col(b) - points.col(a)).squaredNorm() >= kChord_px * kChord_px) break;
    }
    const Eigen::Vector2d chord = points.col(b) - points.col(a);
    tangent[i] = undirected(std::atan2(chord.y(), chord.x()));
  }
  return tangent;
}

// Where a point of a new centreline comes from: between two points of the old one.
struct Between {
  int a = 0, b = 0;
  double weight_of_b = 0;
};

Eigen::VectorXd mixed(const Eigen::VectorXd& values, const std::vector<Between>& places) {
  if (values.size() == 0) return {};
  Eigen::VectorXd result(static_cast<Eigen::Index>(places.size()));
  Eigen::Index n = 0;
  for (const Between& p : places) result[n++] = (1 - p.weight_of_b) * values[p.a] + p.weight_of_b * values[p.b];
  return result;
}

// All but the tangents, which have no mean between two.
Centerline2d resampledAt(const Centerline2d& line, const std::vector<Between>& places) {
  Centerline2d result;
  result.points_px.resize(2, places.size());
  Eigen::Index n = 0;
  for (const Between& p : places) {
    result.points_px.col(n++) = (1 - p.weight_of_b) * line.points_px.col(p.a) + p.weight_of_b * line.points_px.col(p.b);
    if (line.ordered()) result.branch.push_back(line.branch[p.a]);
    if (!line.kind.empty()) result.kind.push_back(line.kind[p.a]);
  }
  result.radius_px = mixed(line.radius_px, places);
  result.std_px = mixed(line.std_px, places);
  result.contrast = mixed(line.contrast, places);
  return result;
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
  if (n > 0)
    result.tangent_rad = branch.empty() ? tangentsOfCloud(points_px) : tangentsAlongBranches(points_px, branch);
  result.points_px = std::move(points_px);
  result.branch = std::move(branch);
  result.radius_px = std::move(radius_px);
  return result;
}

Centerline2d pointsWhere(const Centerline2d& centerline, const std::vector<bool>& keep) {
  std::vector<Between> places;
  for (int i = 0; i < centerline.size(); ++i) {
    if (keep[i]) places.push_back({i, i, 0});
  }
  Centerline2d result = resampledAt(centerline, places);
  result.tangent_rad = mixed(centerline.tangent_rad, places);
  for (std::size_t k = 0, number = 0; k < result.branch.size(); ++k) {
    const bool goes_on = k > 0 && places[k].a == places[k - 1].a + 1 &&
                         centerline.branch[places[k].a] == centerline.branch[places[k - 1].a];
    if (k > 0 && !goes_on) ++number;
    result.branch[k] = static_cast<int>(number);
  }
  return result;
}

Centerline2d ofKind(const Centerline2d& centerline, CurveKind kind) {
  std::vector<bool> keep(static_cast<std::size_t>(centerline.size()), kind == CurveKind::kVessel);
  for (std::size_t i = 0; i < centerline.kind.size(); ++i) keep[i] = centerline.kind[i] == kind;
  return pointsWhere(centerline, keep);
}

Centerline2d vesselsToMatch(Centerline2d seen) {
  const auto devices = std::count(seen.kind.begin(), seen.kind.end(), CurveKind::kDevice);
  return devices == 0 || 2 * devices > seen.size() ? std::move(seen) : ofKind(seen, CurveKind::kVessel);
}

Centerline2d densified(const Centerline2d& centerline, double spacing_px) {
  if (!centerline.ordered() || !(spacing_px > 0)) return centerline;
  std::vector<Between> places;
  std::vector<double> tangent;
  for (int i = 0; i < centerline.size(); ++i) {
    if (i > 0 && centerline.branch[i] == centerline.branch[i - 1]) {
      const Eigen::Vector2d step = centerline.points_px.col(i) - centerline.points_px.col(i - 1);
      const double step_px = step.norm();
      const int pieces = step_px > kMaxStep_px ? 1 : static_cast<int>(std::ceil(step_px / spacing_px - 1e-9));
      for (int p = 1; p < pieces; ++p) {
        places.push_back({i - 1, i, static_cast<double>(p) / pieces});
        tangent.push_back(undirected(std::atan2(step.y(), step.x())));
      }
    }
    places.push_back({i, i, 0});
    tangent.push_back(centerline.tangent_rad[i]);
  }
  Centerline2d result = resampledAt(centerline, places);
  result.tangent_rad = Eigen::Map<Eigen::VectorXd>(tangent.data(), static_cast<Eigen::Index>(tangent.size()));
  return result;
}

Centerline2d projectedCenterline(const VesselTree& tree, const XrayCamera& camera, const Pose& T_camera_model) {
  std::vector<Eigen::Vector2d> pixels;
  std::vector<int> branch;
  int label = 0;
  for (const auto& points_of_branch : tree.branches()) {
    bool open = false;
    for (const int i : points_of_branch) {
      const auto pixel = camera.project(T_camera_model * tree.points().col(i));
      const bool seen = pixel && camera.sees(*pixel);
      if (seen) {
        pixels.push_back(*pixel);
        branch.push_back(label);
      } else if (open) {
        ++label;
      }
      open = seen;
    }
    ++label;
  }
  Eigen::Matrix2Xd points(2, pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) points.col(i) = pixels[i];
  return makeCenterline(std::move(points), std::move(branch));
}

Centerline2d undistorted(const Centerline2d& seen, const DetectorDistortion& distortion) {
  Centerline2d line = seen;
  std::vector<bool> keep(static_cast<std::size_t>(seen.size()), false);
  for (Eigen::Index i = 0; i < seen.points_px.cols(); ++i) {
    Eigen::Matrix2d J;
    const auto point_px = distortion.undistorted(seen.points_px.col(i), &J);
    if (!point_px) continue;
    keep[i] = true;
    line.points_px.col(i) = *point_px;
    const Eigen::Vector2d along = J * Eigen::Vector2d(std::cos(seen.tangent_rad[i]), std::sin(seen.tangent_rad[i]));
    line.tangent_rad[i] = undirected(std::atan2(along.y(), along.x()));
    // Across the curve: the area's change over the length's.
    const double across = std::abs(J(0, 0) * J(1, 1) - J(0, 1) * J(1, 0)) / along.norm();
    if (line.radius_px.size() > 0) line.radius_px[i] *= across;
    if (line.std_px.size() > 0) line.std_px[i] *= across;
  }
  return pointsWhere(line, keep);
}

}  // namespace angio::vessel
