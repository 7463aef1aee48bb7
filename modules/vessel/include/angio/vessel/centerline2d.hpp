// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/vessel/namespace.hpp"

namespace angio::vessel {

/// What a curve in an X-ray image is: a vessel with contrast agent in it, or a catheter or guidewire.
enum class CurveKind { kVessel, kDevice };

/// Vessel centreline seen in one X-ray image [px]: what an extractor gives and a registration takes.
struct Centerline2d {
  Eigen::Matrix2Xd points_px;   ///< 2 x N.
  Eigen::VectorXd tangent_rad;  ///< N, undirected: in [-pi/2, pi/2).
  std::vector<int> branch;      ///< N, or empty without an order. Points of one branch stand together, in order.
  Eigen::VectorXd radius_px;    ///< N, or empty when unknown.
  Eigen::VectorXd std_px;       ///< N, standard deviation of the position across the curve; empty when unknown.
  Eigen::VectorXd contrast;     ///< N, how much the curve weakens the beam (natural logarithm); empty when unknown.
  std::vector<CurveKind> kind;  ///< N, or empty: all are vessels.

  int size() const { return static_cast<int>(points_px.cols()); }
  bool ordered() const { return !branch.empty(); }
};

/// Builds a centreline and its tangents: along the branch by a chord of some pixels that noise cannot turn, or, without
/// branches, along the main axis of the nine nearest points.
///
/// Throws InputError when a coordinate is not finite or sizes differ.
Centerline2d makeCenterline(Eigen::Matrix2Xd points_px, std::vector<int> branch = {}, Eigen::VectorXd radius_px = {});

/// The points that are to be kept (one flag a point), in their order, with all that is known of them. Branches are
/// numbered anew: one that loses points in its middle becomes two.
Centerline2d pointsWhere(const Centerline2d& centerline, const std::vector<bool>& keep);

/// The points of one kind.
Centerline2d ofKind(const Centerline2d& centerline, CurveKind kind);

/// What a registration of vessels goes by: the vessels; or everything, where devices are most of what there is: a
/// catheter lies in a vessel.
Centerline2d vesselsToMatch(Centerline2d seen);

/// Puts points between the points of each branch so that none are further apart than `spacing_px`; all points stay.
/// A step of more than kMaxStep_px is a gap, not a vessel, and stays one. A centreline without branches, or
/// `spacing_px` = 0, comes back as it is. A new point's radius, uncertainty and contrast lie between its neighbours',
/// and it is of their branch's kind.
constexpr double kMaxStep_px = 200;
Centerline2d densified(const Centerline2d& centerline, double spacing_px);

/// An undirected angle brought into [-pi/2, pi/2).
double undirected(double angle_rad);

}  // namespace angio::vessel
