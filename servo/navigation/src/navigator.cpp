// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/navigator.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/checked.hpp"
#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/vessel/tree_distance.hpp"
#include "route_view.hpp"

namespace angio::navigation {
namespace {

constexpr double kNear_m = 4e-3;       // Places closer than that are one for the question where to go ...
constexpr double kSame_m = 2e-3;       // ... and these for the question where it has arrived.
constexpr double kSureOfTarget = 0.9;  // Probability of the target's branch.
constexpr double kBendGain_per_s = 3;
constexpr double kDeflected = 0.5;  // Of what its bend would deflect a free tip by, a tip in a vessel usually is.
constexpr double kMuchSlack_m = 6e-3;
constexpr double kJump_m = 6e-3;      // Between two frames: more than any command does.
constexpr double kLeap_m = 5e-3;      // A tip that is seen in another branch would have gone back by so much, and on.
constexpr double kSurelyLoose = 0.6;  // Looseness from which a catheter is taken for a loose one.
constexpr double kAimOfTip = 0.6;     // Of its length: a tip is aimed no later before a fork.
constexpr double kAimIn = 0.3;        // Of a branch's length: a loose tip is aimed no earlier before its end.
constexpr double kAskAgain_s = 10;    // In lasting doubt, from view to view.

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
