// SPDX-License-Identifier: GPL-2.0-or-later
// The navigator where something holds the catheter, and how it goes back from there.
#include <algorithm>
#include <string>
#include <utility>

#include "angio/navigation/drive_force_limiter.hpp"
#include "angio/navigation/namespace.hpp"
#include "angio/navigation/navigator.hpp"
#include "angio/vessel/tree_topology.hpp"
#include "route_view.hpp"

namespace angio::navigation {
namespace {

constexpr double kFirmSlide_m = 1.5e-3;  // The tip has moved.
constexpr double kFollows = 0.25;        // Of a push: behind a wide vessel a tip that comes on by less is held.
constexpr double kMaxSlack_m = 20e-3;  // A shaft that was pulled lies at inner walls, and is pushed to the outer first.
constexpr double kMaxLooseSlack_m = 30e-3;  // The same of a loose one, by what it took to move its tip again.
constexpr double kWide_m = 3.5e-3;          // Radius of a wide vessel.
constexpr double kMuchWider = 2;            // Times: an aorta against what leaves it, and not against its own course.
constexpr int kLooseTriesOfAView = 4;       // Its views are chosen for their forks.
constexpr double kAtFork_m = 20e-3;         // What a wall holds further away is not held by the fork.
constexpr double kFreed_m = 4e-3;           // Back from where a loop was straight: a wall holds the tip no more.
constexpr int kPlaces = 5;                  // Of tries that go by turns; no divisor of the number of turns.
constexpr int kMaxHeld = 2;                 // Tries with the same turn, each with more bend.
constexpr int kTriesInAll = 6;              // At all forks, times those at one.

}  // namespace

// What holds the catheter, or nothing.
std::optional<std::string> Navigator::resistance(const NavigationInput& input, double path_m) {
  const double in_m = last_insertion_m_ ? input.drive.insertion_m - *last_insertion_m_ : 0.0;
  last_insertion_m_ = input.drive.insertion_m;
  if (in_m < 0) {
    slack_m_ = std::min(slack_m_ - in_m, isLoose() ? kMaxLooseSlack_m : kMaxSlack_m);
    if (isLoose()) since_.reset();
  }
  const bool pushing = state_ == NavigationState::kFollowing || state_ == NavigationState::kCrossing;
  if (!pushing) since_.reset();
  if (pushing && input.drive.insertion_force_n >= DriveForceLimiter::full_share * settings_.max_force_n) {
    stalled_from_m_ = since_ ? since_->first : input.drive.insertion_m;
    since_.reset();
    return "the drive pushes too hard";
  }
  if (!pushing) return std::nullopt;
  const bool comes_out = isLoose() && leavesWideVessel(input.belief->tip.branch);
  const double slid_m = since_ ? path_m - since_->second : 0.0;
  const double follows_m = since_ && comes_out ? kFollows * (input.drive.insertion_m - since_->first) : 0.0;
  if (!since_ || slid_m > std::max(kFirmSlide_m, follows_m) || (slid_m < -kFirmSlide_m && !comes_out)) {
    // A loose shaft takes up what it was pulled back by in parts: its tip springs on in between.
    if (since_ && path_m > since_->second)
      slack_m_ = isLoose() && !comes_out ? std::max(slack_m_ - (input.drive.insertion_m - since_->first), 0.0) : 0.0;
    since_ = {input.drive.insertion_m, path_m};
  }
  const double stall_m = 1e-3 * (isLoose() && !comes_out ? settings_.loose_stall_mm : settings_.stall_mm);
  if (input.drive.insertion_m - since_->first < stall_m + slack_m_) return std::nullopt;
  stalled_from_m_ = since_->first;
  since_.reset();
  return "the tip does not follow the drive";
}

// Whether a branch is a narrower one behind a wide one. What of a loose shaft does not arrive at the tip there makes a
// loop in the wide vessel, which takes the tip out again: a tip that stands or comes back is pushed no further.
bool Navigator::leavesWideVessel(int branch) const {
  for (auto parent = map_.parent(branch); parent; parent = map_.parent(*parent)) {
    if (isWide(*parent) && end_radii_m_[*parent] > kMuchWider * end_radii_m_[branch]) return true;
  }
  return false;
}

bool Navigator::isWide(int branch) const { return end_radii_m_[branch] > kWide_m; }

// Pulls back to in front of the fork that was missed, or from a wall; then tries again, for as often as it may.
NavigationAnswer Navigator::miss(const NavigationInput& input, const RouteView& view, const std::string& why) {
  ++misses_;
  const double path_m = map_.start_m(input.belief->tip.branch) + input.belief->tip.arc_m;
  // What is held just beyond a fork may still stand in front of it: that is the one to be tried again.
  const auto parent = map_.parent(view.branch);
  const bool fresh = parent && view.on_route && path_m - map_.start_m(view.branch) < 1e-3 * settings_.back_mm;
  const int branch = fresh ? *parent : view.branch;
  int& tries = tries_[branch];
  if (++tries > settings_.tries || misses_ > kTriesInAll * settings_.tries) {
    state_ = NavigationState::kGivenUp;
    why_ = why + ", " + std::to_string(misses_) + " times";
    return {{}, state_, why_};
  }
  noteTurn(branch, fresh ? view.branch : view.entered);
  looked_at_m_.reset();
  searches_ = 0;
  asked_for_side_ = false;
  // A tip that slipped in and fell out would do so at each turn past that place.
  ignores_slips_ = std::exchange(slipped_, false);
  missed_beside_ = !view.on_route;
  makes_loop_ = isLoose() && view.on_route && leavesWideVessel(input.belief->tip.branch);
  asked_of_leap_ = false;
  const bool at_fork = fresh || (view.next && view.to_fork_m < kAtFork_m);
  held_ = missed_beside_ || !at_fork || held_ == kMaxHeld ? 0 : held_ + 1;
  why_ = why;
  state_ = NavigationState::kBackingOff;
  const double start_m = map_.start_m(branch), fork_m = start_m + map_.length_m(branch);
  // Elsewhere each time: in a short branch, where exactly the tip stands decides what it can still be aimed for.
  // A loose tip that hangs at an ostium springs far back when it is pulled much: its places repeat.
  const double back_m = 1e-3 * (settings_.back_mm + 0.7 * (isLoose() ? tries % kPlaces : tries));
  const double min_m = start_m + std::min(2e-3, (0.2 + 0.15 * (tries % 5)) * map_.length_m(branch));
  back_to_m_ = std::max(std::min(fork_m, path_m) - back_m, min_m);
  NavigationAnswer answer = backOff(input, view);
  answer.another_view = tries % (isLoose() ? kLooseTriesOfAView : 2) == 0;
  return answer;
}

NavigationAnswer Navigator::backOff(const NavigationInput& input, const RouteView& view) {
  const double path_m = map_.start_m(input.belief->tip.branch) + input.belief->tip.arc_m;
  if (input.drive.insertion_force_n <= -DriveForceLimiter::full_share * settings_.max_force_n) {  // It is hooked.
    state_ = NavigationState::kFollowing;
    return view.on_route ? follow(input, view) : go(input, pushSpeed(settings_.fork_speed_mm_per_s), 0, 0);
  }
  // What went in while the tip stood made a loop in the wide vessel. Pulled straight, it takes its tip on: that is no
  // way to go back by.
  if (makes_loop_) {
    if (input.drive.insertion_m > stalled_from_m_) return pullBack(input);
    back_to_m_ = std::max(back_to_m_, path_m - kFreed_m);
  }
  if (path_m <= back_to_m_ && view.on_route) {
    return goesByTurns(view.branch) ? startTurn(input, view.next) : follow(input, view);
  }
  // A loose tip that is pulled springs, and sometimes into the branch that it is to go to. Where it fell out of that
  // when it was pushed, it is turned.
  if (isLoose() && missed_beside_ && !ignores_slips_ && hasEntered(input)) {
    slipped_ = true;
    return enter(input, view);
  }
  if (path_m <= 1e-3) return follow(input, view);
  return pullBack(input);
}

NavigationAnswer Navigator::pullBack(const NavigationInput& input) const {
  NavigationAnswer answer = go(input, -1e-3 * settings_.back_speed_mm_per_s, 0, 0);
  answer.why = why_;
  return answer;
}

}  // namespace angio::navigation
