// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/navigator.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "angio/base/checked.hpp"
#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/navigation/drive_force_limiter.hpp"
#include "angio/vessel/tree_distance.hpp"
#include "route_view.hpp"

namespace angio::navigation {
namespace {

constexpr double kNear_m = 4e-3;       // Places closer than that are one for the question where to go ...
constexpr double kSame_m = 2e-3;       // ... and these for the question where it has arrived.
constexpr double kSureOfTarget = 0.9;  // Probability of the target's branch.
constexpr double kBendGain_per_s = 3;
constexpr double kDeflected = 0.5;       // Of what its bend would deflect a free tip by, a tip in a vessel usually is.
constexpr double kFirmSlide_m = 1.5e-3;  // The tip has moved.
constexpr double kMaxSlack_m = 20e-3;  // A shaft that was pulled lies at inner walls, and is pushed to the outer first.
constexpr double kMaxLooseSlack_m = 30e-3;  // The same of a loose one, by what it took to move its tip again.
constexpr double kMuchSlack_m = 6e-3;
constexpr double kWide_m = 3.5e-3;     // Radius of a wide vessel.
constexpr double kJump_m = 6e-3;       // Between two frames: more than any command does.
constexpr double kLeap_m = 5e-3;       // A tip that is seen in another branch would have gone back by so much, and on.
constexpr double kSurelyLoose = 0.6;   // Looseness from which a catheter is taken for a loose one.
constexpr double kAimOfTip = 0.6;      // Of its length: a tip is aimed no later before a fork.
constexpr double kAimIn = 0.3;         // Of a branch's length: a loose tip is aimed no earlier before its end.
constexpr int kLooseTriesOfAView = 4;  // Its views are chosen for their forks.
constexpr double kAtFork_m = 20e-3;    // What a wall holds further away is not held by the fork.
constexpr double kFreed_m = 4e-3;      // Back from where a loop was straight: a wall holds the tip no more.
constexpr double kAskAgain_s = 10;     // In lasting doubt, from view to view.
constexpr int kPlaces = 5;             // Of tries that go by turns; no divisor of the number of turns.
constexpr int kMaxHeld = 2;            // Tries with the same turn, each with more bend.
constexpr int kTriesInAll = 6;         // At all forks, times those at one.

// Of a tip that no wall holds, as a slope.
double freeSlope(const NavigatorSettings& settings, double bend_rad) {
  return std::sin(std::clamp(degToRad(settings.tip_angle_deg) + bend_rad, degToRad(10), 0.5 * kPi));
}

// Where each branch ends; of one that is not known, 1 mm.
std::vector<double> endRadii(const TreeTopology& map, const VesselTree& tree) {
  std::vector<double> radii;
  for (int branch = 0; branch < map.branchCount(); ++branch) {
    radii.push_back(tree.radii()[static_cast<std::size_t>(map.points(branch).back())].value_or(1e-3));
  }
  return radii;
}

bool sound(const NavigationInput& input) {
  const CatheterState& d = input.drive;
  return std::isfinite(d.insertion_m) && std::isfinite(d.roll_rad) && std::isfinite(d.bend_rad) &&
         std::isfinite(d.roll_speed_rad_per_s) && std::isfinite(d.insertion_force_n) && std::isfinite(input.period_s) &&
         std::isfinite(input.latency_s);
}

bool sound(const TipPlace& tip, const TreeTopology& map) {
  return tip.branch >= 0 && tip.branch < map.branchCount() && std::isfinite(tip.arc_m) && std::isfinite(tip.std_m) &&
         std::isfinite(tip.probability);
}

bool sound(const TipBelief& belief, const TreeTopology& map) {
  if (!sound(belief.tip, map)) return false;
  return std::all_of(belief.alternatives.begin(), belief.alternatives.end(),
                     [&](const TipPlace& place) { return sound(place, map); });
}

}  // namespace

const char* stateName(NavigationState state) {
  static constexpr const char* kNames[] = {"waiting",  "following",   "looking", "aiming",
                                           "crossing", "backing off", "arrived", "given up"};
  return kNames[static_cast<int>(state)];
}

Navigator::Navigator(const VesselTree& tree, const TreeLocation& target, const NavigatorSettings& settings)
    : settings_(checked("navigator", settings)),
      map_(tree),
      target_(target),
      end_radii_m_(endRadii(map_, tree)),
      free_deflection_(freeSlope(settings, 0)),
      roll_(kDeflected * free_deflection_, degToRad(settings.dead_band_deg)) {
  if (target.branch < 0 || target.branch >= map_.branchCount()) {
    throw InputError("navigator", "target", std::to_string(target.branch),
                     "must be one of the tree's " + std::to_string(map_.branchCount()) + " branches");
  }
  requireBetween("navigator", "target arc_m", target.arc_m, 0, map_.length_m(target.branch));
}

NavigationAnswer Navigator::step(const NavigationInput& input) {
  NavigationAnswer answer = sound(input)
                                ? decide(input)
                                : NavigationAnswer{{}, NavigationState::kWaiting, "the drive's state is not a number"};
  answer.command.time_us = input.time_us;
  answer.command.frame_sequence = input.frame_sequence;
  answer.command.sequence = ++sequence_;
  answer.command.valid_for_us = std::llround(1e3 * settings_.valid_for_ms);
  return answer;
}

NavigationAnswer Navigator::decide(const NavigationInput& input) {
  if (state_ == NavigationState::kArrived || state_ == NavigationState::kGivenUp) return {{}, state_, why_};
  free_deflection_ = freeSlope(settings_, input.drive.bend_rad);
  roll_.bend(kDeflected * free_deflection_);
  const bool located = input.belief && sound(*input.belief, map_) && isFromFrame(*input.belief);
  if (!located) {
    roll_.move(input.drive.roll_rad, 0);
    return holdUnsure(input, input.belief && !input.belief->why.empty() ? input.belief->why : "the tip is not seen");
  }
  const TipPlace& tip = input.belief->tip;
  const double path_m = map_.start_m(tip.branch) + tip.arc_m;
  const bool leap = leapt({tip.branch, tip.arc_m});
  if ((leap || (last_path_m_ && std::abs(path_m - *last_path_m_) > kJump_m)) && ++jumped_ < kSteadyFrames) {
    roll_.move(input.drive.roll_rad, 0);
    return holdUnsure(input, "the tip seems to have jumped");
  }
  jumped_ = 0;
  if (leap && !asked_of_leap_) {  // One of both was wrong, and lies over the other one in this view.
    asked_of_leap_ = true;
    return {{}, NavigationState::kWaiting, "the tip seems to be in a branch that it has no way to", true};
  }
  observe(input, path_m);

  const auto view = viewRoute(map_, target_.branch, *input.belief, kNear_m);
  if (!view) return holdUnsure(input, "no vessel leads from where the tip seems to be to the target");
  if (!(view->probability >= settings_.min_probability)) return holdUnsure(input, "the tip's branch is not sure");
  if (!(tip.std_m <= 1e-3 * settings_.max_std_mm)) return holdUnsure(input, "the tip's place is not sure");
  const bool there = tip.branch == target_.branch && tip.arc_m >= target_.arc_m;
  if (there && throughProbability(map_, target_.branch, *input.belief, kSame_m) < kSureOfTarget) {
    return holdUnsure(input, "is this the target's branch?");
  }
  doubtful_s_ = retreated_m_ = 0;
  asked_ = false;
  beside_frames_ = view->on_route ? 0 : beside_frames_ + 1;
  there_frames_ = there ? there_frames_ + 1 : 0;
  if (there) {
    if (there_frames_ < kSteadyFrames) return {{}, state_, "is this the target?"};
    state_ = NavigationState::kArrived;
    return {{}, state_, ""};
  }
  if (const auto resisted = resistance(input, path_m)) return miss(input, *view, *resisted);
  switch (state_) {
    case NavigationState::kLooking:
      return look(input);
    case NavigationState::kAiming:
      return aim(input);
    case NavigationState::kCrossing:
      return cross(input, *view);
    case NavigationState::kBackingOff:
      return backOff(input, *view);
    default:
      return follow(input, *view);
  }
}

// Whether a loose tip that is pushed seems to have changed branches far beyond the fork between them. A firm one moves
// by what its drive does, which the belief knows; one that is turned in its place is not taken for beside the route.
bool Navigator::leapt(const TreeLocation& place) const {
  const bool pushing = state_ == NavigationState::kFollowing || state_ == NavigationState::kCrossing;
  if (!isLoose() || !pushing || !last_place_) return false;
  const double from_m = map_.start_m(last_place_->branch) + last_place_->arc_m;
  const double to_m = map_.start_m(place.branch) + place.arc_m;
  return std::min(from_m, to_m) - sharedRoute_m(map_, *last_place_, place).value_or(0) > kLeap_m;
}

// What the frame says of how the tip stands and points.
void Navigator::observe(const NavigationInput& input, double path_m) {
  const double slid_m = last_path_m_ ? path_m - *last_path_m_ : 0.0;
  if (isLoose()) {
    roll_.moveLoosely(input.drive.roll_rad, slid_m);
  } else {
    roll_.move(input.drive.roll_rad, slid_m);
  }
  shaft_.move(slid_m, seen_roll_rad_ ? input.drive.roll_rad - *seen_roll_rad_ : 0.0);
  // A catheter stays what it is; in narrow vessels it lies near the axis all the same.
  loose_ = loose_ || looseness() > kSurelyLoose;
  last_path_m_ = path_m;
  last_place_ = TreeLocation{input.belief->tip.branch, input.belief->tip.arc_m};
  seen_roll_rad_ = input.drive.roll_rad;
  observable_axis_.reset();
  if (!input.deflection) return;
  observable_axis_ = input.deflection->observable_axis;
  roll_.see(*input.deflection);
  shaft_.see(bentOffset(), input.deflection->observable_axis, input.deflection->offset_m,
             input.deflection->offset_std_m);
}

// Where the tip's bend puts its end, were its shaft on the axis.
TipOffset Navigator::bentOffset() const {
  const double length_m = 1e-3 * settings_.tip_length_mm;
  return {length_m * roll_.deflection(), length_m * length_m * roll_.deflectionCovariance(),
          length_m * free_deflection_};
}

// Stands still, and after a while goes back to where it was surer, for as far as it may.
NavigationAnswer Navigator::holdUnsure(const NavigationInput& input, const std::string& why) {
  doubtful_s_ += input.period_s;
  since_.reset();
  // Once at first, and again for as long as the doubt stays where going back is over.
  const bool retreated = retreated_m_ >= 1e-3 * settings_.retreat_mm;
  if (doubtful_s_ >= settings_.patience_s && (!asked_ || (retreated && doubtful_s_ >= kAskAgain_s))) {
    asked_ = true;
    doubtful_s_ = 0;
    return {{}, NavigationState::kWaiting, why, true};
  }
  if (doubtful_s_ < settings_.patience_s || retreated) {
    return {{}, NavigationState::kWaiting, why};
  }
  const double speed = 1e-3 * settings_.fork_speed_mm_per_s;
  retreated_m_ += speed * input.period_s;
  state_ = NavigationState::kFollowing;
  NavigationAnswer answer = go(input, -speed, 0, 0);
  answer.state = NavigationState::kBackingOff;
  answer.why = why;
  return answer;
}

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
  if (!since_ || slid_m > kFirmSlide_m || (slid_m < -kFirmSlide_m && !comes_out)) {
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

// Whether a branch is a narrow one behind a wide one. What of a loose shaft does not arrive at the tip there makes a
// loop in the wide vessel, which takes the tip out again: a tip that stands or comes back is pushed no further.
bool Navigator::leavesWideVessel(int branch) const {
  if (isWide(branch)) return false;
  for (auto parent = map_.parent(branch); parent; parent = map_.parent(*parent)) {
    if (isWide(*parent)) return true;
  }
  return false;
}

bool Navigator::isWide(int branch) const { return end_radii_m_[branch] > kWide_m; }

NavigationAnswer Navigator::follow(const NavigationInput& input, const RouteView& view) {
  state_ = NavigationState::kFollowing;
  if (!view.on_route) {
    if (beside_frames_ < kSteadyFrames) return {{}, state_, "is the tip beside the route?"};
    if (sureOf(view)) return miss(input, view, "the tip is beside the route");
    return go(input, pushSpeed(settings_.fork_speed_mm_per_s), 0, 0);  // Branches part further on.
  }
  // In a wide vessel a tip stands beside the axis, and one view does not show how far along the beam. A turn does.
  if (input.belief->status == BeliefStatus::kUnsure && shouldLook()) return startLook(input);
  if (!view.next) {  // In the target's branch.
    const double left_m = target_.arc_m - input.belief->tip.arc_m;
    return go(input,
              1e-3 * (left_m < 1e-3 * settings_.slow_mm ? settings_.fork_speed_mm_per_s : settings_.speed_mm_per_s), 0,
              0);
  }
  // Turned just inside a short branch, a loose tip falls out of it.
  double aim_m = 1e-3 * std::max(settings_.aim_mm, kAimOfTip * settings_.tip_length_mm);
  if (isLoose()) aim_m = std::min(aim_m, kAimIn * map_.length_m(view.branch));
  if (view.to_fork_m <= aim_m) return atFork(input, view);
  const bool slow = view.to_fork_m < 1e-3 * settings_.slow_mm;
  return go(input, pushSpeed(slow ? settings_.fork_speed_mm_per_s : settings_.speed_mm_per_s), 0, 0);
}

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

// Of the drive [m/s], for a tip that is to go on by `speed_mm_per_s`: the length that a loose shaft was pulled back by
// goes in before its tip follows.
double Navigator::pushSpeed(double speed_mm_per_s) const {
  const bool takes_up = isLoose() && slack_m_ > kMuchSlack_m;
  return 1e-3 * (takes_up ? std::max(speed_mm_per_s, settings_.speed_mm_per_s) : speed_mm_per_s);
}

NavigationAnswer Navigator::go(const NavigationInput& input, double insertion_m_per_s, double roll_rad_per_s,
                               double bend_rad) const {
  NavigationAnswer answer;
  answer.state = state_;
  answer.command.insertion_speed_m_per_s = insertion_m_per_s;
  answer.command.roll_speed_rad_per_s = roll_rad_per_s;
  const double fastest = degToRad(settings_.bend_speed_deg_per_s);
  const double bend = std::clamp(bend_rad, 0.0, degToRad(settings_.max_bend_deg));
  const double now = input.drive.bend_rad + input.drive.bend_speed_rad_per_s * input.latency_s;
  answer.command.bend_speed_rad_per_s = std::clamp(kBendGain_per_s * (bend - now), -fastest, fastest);
  return answer;
}

}  // namespace angio::navigation
