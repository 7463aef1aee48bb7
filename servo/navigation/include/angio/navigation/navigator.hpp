// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "angio/localisation/tip_belief.hpp"
#include "angio/messaging/messages.hpp"
#include "angio/navigation/navigator_settings.hpp"
#include "angio/navigation/tip_deflection.hpp"
#include "angio/navigation/tip_roll.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::navigation {

/// What one frame tells the navigator.
struct NavigationInput {
  std::int64_t time_us = 0;  ///< Of the exposure, sender's monotonic clock.
  std::int64_t frame_sequence = 0;
  std::optional<TipBelief> belief;          ///< Where the tip is; nothing when the frame could not be trusted.
  std::optional<TipDeflection> deflection;  ///< How it is deflected, where that is seen.
  CatheterState drive;                      ///< At the exposure.
  double period_s = 0;                      ///< Since the frame before.
  double latency_s = 0;                     ///< From an exposure until its command moves the drive.
};

enum class NavigationState {
  kWaiting,     ///< Does not know enough to move.
  kFollowing,   ///< Pushes along the route.
  kLooking,     ///< Turns the tip around, to see how it lies.
  kAiming,      ///< Turns and bends the tip in front of a fork.
  kCrossing,    ///< Pushes across the fork.
  kBackingOff,  ///< Pulls back: to a fork it missed, from a wall, or out of doubt.
  kArrived,
  kGivenUp  ///< Has tried as often as it may; stands still until it gets another target.
};

const char* stateName(NavigationState state);

/// What it does with the frame. The default stands still.
struct NavigationAnswer {
  CatheterCommand command;
  NavigationState state = NavigationState::kWaiting;
  std::string why;            ///< Why it stands still or goes back; empty when all is well.
  bool another_view = false;  ///< Another view would help: doubt has lasted, or a fork has been missed again.
};

struct RouteView;

/// Steers a catheter's tip through the vessels to a place: the task `navigate`.
///
/// It pushes along the route; in front of each fork it turns and bends the tip so that it points into the wanted branch
/// by the widest margin, pushes across, and sees by the belief which branch was entered; from a wrong one it pulls back
/// and tries again. Which way the tip points is estimated from what turning it does in the image (TipRoll). It stands
/// still without a belief, backs off from force, from walls and from lasting doubt, and never moves on a number that is
/// not finite.
///
/// Knows neither clock nor bus; the same inputs give the same answers.
class Navigator {
 public:
  /// Borrows nothing. Throws InputError when a setting is out of its range or the target is none of the tree's places.
  Navigator(const VesselTree& tree, const TreeLocation& target, const NavigatorSettings& settings);

  NavigationAnswer step(const NavigationInput& input);

  const TreeTopology& map() const { return map_; }
  const TipRoll& roll() const { return roll_; }
  int misses() const { return misses_; }  ///< Wrong branches entered, and walls met.

 private:
  NavigationAnswer decide(const NavigationInput& input);
  NavigationAnswer doubt(const NavigationInput& input, const std::string& why);
  NavigationAnswer follow(const NavigationInput& input, const RouteView& view);
  NavigationAnswer look(const NavigationInput& input);
  NavigationAnswer aim(const NavigationInput& input);
  NavigationAnswer cross(const NavigationInput& input, const RouteView& view);
  NavigationAnswer backOff(const NavigationInput& input, const RouteView& view);
  NavigationAnswer miss(const NavigationInput& input, const RouteView& view, const std::string& why);
  NavigationAnswer atFork(const NavigationInput& input, const RouteView& view);
  NavigationAnswer go(const NavigationInput& input, double insertion_m_per_s, double roll_rad_per_s,
                      double bend_rad) const;
  std::optional<std::string> resistance(const NavigationInput& input, double path_m);
  bool sureOf(const RouteView& view) const;
  void planNext(int next);
  std::vector<int> closeForks(int next) const;

  NavigatorSettings settings_;
  TreeTopology map_;
  TreeLocation target_;
  TipRoll roll_;
  NavigationState state_ = NavigationState::kFollowing;
  std::string why_;
  std::int64_t sequence_ = 0;

  std::optional<double> last_path_m_;               // Of the tip, when it was last believed.
  std::optional<std::pair<double, double>> since_;  // Drive and tip when both last moved together.
  double doubtful_s_ = 0, retreated_m_ = 0;
  bool asked_ = false, asked_ahead_ = false;  // For another view, in this doubt; behind this fork.
  int jumped_ = 0, beside_frames_ = 0, there_frames_ = 0;
  std::map<int, int> tries_;  // At each fork, by the chain that ends there.
  int misses_ = 0;
  std::optional<int> planned_;  // The chain that the aim is for: behind the next fork, or behind some close ones.
  double aim_angle_rad_ = 0, aim_bend_rad_ = 0;
  double aimed_s_ = 0, looked_rad_ = 0, last_roll_rad_ = 0;
  bool looked_ = false;   // In this try.
  double back_to_m_ = 0;  // Path length to pull back to.
};

}  // namespace angio::navigation
