// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "line_step.hpp"
#include "oriented_frame.hpp"
#include "oriented_model.hpp"
#include "pose_prior_term.hpp"
#include "residual_groups.hpp"

namespace angio::registration {

/// How a line fit goes.
struct LineFitPlan {
  double gate_px = 8;       ///< Image points further than this from every edge have no match, to begin with.
  int first_points = 500;   ///< About so many image points, evenly chosen, take part in the first rounds ...
  int max_points = 100000;  ///< ... and so many in the others.
  int max_rounds = 8;       ///< Of matching anew; each has two steps.
  double rest = 0.1;        ///< A round that moves the projection by less than this share of the noise is the last.
};

/// After the fields, whose last gate is half the finest scale or so: all of the image, to rest; and, for one candidate
/// among others, a part of it, no further than it takes to compare.
constexpr double kAfterFields_px = 8;
constexpr LineFitPlan kFull{kAfterFields_px, 500, 100000, 8, 0.1};
constexpr LineFitPlan kQuick{kAfterFields_px, 300, 300, 3, 0.1};

/// Where a line fit came to rest.
struct LineFitResult {
  Pose T_camera_centered = Pose::Identity();
  Matrix6d information = Matrix6d::Zero();  ///< Of the twist about the centroid, model axes, prior included; see below.
  double noise_px = 0;                      ///< Standard deviation of the matched points across their edges.
  double last_step_px = 0;
  int steps = 0;
  double currency = 0;  ///< What a squared residual counts in the information [1/px^2].
};

/// Point-to-line fit from image to model: every image point pulls the nearest oriented edge of the projected model onto
/// itself, across the edge only. The noise is in the image, so this is the direction in which residuals are independent
/// and their sum of squares is the likelihood.
///
/// Matches and weights (Gaussian in the distance) follow the noise that is found. The information counts each image
/// point once with that noise, corrected for the weights' loss of efficiency, and for residuals that go together along
/// a branch, as those of a deformed vessel do: neighbours that say the same count as one.
class LineFit {
 public:
  explicit LineFit(const OrientedModel& model) : model_(model) {}

  LineFitResult fit(const OrientedFrame& frame, const PosePriorTerm& belief, const Pose& T_camera_centered,
                    const LineFitPlan& plan);

  /// Returns the residuals of the last fit, matched as they were in its last round, in some dozens of groups along the
  /// vessels. `frame` is that of the fit.
  std::vector<ResidualGroup> residuals(const OrientedFrame& frame, const Pose& T_camera_centered) const;

  /// Mean over the image points of exp(-d^2 / 2 scale^2), d their distance to the nearest edge that runs along: how
  /// much of the image the model explains, in [0, 1].
  double explained(const OrientedFrame& frame, const Pose& T_camera_centered, double scale_px, int max_points);

 private:
  const OrientedPoints& chosen(const OrientedFrame& frame, std::size_t view, int max_points);

  const OrientedModel& model_;
  ProjectedEdges projected_;
  std::vector<LineMatches> matches_;
  std::vector<OrientedPoints> chosen_;
  std::vector<const OrientedPoints*> used_;
  double tolerance_px_ = 1;  // Of the last fit's weights.
};

}  // namespace angio::registration
