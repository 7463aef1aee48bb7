// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/localisation/tip_belief.hpp"
#include "angio/navigation/namespace.hpp"
#include "angio/navigation/shaft_offset.hpp"
#include "angio/navigation/tip_roll.hpp"
#include "angio/navigation/turn_search.hpp"
#include "angio/types/any_message.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::navigation {

/// The catheter's dimensions, speeds and bounds of the navigator.
struct NavigatorSettings {
  // The catheter, by its data sheet.
  double tip_length_mm = 6;
  double tip_angle_deg = 25;
  double max_bend_deg = 90;
  static constexpr double dead_band_deg = 30;  ///< Of roll, between drive and tip, from one side to the other.

  // Speeds.
  double speed_mm_per_s = 12;
  double fork_speed_mm_per_s = 4;
  double back_speed_mm_per_s = 8;
  double roll_speed_deg_per_s = 120;
  double bend_speed_deg_per_s = 60;
  double valid_for_ms = 300;

  // Forks.
  static constexpr double slow_mm = 12;
  static constexpr double aim_mm = 4;  ///< Before a fork, the tip is aimed.
  static constexpr double confirm_mm =
      2;                                 ///< Distance beyond the parting of branches from which one counts as entered.
  static constexpr double sure_mm = 10;  ///< The same distance for a wrong branch of low probability.
  static constexpr double short_mm = 9;  ///< Forks closer to each other are aimed for together where one aim serves.
  static constexpr double back_mm = 6;   ///< Distance to retreat before a fork is tried again.
  static constexpr double lever_mm = 5.5;     ///< Along which a branch's direction is taken, give or take a third.
  static constexpr double angle_deg = 8;      ///< Of the tip, good enough.
  static constexpr double look_std_deg = 35;  ///< Standard deviation of the tip's angle above which it is turned once.
  int tries = 10;

  // Uncertainty and resistance.
  static constexpr double min_probability = 0.6;  ///< Of the branch; below, it stops and waits.
  static constexpr double max_std_mm = 5;         ///< Of the place along it; above, it stops and waits.
  static constexpr double patience_s = 2;         ///< Time of waiting before it pulls back slowly, by `retreat_mm`.
  static constexpr double retreat_mm = 25;
  double max_force_n = 0.8;
  static constexpr double stall_mm = 12;        ///< Pushed or pulled without motion of the tip: it is at a wall.
  static constexpr double loose_stall_mm = 25;  ///< The same of a loose catheter, whose shaft snakes in wide vessels.

  void visit(SettingsVisitor& v) {
    v.number("tip_length_mm", tip_length_mm, 1, 50,
             "Length of the catheter's tip from its bend to its end, by its data sheet");
    v.number("tip_angle_deg", tip_angle_deg, 0, 120, "Angle of the tip as it was shaped");
    v.number("max_bend_deg", max_bend_deg, 0, 120, "Largest bend that steering adds; 0: it cannot be steered");
    v.number("speed_mm_per_s", speed_mm_per_s, 0.1, 50, "Speed of pushing away from forks");
    v.number("fork_speed_mm_per_s", fork_speed_mm_per_s, 0.1, 50, "Speed of pushing near a fork and across it");
    v.number("back_speed_mm_per_s", back_speed_mm_per_s, 0.1, 50, "Speed of pulling back");
    v.number("roll_speed_deg_per_s", roll_speed_deg_per_s, 1, 720, "Speed of the roll");
    v.number("bend_speed_deg_per_s", bend_speed_deg_per_s, 1, 720, "Speed of the bend");
    v.number("valid_for_ms", valid_for_ms, 20, 1000, "How long a command may be obeyed");
    v.integer("tries", tries, 1, 100, "Tries at one fork");
    v.number("max_force_n", max_force_n, 0.01, 20,
             "Largest force at the drive, pushing or pulling; from nine tenths of it on it goes the other way");
  }
};

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
  kWaiting,     ///< The tip's place is unknown or uncertain.
  kFollowing,   ///< Pushes along the route.
  kLooking,     ///< Turns the tip once around, to observe its direction.
  kAiming,      ///< Turns and bends the tip in front of a fork.
  kCrossing,    ///< Pushes across the fork.
  kBackingOff,  ///< Pulls back: to a missed fork, from a wall, or from lasting uncertainty.
  kArrived,
  kGivenUp  ///< The number of tries is used up; stands still until it gets another target.
};

const char* stateName(NavigationState state);

/// What it does with the frame. The default stands still.
struct NavigationAnswer {
  CatheterCommand command;
  NavigationState state = NavigationState::kWaiting;
  std::string why;            ///< Why it stands still or goes back; empty when all is well.
  bool another_view = false;  ///< Another view would help: the tip is uncertain, or a fork was missed again.
};

struct RouteView;

/// On which side of a fork the tip stands and points, as a slope towards the wanted branch and away from the next one.
struct ForkSide {
  double slope = 0;
  double std = 1;  ///< Standard deviation of that.
};

/// Steers a catheter's tip through the vessels to a place: the task `navigate`.
///
/// It pushes along the route; in front of each fork it turns and bends the tip so that it points into the wanted branch
/// by the widest margin, pushes across, and takes from the belief which branch was entered. From a wrong one it pulls
/// back and tries again. The tip's direction is estimated from what its turns do in the image (TipRoll). Without a
/// belief it stands still. It backs off from force, from walls and from lasting uncertainty. It never moves on a number
/// that is not finite.
///
/// Knows neither clock nor bus; the same inputs give the same answers.
class Navigator {
 public:
  /// Borrows nothing. Throws InputError when a setting is out of its range or the target is none of the tree's places.
  Navigator(const VesselTree& tree, const TreeLocation& target, const NavigatorSettings& settings);

  NavigationAnswer step(const NavigationInput& input);

  const TreeTopology& map() const { return map_; }

  /// How far the tip's end stands beside the vessel's axis, by its bend and by where its shaft lies.
  TipOffset tipOffset() const { return shaft_.with(bentOffset()); }

  /// ShaftOffset::looseness().
  double looseness() const { return shaft_.looseness(); }

  /// Whether the tip is steered by what the image shows of it: it lies anywhere in the lumen.
  bool isLoose() const { return loose_; }

  int misses() const { return misses_; }  ///< Wrong branches entered, and walls met.

 private:
  NavigationAnswer decide(const NavigationInput& input);
  NavigationAnswer holdUnsure(const NavigationInput& input, const std::string& why);
  NavigationAnswer follow(const NavigationInput& input, const RouteView& view);
  bool shouldLook() const;
  NavigationAnswer startLook(const NavigationInput& input);
  NavigationAnswer look(const NavigationInput& input);
  double beyondPlanned_m(const TipPlace& tip) const;
  bool liesInPlanned(const NavigationInput& input) const;
  NavigationAnswer aim(const NavigationInput& input);
  NavigationAnswer startSearch(const NavigationInput& input);
  NavigationAnswer search(const NavigationInput& input);
  NavigationAnswer startTurn(const NavigationInput& input, std::optional<int> next);
  NavigationAnswer startCrossing(const NavigationInput& input, double bend_rad);
  NavigationAnswer cross(const NavigationInput& input, const RouteView& view);
  NavigationAnswer backOff(const NavigationInput& input, const RouteView& view);
  NavigationAnswer miss(const NavigationInput& input, const RouteView& view, const std::string& why);
  NavigationAnswer atFork(const NavigationInput& input, const RouteView& view);
  double pushSpeed(double speed_mm_per_s) const;
  NavigationAnswer go(const NavigationInput& input, double insertion_m_per_s, double roll_rad_per_s,
                      double bend_rad) const;
  NavigationAnswer pullBack(const NavigationInput& input) const;
  bool leavesWideVessel(int branch) const;
  bool isWide(int branch) const;
  std::optional<std::string> resistance(const NavigationInput& input, double path_m);
  bool sureOf(const RouteView& view) const;
  bool leapt(const TreeLocation& place) const;
  void observe(const NavigationInput& input, double path_m);
  TipOffset bentOffset() const;
  ForkSide sideOfForks() const;
  bool standsRight(const ForkSide& side) const;
  bool showsSideOf(int branch) const;
  bool goesByTurns(int branch) const;
  void noteTurn(int fork, std::optional<int> entered);
  double confirm_m(int parent) const;
  bool hasEntered(const NavigationInput& input) const;
  NavigationAnswer enter(const NavigationInput& input, const RouteView& view);
  void planNext(int next);
  std::vector<int> closeForks(int next) const;

  NavigatorSettings settings_;
  TreeTopology map_;
  TreeLocation target_;
  std::vector<double> end_radii_m_;  // Of the vessel at each branch's end.
  double free_deflection_;
  TipRoll roll_;
  ShaftOffset shaft_;
  bool loose_ = false;
  std::optional<Eigen::Vector2d> observable_axis_;  // Of the last frame with a tip: TipDeflection's.
  NavigationState state_ = NavigationState::kFollowing;
  std::string why_;
  std::int64_t sequence_ = 0;

  std::optional<double> last_path_m_;               // Of the tip, when it was last located.
  std::optional<TreeLocation> last_place_;          // The same.
  std::optional<std::pair<double, double>> since_;  // Drive and tip when both last moved together.
  std::optional<double> last_insertion_m_;
  double slack_m_ = 0;  // That it was pulled back and has not been seen to take up again.
  double doubtful_s_ = 0, retreated_m_ = 0;
  bool asked_ = false, asked_ahead_ = false;  // For another view, while uncertain; behind this fork.
  bool asked_of_leap_ = false;                // The same, in this try: it seems to be in a branch that it cannot be in.
  int jumped_ = 0, beside_frames_ = 0, there_frames_ = 0;
  std::map<int, int> tries_;  // At each fork, by the branch that ends there.
  int misses_ = 0;
  std::optional<int> planned_;  // The branch that the aim is for: behind the next fork, or behind some close ones.
  std::vector<int> aimed_for_;  // The branches up to that one.
  double aim_angle_rad_ = 0, aim_bend_rad_ = 0;
  double aimed_s_ = 0, looked_rad_ = 0, last_roll_rad_ = 0;
  std::optional<double> seen_roll_rad_;      // Of the drive, in the last frame with a tip.
  bool searching_ = false;                   // Turns until the image shows the tip on the right side.
  int steady_frames_ = 0;                    // In which the tip stood right.
  int inside_frames_ = 0;                    // In which it lay in the branch that it is aimed for.
  bool slipped_ = false;                     // Into that branch, before the planned turn: this try crosses from there.
  bool ignores_slips_ = false;               // In this try.
  double searched_rad_ = 0, best_side_ = 0;  // In this search; the best slope of it.
  int searches_ = 0;                         // At this fork, in this try.
  bool asked_for_side_ = false;              // For another view, the same.
  double crossed_roll_rad_ = 0;              // Of the drive, that the last crossing was aimed with.
  std::optional<std::pair<double, double>> pushed_at_;  // Roll and bend of this try, until it shows where it leads.
  std::map<int, TurnSearch> turns_;                     // At each fork, by the branch that ends there.
  int held_ = 0;                                        // Tries in a row that ended at a wall, not beside the route.
  std::optional<double> turn_to_rad_;                   // Of the drive: the try is one by turns.
  std::optional<double> looked_at_m_;                   // Along the path, in this try.
  double back_to_m_ = 0;                                // Path length to pull back to.
  bool missed_beside_ = false;                          // The last miss was one beside the route.
  bool makes_loop_ = false;                             // It was one of a shaft that may have made a loop.
  double stalled_from_m_ = 0;  // Of the drive, when the tip last moved before something held it.
};

}  // namespace angio::navigation
