// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "angio/registration/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::registration {

/// The vessels of a tree in pieces of about equal length, each by its middle.
struct ModelSamples {
  Eigen::Matrix3Xd points;    ///< 3 x N, about the tree's centroid [m], model axes.
  Eigen::Matrix3Xd tangents;  ///< 3 x N, unit vectors; zero where a vessel has no length.
  Eigen::VectorXd length_m;   ///< N, of the piece.

  int size() const { return static_cast<int>(points.cols()); }
};

/// The curves of an image in pieces of about equal length, each by its middle.
struct ImageSamples {
  Eigen::Matrix2Xd points_px;  ///< 2 x M.
  Eigen::Matrix2Xd direction;  ///< 2 x M: (cos, sin) of twice the tangent's angle, the same for both senses.
  Eigen::VectorXd length_px;   ///< M, of the piece.

  int size() const { return static_cast<int>(points_px.cols()); }
};

/// Cuts every branch of the tree into equal pieces no longer than `spacing_m` [m].
ModelSamples modelSamples(const VesselTree& tree, double spacing_m);

/// Cuts every branch of the image into equal pieces no longer than `spacing_px`. The order of the branches does not
/// change the samples. Steps longer than kMaxStep_px are gaps. A centreline without branches keeps its points: each
/// stands for the mean distance from a point to its nearest neighbour.
ImageSamples imageSamples(const Centerline2d& centerline, double spacing_px);

}  // namespace angio::registration
