// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "centre_lines.hpp"
#include "ridge_scales.hpp"
#include "tracks.hpp"
#include "tube_shadows.hpp"

namespace angio::imaging {

/// Fits tubes along the branches of a graph: moves lines onto the vessels' middles, measures them. Each vessel is
/// fitted first to all that the image shows, then, where others are near, to what is left of it without their shadows.
class RidgeFitting {
  // What no noise explains: vessels bend, taper and are not round [working px].
  static constexpr float kModelSigma = 0.025f;

 public:
  RidgeFitting(float max_radius, const RidgeScales& scales);

  /// The graph's live branches, each as one line; free ends, junctions and crossings stay where they are in the graph.
  std::vector<CentreLine> operator()(const SkeletonGraph& graph, const RidgeScales& scales);

 private:
  struct Point {
    float offset = 0, radius = 1, sigma = 0, contrast = 0, misfit = 0, bias = 0;
    bool valid = false;

    // Of the offset.
    float weight() const { return 1 / (sigma * sigma + bias * bias + kModelSigma * kModelSigma); }
  };
  struct Fitted {
    Track track;
    std::vector<Point> fits;             // Some for the track's points,
    std::vector<Point> points;           // and one for each of them: fits averaged along the track.
    std::ptrdiff_t first = 0, last = 0;  // What of them is vessel: [first, last).
  };
  // Where a profile is taken: a place of a tube, and its direction there.
  struct Place {
    int tube = 0;
    cv::Point2f position, along;
    float radius = 1;
  };
  enum class Others { kStay, kTakenAway };

  Track trackOn(const SkeletonGraph& graph, std::size_t branch, const RidgeScales& scales) const;
  std::vector<Fitted> fittedAlone(const SkeletonGraph& graph, const RidgeScales& scales);
  void fitTogether(const SkeletonGraph& graph, const RidgeScales& scales, std::vector<Fitted>& lines);
  static std::vector<TubeShadows::Piece> piecesOf(const Fitted& line);

  Point fitAt(const RidgeScales& scales, const Place& place, Others others) const;
  void fitAlong(const SkeletonGraph& graph, const RidgeScales& scales, Fitted& line, int tube, Others others) const;
  static void findReaches(const SkeletonGraph& graph, Fitted& line);
  static void findEnds(Fitted& line);
  static bool isNothing(const Fitted& line);
  static void trim(Fitted& line);
  static void average(Fitted& line);
  static void recenter(Fitted& line);
  CentreLine finished(const SkeletonGraph& graph, const Fitted& line) const;

  static constexpr float kThinnest = 0.5f;        // Radius [working px].
  static constexpr int kFitEvery = 2;             // Fits are made at every other point: nearer ones share their noise.
  static constexpr float kCorrelation = 3.5449f;  // Gauss-filtered noise is alike over 2 sqrt(pi) of its sigmas.

  TubeTemplates templates_;
  float max_radius_ = 20;
  TubeShadows shadows_;
};

}  // namespace angio::imaging
