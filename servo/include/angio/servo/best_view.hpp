// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/servo/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::servo {

/// A stretch of a vessel: indices of tree points, each the parent of the next.
using TreeSegment = std::vector<int>;

/// One of VesselTree::branches(). Throws InputError when there is none of this number.
TreeSegment segmentOfBranch(const VesselTree& tree, int branch);

/// From one point down to another. Throws InputError when a point does not exist, they are the same, or the second does
/// not lie downstream of the first.
TreeSegment segmentBetween(const VesselTree& tree, int first, int last);

/// Which views are looked at, and what makes one bad.
struct BestViewSettings {
  double step_deg = 2;  ///< Of the map; the best view is then searched for between its nodes.
  double max_primary_deg = 110;
  double max_secondary_deg = 50;
  static constexpr double overlap_weight = 1;  ///< A segment all covered costs as much as one seen end-on times this.
  static constexpr double turn_weight = 0.01;  ///< Cost of 90 deg from where the arm is: decides where views are alike.
  static constexpr double unknown_radius_mm = 1;  ///< Of points that have none.
  static constexpr int max_points = 800;          ///< The tree is thinned to so many.
  static constexpr int segment_points = 40;

  void visit(SettingsVisitor& v) {
    v.number("max_primary_deg", max_primary_deg, 1, 180, "Largest LAO and RAO that is looked at");
    v.number("max_secondary_deg", max_secondary_deg, 1, 89, "Largest CRA and CAU that is looked at");
    v.fixed("step_deg", step_deg, 0.25, 30);
  }
};

/// What a view costs. Both in [0, 1].
struct ViewCost {
  double foreshortening = 0;  ///< 1 - seen length / true length, each piece against its own ray.
  double overlap = 0;         ///< Share of the segment's seen width that other vessels cover, mean over its length.
};

/// Costs over the angles; row i is secondary(i), column j primary(j).
struct ViewMap {
  double step_rad = 0, first_primary_rad = 0, first_secondary_rad = 0;
  Eigen::MatrixXf foreshortening, overlap;
  Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic> reachable;  ///< Costs are zero where it is false.

  double primary_rad(Eigen::Index column) const { return first_primary_rad + static_cast<double>(column) * step_rad; }
  double secondary_rad(Eigen::Index row) const { return first_secondary_rad + static_cast<double>(row) * step_rad; }
};

/// The best view of a segment, and the costs of all views.
struct BestView {
  ViewAngles angles;  ///< In the patient's own axes.
  ViewCost cost;
  Eigen::Vector3d target_model;  ///< The middle of the segment, by arc length [m]: what belongs at the isocentre.
  ViewMap map;
};

/// What a search needs to know beside the tree.
struct BestViewScene {
  Eigen::Matrix3d R_lps_model = Eigen::Matrix3d::Identity();  ///< Patient axes L, P, S from the model's axes.
  double source_isocenter_distance_m = 0.81;
  ViewAngles near;                                      ///< Where the arm is.
  std::function<bool(const ViewAngles&)> reachable;     ///< Empty: all within the settings' range are.
  std::function<double(const ViewAngles&)> other_cost;  ///< Of a view, beside ViewCost; empty: none.
};

/// The scene of an arm: views are reachable within the ranges of its angles and its envelope, and some degrees inside
/// them, for a patient who lies askew.
///
/// @param R_lps_model  Patient axes L, P, S from the model's axes.
BestViewScene bestViewScene(const CArmGeometry& carm, const CArmLimits& limits, const Eigen::Matrix3d& R_lps_model);

/// The view of least foreshortening of the segment and least overlap with the rest of the tree, its vessels being
/// tubes.
///
/// Vessels that the segment is joined to within a few radii along the tree do not count: they touch it in every view.
/// Source: Dumay, Reiber, Gerbrands, "Determination of optimal angiographic viewing angles", IEEE Trans. Medical
/// Imaging 13(1), 1994 (foreshortening); Chen & Carroll, "3-D reconstruction of coronary arterial tree to optimize
/// angiographic visualization", IEEE Trans. Medical Imaging 19(4), 2000 (overlap, maps of both).
///
/// Throws InputError when a setting is out of its range, the segment is none, or no view is reachable.
BestView bestView(const VesselTree& tree, const TreeSegment& segment, const BestViewScene& scene,
                  const BestViewSettings& settings = {});

}  // namespace angio::servo
