// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "angio/localisation/catheter_localiser.hpp"
#include "angio/localisation/seen_catheter.hpp"
#include "place_grid.hpp"

namespace angio::localisation {

/// A seen curve as it is compared with paths: points in equal steps, from the tip back.
struct CurveSamples {
  std::vector<Eigen::Vector2d> points_px;  ///< The tip first.
  double step_px = 0;
  double length_px = 0;
  double std_px = 1;
};

constexpr int kMaxSamples = 120;  ///< Longer curves get wider steps.

/// What is wrong with a curve, or nothing: fewer than two points, a coordinate or sigma that is not finite, no length.
std::optional<std::string> defectOf(const SeenCatheter& seen);

/// The curve from its last point back, or from its first on. The curve must be without defect.
CurveSamples samplesOf(const SeenCatheter& seen, double step_px, bool tip_is_last);

/// How an image lies against the projected tree, about the projected tip c: a point q of the image shows the tree's
/// c + ((1 - k) I - roll J)(q - shift - c), with J a quarter turn. In order: shift x, y [px], k [1], roll [rad].
using Misfit = Eigen::Vector4d;

/// What is known of a misfit before the curve is compared: a mean and the inverse of its covariance.
struct MisfitPrior {
  Misfit mean = Misfit::Zero();
  Eigen::Matrix4d information = Eigen::Matrix4d::Identity();
};

/// Where one point of the curve has its match.
struct SampleMatch {
  int sample = 0;
  int place = 0;      ///< On the edge from this place to its parent,
  double weight = 0;  ///< this far along it, in [0, 1].
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();
  double distance_px = 0;  ///< Along the normal, signed.
  double trust = 0;        ///< 1 for a point on the path, towards 0 for a stray one.
};

/// One curve against the path from one place to the root.
struct PathMatch {
  Misfit misfit = Misfit::Zero();
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  double log_evidence = 0;  ///< Of curve given place, misfit integrated out (Laplace), up to a constant of the frame.
  double residual_px = 0;   ///< Mean distance of the points whose match is not beyond the root.
};

/// Compares curves with paths on one tree.
class PathMatcher {
 public:
  PathMatcher(const LocaliserSettings& settings, const PlaceGrid& grid) : settings_(settings), grid_(grid) {}

  /// Sets the frame: the grid's projection (2 x N [px], all finite; borrowed) and the curve (borrowed). Every
  /// `stride`-th of its points is used.
  void prepare(const Eigen::Matrix2Xd& projected_px, const CurveSamples& curve, int stride);

  /// Finds the misfit that lays the curve's tip on the place's projection and the curve on the path behind it, in
  /// order. `start`: a misfit to begin with; without one the tip and the prior make it.
  PathMatch match(int place, const MisfitPrior& prior, int iterations,
                  const std::optional<Misfit>& start = std::nullopt);

  /// Points of the curve and their places of the last match.
  const std::vector<SampleMatch>& lastMatches() const { return matches_; }

 private:
  // A point of a path: on the edge from a place to its parent, this far along it.
  struct Position {
    int place = 0;
    double weight = 0;
  };
  struct Step {
    Position to;
    double squared_px = 0;     // Distance.
    bool beyond_root = false;  // The curve goes on where the path has ended.
  };
  struct Equations {
    Eigen::Matrix4d H;
    Eigen::Vector4d g;
  };

  double walk(int place, const Misfit& misfit);
  Step ahead(const Position& from, const Eigen::Vector2d& q, double expected_px) const;
  Equations equations(int place, const Misfit& x, const MisfitPrior& prior) const;
  Eigen::Vector2d observedPoint(const Eigen::Vector2d& sample, const Eigen::Vector2d& tip, const Misfit& misfit) const;

  const LocaliserSettings& settings_;
  const PlaceGrid& grid_;
  const Eigen::Matrix2Xd* projected_ = nullptr;
  const CurveSamples* curve_ = nullptr;
  int stride_ = 1;
  double step_px_ = 0, std_px_ = 1, tip_variance_ = 1, share_ = 1;
  std::vector<SampleMatch> matches_;
  double distance_sum_px_ = 0;
};

}  // namespace angio::localisation
