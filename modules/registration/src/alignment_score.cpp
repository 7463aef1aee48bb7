// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/alignment_score.hpp"

#include <algorithm>
#include <cmath>

#include "angio/geometry/bucket_grid.hpp"
#include "angio/vessel/resample.hpp"

namespace angio::registration {
namespace {

// One side's points, counted over all views.
struct Tally {
  int points = 0, explained = 0, measured = 0;
  double distances_px = 0, squares_px2 = 0;

  void measure(double distance_px, bool is_explained) {
    ++measured;
    distances_px += distance_px;
    squares_px2 += distance_px * distance_px;
    explained += is_explained ? 1 : 0;
  }
  double share() const { return points > 0 ? static_cast<double>(explained) / points : 0; }
  double mean_px() const { return measured > 0 ? distances_px / measured : 0; }
  double rms_px() const { return measured > 0 ? std::sqrt(squares_px2 / measured) : 0; }
};

// The model's points that a view sees, and the edges between them.
struct Silhouette {
  // An edge from one of its ends [px].
  struct Edge {
    Eigen::Vector2d to_other;
    double length2, inverse_length2;
  };
  Eigen::Matrix2Xd pixel;       // 2 x M.
  std::vector<int> first_edge;  // M + 1: where the edges of each point begin.
  std::vector<Edge> edges;      // Each twice.

  int size() const { return static_cast<int>(pixel.cols()); }
};

// `pairs` are the ends of the edges.
void addEdges(const std::vector<std::pair<int, int>>& pairs, Silhouette& s) {
  s.first_edge.assign(static_cast<std::size_t>(s.size()) + 1, 0);
  for (const auto& [a, b] : pairs) {
    ++s.first_edge[a];
    ++s.first_edge[b];
  }
  for (std::size_t k = 1; k < s.first_edge.size(); ++k) s.first_edge[k] += s.first_edge[k - 1];
  s.edges.resize(2 * pairs.size());
  for (const auto& [a, b] : pairs) {  // Places are given out from the last to the first of a point.
    const Eigen::Vector2d d = s.pixel.col(b) - s.pixel.col(a);
    const double length2 = d.squaredNorm(), inverse = length2 > 0 ? 1 / length2 : 0;
    s.edges[--s.first_edge[a]] = {d, length2, inverse};
    s.edges[--s.first_edge[b]] = {-d, length2, inverse};
  }
}

Silhouette silhouetteOf(const VesselTree& tree, const Eigen::Matrix3Xd& points, const XrayView& view,
                        const Pose& T_camera_model) {
  const Pose T_view_model = view.T_view_first * T_camera_model;
  Silhouette s;
  s.pixel.resize(2, points.cols());
  std::vector<int> place(static_cast<std::size_t>(points.cols()), -1);  // In the silhouette.
  int seen = 0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const auto pixel = view.camera.project(T_view_model * points.col(i));
    if (!pixel || !view.sees(*pixel)) continue;
    s.pixel.col(seen) = *pixel;
    place[i] = seen++;
  }
  s.pixel.conservativeResize(2, seen);
  std::vector<std::pair<int, int>> pairs;
  pairs.reserve(place.size());
  for (std::size_t i = 0; i < place.size(); ++i) {
    const int parent = tree.parents()[i];
    if (parent < 0 || place[i] < 0 || place[parent] < 0) continue;
    pairs.emplace_back(place[i], place[parent]);
  }
  addEdges(pairs, s);
  return s;
}

// Whether points of a branch stand further apart than that.
bool isSparse(const Centerline2d& c, double step_px) {
  for (int j = 1; c.ordered() && j < c.size(); ++j) {
    if (c.branch[j] != c.branch[j - 1]) continue;
    const double apart_px2 = (c.points_px.col(j) - c.points_px.col(j - 1)).squaredNorm();
    if (apart_px2 > step_px * step_px && apart_px2 <= kMaxStep_px * kMaxStep_px) return true;
  }
  return false;
}

Eigen::Matrix2Xd unitTangents(const Centerline2d& c) {
  Eigen::Matrix2Xd result(2, c.size());
  for (int j = 0; j < c.size(); ++j) result.col(j) << std::cos(c.tangent_rad[j]), std::sin(c.tangent_rad[j]);
  return result;
}

// Model and image of one view, each in a grid.
class Comparison {
 public:
  Comparison(const Centerline2d& image, const Silhouette& model, const AlignmentScoreGate& gate)
      : image_(image), model_(model), gate_px_(gate.distance_px) {
    direction_ = unitTangents(image);
    // Between points that stand further apart than the gate reaches from both, a line would explain nothing.
    if (isSparse(image, 2 * gate_px_)) {
      const Centerline2d line = densified(image, gate_px_);
      between_ = unitTangents(line);
      line_grid_.build(line.points_px);
    } else {
      line_grid_.build(image.points_px);
    }
    model_grid_.build(model.pixel);
    // Undirected tangents are never more than a right angle apart.
    const double cosine = std::cos(gate.angle_rad);
    min_cos2_ = gate.angle_rad > kPi / 2 ? -1 : cosine * cosine;
  }

  void measureModel(Tally& tally) const {
    const Eigen::Matrix2Xd& tangents = between_.cols() > 0 ? between_ : direction_;
    for (int k = 0; k < model_.size(); ++k) {
      const auto found = line_grid_.nearest(model_.pixel.col(k));
      const double distance = std::sqrt(found.distance2_px2);
      bool along = false;
      edgesOf(k, [&](const auto& edge) { along |= runsAlong(edge, tangents.col(found.index)); });
      tally.measure(distance, (distance < gate_px_) & along);
    }
  }

  void measureImage(Tally& tally) const {
    for (int j = 0; j < image_.size(); ++j) {
      const Eigen::Vector2d q = image_.points_px.col(j);
      const auto found = model_grid_.nearest(q);
      const Eigen::Vector2d from_model = q - model_.pixel.col(found.index);
      double distance2 = found.distance2_px2;
      bool along = false;
      edgesOf(found.index, [&](const auto& edge) {
        const double share = std::clamp(from_model.dot(edge.to_other) * edge.inverse_length2, 0.0, 1.0);
        distance2 = std::min(distance2, (from_model - share * edge.to_other).squaredNorm());
        along |= runsAlong(edge, direction_.col(j));
      });
      const double distance = std::sqrt(distance2);
      tally.measure(distance, (distance < gate_px_) & along);
    }
  }

 private:
  template <typename Visit>
  void edgesOf(int k, const Visit& visit) const {
    const auto end = static_cast<std::size_t>(model_.first_edge[static_cast<std::size_t>(k) + 1]);
    for (auto e = static_cast<std::size_t>(model_.first_edge[k]); e < end; ++e) {
      visit(model_.edges[e]);
    }
  }

  // Whether an edge runs along a unit tangent of the image. One seen end-on has no direction to disagree with.
  bool runsAlong(const Silhouette::Edge& edge, const Eigen::Vector2d& tangent) const {
    const double together = edge.to_other.dot(tangent);
    // No branches here and above: what they would decide on cannot be foretold.
    return (edge.length2 < 1) | (together * together > min_cos2_ * edge.length2);
  }

  const Centerline2d& image_;
  const Silhouette& model_;
  double gate_px_, min_cos2_;
  BucketGrid line_grid_, model_grid_;
  Eigen::Matrix2Xd direction_;  // 2 x image points: unit tangents.
  Eigen::Matrix2Xd between_;    // The same with points between them; empty where none are needed.
};

}  // namespace

AlignmentScore alignmentScore(const VesselTree& tree, const Eigen::Matrix3Xd& points_model, const XrayViews& views,
                              const Pose& T_camera_model, const AlignmentScoreGate& gate) {
  Tally model, image;
  for (const XrayView& view : views) {
    const Silhouette seen = silhouetteOf(tree, points_model, view, T_camera_model);
    model.points += seen.size();
    image.points += view.centerline.size();
    if (seen.size() == 0 || view.centerline.size() == 0) continue;
    const Comparison comparison(view.centerline, seen, gate);
    comparison.measureModel(model);
    comparison.measureImage(image);
  }
  AlignmentScore result;
  result.model_points = model.points;
  result.model_explained = model.share();
  result.model_residual_px = model.mean_px();
  result.model_rms_px = model.rms_px();
  result.image_explained = image.share();
  result.image_residual_px = image.mean_px();
  return result;
}

}  // namespace angio::registration
