// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/view_planner.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/navigation/navigator.hpp"
#include "fork_plan.hpp"

namespace angio::navigation {
namespace {

constexpr double kMinStretch_m = 10e-3;  // A stretch that a view can be chosen for.
constexpr double kForkWeight = 1.5;     // Of forks that are seen from within their plane, against a vessel seen end-on.
constexpr double kShownWell = 0.85;     // Of a side of a fork, in the image: more is no better.
constexpr double kNextForks_m = 30e-3;  // Over this way a fork's weight falls ...
constexpr double kThisFork_m = 6e-3;    // ... and where the last view did not show the one ahead.
constexpr double kLever_m = 1e-3 * NavigatorSettings::lever_mm;

BestViewSettings searchOf(const ViewPlannerSettings& settings) {
  BestViewSettings search;
  search.step_deg = settings.step_deg;
  search.max_primary_deg = settings.max_primary_deg;
  search.max_secondary_deg = settings.max_secondary_deg;
  return search;
}

bool anyReachable(const BestViewScene& scene, const ViewPlannerSettings& settings) {
  for (double p = -settings.max_primary_deg; p <= settings.max_primary_deg; p += settings.step_deg) {
    for (double s = -settings.max_secondary_deg; s <= settings.max_secondary_deg; s += settings.step_deg) {
      if (scene.reachable({degToRad(p), degToRad(s)})) return true;
    }
  }
  return false;
}

}  // namespace

ViewPlanner::ViewPlanner(const VesselTree& tree, const TreeLocation& target, const BestViewScene& scene,
                         const ViewPlannerSettings& settings)
    : tree_(tree), map_(tree), target_(target), scene_(scene), settings_(settings) {
  checkSettings("view planner", settings);
  if (target.branch < 0 || target.branch >= map_.branchCount()) {
    throw InputError("view planner", "target", std::to_string(target.branch),
                     "must be one of the tree's " + std::to_string(map_.branchCount()) + " branches");
  }
  target_path_m_ = map_.start_m(target.branch) + target.arc_m;
}

// Path length of the tip, or of the fork where it has left the route.
double ViewPlanner::onRoute(const TreeLocation& tip) const {
  int branch = tip.branch;
  double path_m = map_.start_m(branch) + tip.arc_m;
  while (!map_.passes(target_.branch, branch)) {
    path_m = map_.start_m(branch);
    const auto parent = map_.parent(branch);
    if (!parent) return 0;
    branch = *parent;
  }
  return std::min(path_m, target_path_m_);
}

// The route's forks from one path length to another.
std::vector<ViewPlanner::SeenFork> ViewPlanner::forksBetween(double from_m, double to_m) const {
  std::vector<SeenFork> forks;
  for (const int branch : map_.pathTo(target_.branch)) {
    if (map_.start_m(branch) < from_m || map_.start_m(branch) > to_m) continue;
    const Fork fork = forkAt(map_, branch, target_.branch, kLever_m);
    const Eigen::Vector2d side = sideTowards(fork);
    if (side.isZero()) continue;
    forks.push_back(
        {fork.frame.along.cross(side.x() * fork.frame.normal + side.y() * fork.frame.binormal), map_.start_m(branch)});
  }
  return forks;
}

std::optional<PlannedView> ViewPlanner::next(const TreeLocation& tip, bool in_doubt, bool loose) {
  const double path_m = onRoute(tip), behind_m = 1e-3 * settings_.behind_mm;
  const bool passed =
      stretch_m_ && stretch_m_->second < target_path_m_ && path_m > stretch_m_->second - 1e-3 * settings_.renew_mm;
  const bool behind = stretch_m_ && path_m < stretch_m_->first;
  if (stretch_m_ && !passed && !behind && !in_doubt) return std::nullopt;
  const double ahead_m = 1e-3 * (loose ? settings_.loose_ahead_mm : settings_.ahead_mm);
  const double to_m = std::min(path_m + ahead_m, target_path_m_);
  const double from_m = std::max(0.0, std::min(path_m - behind_m, to_m - kMinStretch_m));
  const EdgePoint first = map_.spot(map_.before(target_, target_path_m_ - from_m));
  const EdgePoint last = map_.spot(map_.before(target_, target_path_m_ - to_m));
  BestViewScene scene = scene_;
  if (in_doubt && stretch_m_) {
    const double closest = std::cos(degToRad(settings_.other_deg));
    scene.reachable = [this, closest](const ViewAngles& angles) {
      // Seen from opposite sides, all is as it was.
      return std::abs(beamDirection(angles).dot(beamDirection(scene_.near))) < closest &&
             (!scene_.reachable || scene_.reachable(angles));
    };
    if (!anyReachable(scene, settings_)) return std::nullopt;
  }
  if (loose) {
    const double reach_m = in_doubt ? kThisFork_m : kNextForks_m;
    scene.other_cost = [this, path_m, reach_m,
                        forks = forksBetween(path_m - kLever_m, to_m)](const ViewAngles& angles) {
      const Eigen::Vector3d beam = scene_.R_lps_model.transpose() * beamDirection(angles);
      double cost = 0, weights = 1e-9;
      for (const SeenFork& fork : forks) {
        const double weight = std::exp(-std::max(fork.path_m - path_m, 0.0) / reach_m);
        weights += weight;
        cost += weight * std::max(0.0, 1 - std::abs(beam.dot(fork.across_model)) / kShownWell);
      }
      return kForkWeight * cost / weights;
    };
  }
  const BestView best = bestView(tree_, segmentBetween(tree_, first.a, last.b), scene, searchOf(settings_));
  scene_.near = best.angles;
  stretch_m_ = {from_m, to_m};
  return PlannedView{best.angles, best.target_model};
}

}  // namespace angio::navigation
