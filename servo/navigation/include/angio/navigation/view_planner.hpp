// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/navigation/namespace.hpp"
#include "angio/servo/best_view.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::navigation {

/// How much of a catheter's route one view must show.
struct ViewPlannerSettings {
  double behind_mm = 20;  ///< From the tip back to the start of the stretch that a view is chosen for.
  double ahead_mm = 60;   ///< From the tip to the end of that stretch, which is at the target at most.
  static constexpr double loose_ahead_mm = 90;  ///< The same of a loose catheter.
  double renew_mm = 15;                         ///< Distance before that end from which the next view is chosen.
  static constexpr double other_deg = 30;  ///< If ambiguous, the next view is at least so far from the present one.
  double max_primary_deg = 90;
  double max_secondary_deg = 45;
  double step_deg = 7.5;  ///< Between the views that are compared.

  void visit(SettingsVisitor& v) {
    v.number("max_primary_deg", max_primary_deg, 1, 110, "Largest LAO and RAO of the views that are compared");
    v.number("max_secondary_deg", max_secondary_deg, 1, 55, "Largest CRA and CAU of the views that are compared");
    v.fixed("behind_mm", behind_mm, 0, 1000);
    v.fixed("ahead_mm", ahead_mm, 10, 1000);
    v.fixed("renew_mm", renew_mm, 0, 1000);
    v.fixed("step_deg", step_deg, 0.5, 15);
  }
};

/// A view, and the place of the model that belongs at the isocentre in it.
struct PlannedView {
  ViewAngles angles;
  Eigen::Vector3d middle_model = Eigen::Vector3d::Zero();  ///< [m]
};

/// Chooses a C-arm's views of a catheter on its route: the best view (bestView) of the stretch around its tip.
///
/// A loose catheter is steered by what the image shows of it beside its vessel, so that its views show forks too: they
/// look across the plane of both branches, of the next fork before all.
///
/// A view is kept while the tip stays in its stretch. If it is ambiguous, the best view at least `other_deg` away
/// replaces it: a vessel that runs along one beam, or behind another vessel, does not in the other.
class ViewPlanner {
 public:
  /// Throws InputError when a setting is out of its range or the target is none of the tree's places.
  ViewPlanner(const VesselTree& tree, const TreeLocation& target, const BestViewScene& scene,
              const ViewPlannerSettings& settings);

  /// Returns the next view, with the tip estimated to be at `tip`. Returns nothing while the present view is kept, or
  /// when another is needed and none is in reach. The first call always returns one. Throws InputError as bestView().
  ///
  /// @param in_doubt  The present view is ambiguous.
  /// @param loose     Navigator::isLoose().
  std::optional<PlannedView> next(const TreeLocation& tip, bool in_doubt, bool loose = false);

 private:
  struct SeenFork {
    Eigen::Vector3d across_model;  // Unit normal of the plane in which both branches leave it.
    double path_m;
  };
  double onRoute(const TreeLocation& tip) const;
  std::vector<SeenFork> forksBetween(double from_m, double to_m) const;

  VesselTree tree_;
  TreeTopology map_;
  TreeLocation target_;
  double target_path_m_;
  BestViewScene scene_;
  ViewPlannerSettings settings_;
  std::optional<std::pair<double, double>> stretch_m_;  // Path lengths along the route that the present view is for.
};

}  // namespace angio::navigation
