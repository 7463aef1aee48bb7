// SPDX-License-Identifier: GPL-2.0-or-later
// The navigator in front of a fork and across it: looks, aims, crosses, and sees which branch was entered.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/navigation/namespace.hpp"
#include "angio/navigation/navigator.hpp"
#include "angio/vessel/tree_topology.hpp"
#include "fork_plan.hpp"
#include "route_view.hpp"

namespace angio::navigation {
namespace {

// Slopes to the wanted side of a fork, of a loose catheter: enough to cross at once, less half the standard deviation;
// after an aim; and not enough to go on.
constexpr double kSureSide = 0.1, kWrongSide = -0.05;
constexpr double kShown = 0.6;                // Of a length to that side, in the image: less is too little.
constexpr double kMaxLooseBend_deg = 80;      // Of a loose catheter's tip: bent further it hooks into the wall.
constexpr double kOfLumen = 2.4;              // Radii that a tip may be deflected by at first.
constexpr double kHooked_m = 10e-3;           // Of a push that the tip of a loose catheter does not follow.
constexpr double kOfBest = 0.75;              // Of the best slope of a search that has gone around: enough to cross.
constexpr double kAround_rad = 2.2 * kPi;     // Of a search.
constexpr int kMaxSearches = 3;               // In a try; one in a wide vessel, where the tip's side is hardly seen.
constexpr int kSearchedTries = 2;             // In a narrow vessel, before tries go by turns.
constexpr double kNextTurn_rad = 0.75 * kPi;  // Away from forks, from try to try: eight of them are 45 deg apart.
constexpr double kMoreBend_rad = 0.7;         // After a wall has held it at the same turn.
constexpr int kTurns = 8;                     // With a tip that is not bent; then with a bent one.

constexpr double kRollGain_per_s = 2.5;  // With 0.15 s of delay far from swinging.
constexpr double kMaxAim_s = 8;
constexpr double kFullLook_rad = 2.2 * kPi;
constexpr double kLooked_m = 30e-3;         // A tip that has slid further may have turned.
constexpr double kSureOfWrongBranch = 0.9;  // Probability of a wrong branch that is worth going back at once.
constexpr double kConfirmIn = 0.5;          // Of the radius of the vessel in front of the fork.
constexpr double kSlippedIn = 0.8;          // Of that, for a tip that is turned and not pushed.
constexpr double kEntered = 0.8;            // Probability of the wanted branch that is enough to go on.
constexpr double kMinMargin_rad = 0.1;      // For one aim to serve several forks.

// Where further tries at a fork aim beside the plan [rad]: a wrong idea of the tip's angle is wrong again.
constexpr double kBeside_rad[] = {0, 0, 1.05, -1.05, 2.1, -2.1, 3.14, 0.5, -0.5, 1.6};

}  // namespace

// A loose catheter crosses where the image shows its tip on the wanted side. All others look or aim.
NavigationAnswer Navigator::atFork(const NavigationInput& input, const RouteView& view) {
  turn_to_rad_.reset();
  if (goesByTurns(view.branch)) return startTurn(input, view.next);
  planNext(*view.next);
  if (isLoose()) {
    const ForkSide side = sideOfForks();
    if (standsRight(side)) return startCrossing(input, input.drive.bend_rad);
    if (!showsSideOf(*view.next) && !asked_for_side_) {
      asked_for_side_ = true;
      return {{}, NavigationState::kWaiting, "this view does not show which way the tip points", true};
    }
    return startSearch(input);
  }
  if (shouldLook()) return startLook(input);
  state_ = NavigationState::kAiming;
  aimed_s_ = 0;
  searching_ = false;
  return aim(input);
}

NavigationAnswer Navigator::startCrossing(const NavigationInput& input, double bend_rad) {
  state_ = NavigationState::kCrossing;
  aim_bend_rad_ = bend_rad;
  pushed_at_ = std::pair(input.drive.roll_rad, bend_rad);
  crossed_roll_rad_ = turn_to_rad_.value_or(input.drive.roll_rad);
  asked_ahead_ = false;
  inside_frames_ = 0;
  since_.reset();
  return go(input, 0, 0, aim_bend_rad_);
}

// How the image shows the tip against the forks that it is aimed for: where it points, and where it stands, since
// that is what decides at the carina. The least of them counts.
ForkSide Navigator::sideOfForks() const {
  const double lever_m = 1e-3 * settings_.lever_mm;
  const TipOffset offset = tipOffset();
  const Eigen::Vector2d towards = roll_.heading() + offset.mean_m / lever_m;
  const Eigen::Matrix2d covariance = roll_.headingCovariance() + offset.covariance / (lever_m * lever_m);
  ForkSide least{10, 0};
  for (const int branch : aimed_for_) {
    const Eigen::Vector2d side = sideTowards(forkAt(map_, branch, target_.branch, lever_m));
    if (side.isZero()) continue;
    const double slope = side.dot(towards);
    if (slope < least.slope) least = {slope, std::sqrt(std::max(side.dot(covariance * side), 0.0))};
  }
  return least;
}

bool Navigator::standsRight(const ForkSide& side) const { return side.slope - 0.5 * side.std > kSureSide; }

// Whether the image shows to which side of the fork in front of `branch` the tip stands.
bool Navigator::showsSideOf(int branch) const {
  const Eigen::Vector2d side = sideTowards(forkAt(map_, branch, target_.branch, 1e-3 * settings_.lever_mm));
  return side.isZero() || (observable_axis_ && std::abs(side.dot(*observable_axis_)) >= kShown);
}

// The branches of the route from `next` on that begin at a fork which there is no room to aim in front of.
std::vector<int> Navigator::closeForks(int next) const {
  const std::vector<int> route = map_.pathTo(target_.branch);
  auto at = std::find(route.begin(), route.end(), next);
  std::vector<int> branches{next};
  while (at + 1 < route.end() && map_.length_m(*at) < 1e-3 * settings_.short_mm) branches.push_back(*++at);
  return branches;
}

void Navigator::planNext(int next) {
  const auto tried = static_cast<std::size_t>(tries_[*map_.parent(next)]);
  const double bent_deg = settings_.tip_angle_deg + settings_.max_bend_deg;
  const double max_bend_deg =
      isLoose() ? std::max(settings_.tip_angle_deg, std::min(kMaxLooseBend_deg, bent_deg)) : bent_deg;
  const TipRange range{degToRad(settings_.tip_angle_deg), degToRad(max_bend_deg)};
  const double sigma = std::clamp(roll_.std_rad(), degToRad(15), degToRad(60)), lever_m = 1e-3 * settings_.lever_mm;
  // As many of the forks ahead with one aim as one aim can serve.
  std::vector<int> branches = closeForks(next);
  ForkPlan plan = planForks(map_, branches, target_.branch, range, sigma, lever_m);
  while (branches.size() > 1 && plan.margin_rad < kMinMargin_rad) {
    branches.pop_back();
    plan = planForks(map_, branches, target_.branch, range, sigma, lever_m);
  }
  planned_ = branches.back();
  aimed_for_ = branches;
  aim_angle_rad_ = plan.angle_rad + kBeside_rad[tried % std::size(kBeside_rad)];
  aim_bend_rad_ = plan.bend_rad - degToRad(settings_.tip_angle_deg);
  // No more bent than the lumen has room for, but for every other try: a tip that both walls hold springs.
  if (isLoose() && tried % 2 == 0) {
    const double room = kOfLumen * end_radii_m_[*map_.parent(next)] / (1e-3 * settings_.tip_length_mm);
    const double roomy_rad = std::asin(std::min(room, 1.0)) - degToRad(settings_.tip_angle_deg);
    aim_bend_rad_ = std::min(aim_bend_rad_, std::max(roomy_rad, 0.0));
  }
}

// Whether the tip's direction is too unsure, and a turn has not just shown it.
bool Navigator::shouldLook() const {
  if (isLoose()) return false;  // Its tip does not follow the drive's roll, which a turn would show.
  const bool looked = looked_at_m_ && std::abs(*last_path_m_ - *looked_at_m_) < kLooked_m;
  return !looked && roll_.std_rad() > degToRad(settings_.look_std_deg);
}

NavigationAnswer Navigator::startLook(const NavigationInput& input) {
  state_ = NavigationState::kLooking;
  looked_rad_ = 0;
  last_roll_rad_ = input.drive.roll_rad;
  return look(input);
}

// One turn, always the same way round: backlash and wind-up then stay on one side.
NavigationAnswer Navigator::look(const NavigationInput& input) {
  looked_rad_ += std::abs(input.drive.roll_rad - last_roll_rad_);
  last_roll_rad_ = input.drive.roll_rad;
  if (looked_rad_ >= kFullLook_rad) {
    looked_at_m_ = *last_path_m_;
    state_ = NavigationState::kFollowing;
    return go(input, 0, 0, 0);
  }
  return go(input, 0, degToRad(settings_.roll_speed_deg_per_s), 0);
}

// How far along the route the tip is beyond the fork that it is aimed for.
double Navigator::beyondPlanned_m(const TipPlace& tip) const {
  return map_.start_m(tip.branch) + tip.arc_m - map_.start_m(*planned_);
}

// Whether the tip of a loose catheter lies in the branch that it is aimed for: turned in front of a fork it slips into
// one branch and out of it into the next. Below the branch, in the wide vessel, it is seen up to where the two part and
// some way on.
bool Navigator::liesInPlanned(const NavigationInput& input) const {
  const TipPlace& tip = input.belief->tip;
  if (!isLoose() || !planned_ || !map_.passes(tip.branch, *planned_)) return false;
  const int parent = *map_.parent(*planned_);
  const double beyond_m = map_.parting_m(parent) + kSlippedIn * confirm_m(parent);
  return beyondPlanned_m(tip) >= std::min(beyond_m, 0.4 * map_.length_m(*planned_)) &&
         throughProbability(map_, *planned_, *input.belief, 0) >= kEntered;
}

NavigationAnswer Navigator::aim(const NavigationInput& input) {
  inside_frames_ = !ignores_slips_ && liesInPlanned(input) ? inside_frames_ + 1 : 0;
  if (inside_frames_ >= kSteadyFrames) {
    slipped_ = true;
    if (!turn_to_rad_) turn_to_rad_ = input.drive.roll_rad;  // Tries that go by turns go on from the planned one.
    return startCrossing(input, input.drive.bend_rad);
  }
  if (inside_frames_ > 0) return go(input, 0, 0, aim_bend_rad_);
  if (searching_) return search(input);
  aimed_s_ += input.period_s;
  const double close = degToRad(settings_.angle_deg);
  const double drift_rad = input.drive.roll_speed_rad_per_s * input.latency_s;
  double left = turn_to_rad_ ? *turn_to_rad_ - input.drive.roll_rad - drift_rad
                             : std::remainder(aim_angle_rad_ - roll_.angle_rad() - drift_rad, 2 * kPi);
  const bool turned = std::abs(left) < close;
  if (!turn_to_rad_ && left < -close) left += 2 * kPi;  // Forwards, unless it is just a little too far.
  const bool bent = std::abs(aim_bend_rad_ - input.drive.bend_rad) < close;
  const bool done = (turned && bent) || aimed_s_ > kMaxAim_s;
  if (done && planned_) return startCrossing(input, aim_bend_rad_);
  if (done) state_ = NavigationState::kFollowing;
  const double fastest = degToRad(settings_.roll_speed_deg_per_s);
  return go(input, 0, turned ? 0.0 : std::clamp(kRollGain_per_s * left, -fastest, fastest), aim_bend_rad_);
}

// A tip between walls does not follow its drive as a free one does: it is turned until the image shows it on the wanted
// side, once around, and then to the best that was seen.
NavigationAnswer Navigator::startSearch(const NavigationInput& input) {
  state_ = NavigationState::kAiming;
  searching_ = true;
  ++searches_;
  searched_rad_ = best_side_ = 0;
  steady_frames_ = 0;
  last_roll_rad_ = input.drive.roll_rad;
  return search(input);
}

NavigationAnswer Navigator::search(const NavigationInput& input) {
  searched_rad_ += std::abs(input.drive.roll_rad - last_roll_rad_);
  last_roll_rad_ = input.drive.roll_rad;
  const ForkSide side = sideOfForks();
  best_side_ = std::max(best_side_, side.slope);
  const bool best = searched_rad_ > kAround_rad && side.slope >= kOfBest * best_side_;
  // One that springs past the wanted side does not stay there.
  steady_frames_ = best || standsRight(side) ? steady_frames_ + 1 : 0;
  if (steady_frames_ >= kSteadyFrames || searched_rad_ > 2 * kAround_rad)
    return startCrossing(input, input.drive.bend_rad);
  return go(input, 0, steady_frames_ > 0 ? 0.0 : degToRad(settings_.roll_speed_deg_per_s), aim_bend_rad_);
}

// A fork that a loose catheter has missed is tried again with its tip turned to where earlier turns have left a gap,
// whatever the image shows: 1 to 5 of 8 directions lead into most branches of a liver and of an aortic arch, by rods
// whose true place was known, and they are not always those in which the tip points. Away from forks, where there is no
// `next`, another side leaves a wall.
NavigationAnswer Navigator::startTurn(const NavigationInput& input, std::optional<int> next) {
  double roll_rad = input.drive.roll_rad + kNextTurn_rad;
  if (next) {
    planNext(*next);
    if (tries_[*map_.parent(*next)] <= kTurns) aim_bend_rad_ = 0;
    aim_bend_rad_ = std::min(aim_bend_rad_ + held_ * kMoreBend_rad, degToRad(settings_.max_bend_deg));
    roll_rad = held_ > 0 ? crossed_roll_rad_ : turns_[*map_.parent(*next)].next(aim_bend_rad_).value_or(roll_rad);
  } else {
    planned_.reset();
    aim_bend_rad_ = 0;
  }
  // Forwards, unless it is just a little too far.
  const double left = std::remainder(roll_rad - input.drive.roll_rad, 2 * kPi);
  turn_to_rad_ = input.drive.roll_rad + (left < -degToRad(settings_.angle_deg) ? left + 2 * kPi : left);
  state_ = NavigationState::kAiming;
  searching_ = false;
  aimed_s_ = 0;
  return aim(input);
}

// Where the present try's turn led first: what it does later, deep in that branch, says nothing of the fork.
void Navigator::noteTurn(int fork, std::optional<int> entered) {
  if (!pushed_at_) return;
  turns_[fork].add(pushed_at_->first, pushed_at_->second, entered);
  pushed_at_.reset();
}

// Whether the fork at a branch's end has been missed so often that its tries go by turns. In the target's branch there
// is none to search in front of.
bool Navigator::goesByTurns(int branch) const {
  const auto tries = tries_.find(branch);
  const int searched = branch == target_.branch || isWide(branch) ? 0 : kSearchedTries;
  return isLoose() && tries != tries_.end() && tries->second > searched;
}

// How far beyond the parting of branches the tip counts as entered. A loose one stands anywhere in a wide vessel.
double Navigator::confirm_m(int parent) const {
  const double confirm_m = 1e-3 * settings_.confirm_mm;
  return isLoose() ? std::max(confirm_m, kConfirmIn * end_radii_m_[parent]) : confirm_m;
}

// Whether a belief beside the route is worth going back for.
bool Navigator::sureOf(const RouteView& view) const {
  const double beyond_m = -view.to_fork_m, parted_m = map_.parting_m(view.branch);
  return beyond_m >= parted_m + 1e-3 * settings_.sure_mm ||
         (beyond_m >= parted_m + confirm_m(view.branch) && view.beside_probability >= kSureOfWrongBranch);
}

// Whether the tip is in the branch that was aimed for, and far enough that it stays there.
bool Navigator::hasEntered(const NavigationInput& input) const {
  const TipPlace& tip = input.belief->tip;
  if (!planned_ || !map_.passes(tip.branch, *planned_)) return false;
  const double beyond_m = beyondPlanned_m(tip);
  const double parted_m = map_.parting_m(*map_.parent(*planned_));
  const double confirm = 1e-3 * settings_.confirm_mm, length_m = map_.length_m(*planned_);
  // Beyond the parting by what a wide vessel asks for more, in a branch that is long enough.
  const double wide_m = confirm_m(*map_.parent(*planned_)) - confirm;
  const double parted_here_m = std::max(parted_m, std::min(parted_m + wide_m, 0.8 * length_m));
  if (beyond_m < std::max(std::min(confirm, 0.4 * length_m), parted_here_m)) return false;
  return throughProbability(map_, *planned_, *input.belief, 0) >= kEntered ||
         beyond_m >= parted_m + 1e-3 * settings_.sure_mm;
}

NavigationAnswer Navigator::enter(const NavigationInput& input, const RouteView& view) {
  noteTurn(*map_.parent(aimed_for_.front()), aimed_for_.front());
  roll_.entered(sidewaysOf(map_, *planned_, target_.branch, 1e-3 * settings_.lever_mm));
  looked_at_m_.reset();
  searches_ = 0;
  asked_for_side_ = false;
  held_ = 0;
  turn_to_rad_.reset();
  asked_of_leap_ = false;
  ignores_slips_ = false;  // Not slipped_: what has entered so may still fall out.
  return follow(input, view);
}

NavigationAnswer Navigator::cross(const NavigationInput& input, const RouteView& view) {
  if (hasEntered(input)) return enter(input, view);
  const TipPlace& tip = input.belief->tip;
  const double lever_m = 1e-3 * settings_.lever_mm;
  const double beyond_m = beyondPlanned_m(tip);
  const double parted_m = map_.parting_m(*map_.parent(*planned_));
  if (view.entered && beside_frames_ >= kSteadyFrames && sureOf(view)) {
    roll_.entered(sidewaysOf(map_, *view.entered, tip.branch, lever_m));
    return miss(input, view, "the tip has entered another branch");
  }
  const int max_searches = isWide(*map_.parent(*planned_)) ? 1 : kMaxSearches;
  if (isLoose() && !turn_to_rad_ && beyond_m < 0 && searches_ < max_searches && sideOfForks().slope < kWrongSide) {
    planNext(aimed_for_.front());
    return startSearch(input);
  }
  // Back in front of all that was planned, as a catheter that sprang back is.
  const double far_m = 2e-3 * (settings_.aim_mm + settings_.back_mm);
  if (view.on_route && view.next && view.to_fork_m > far_m && !map_.passes(view.branch, *planned_))
    return follow(input, view);
  // Neither branch is sure where they have long parted: this view does not tell them apart.
  const double sure_m = confirm_m(*map_.parent(*planned_)) + 1e-3 * settings_.confirm_mm;
  const bool in_doubt = !asked_ahead_ && beyond_m >= parted_m + sure_m;
  asked_ahead_ = asked_ahead_ || in_doubt;
  const bool short_ahead = map_.length_m(*planned_) < 1e-3 * settings_.short_mm;
  // A bent tip may hold in the wall, or beyond the other branch's edge.
  const bool hooked = isLoose() && since_ && input.drive.insertion_m - since_->first > kHooked_m + slack_m_;
  NavigationAnswer answer =
      go(input, pushSpeed((short_ahead ? 0.5 : 1) * settings_.fork_speed_mm_per_s), 0, hooked ? 0.0 : aim_bend_rad_);
  answer.another_view = in_doubt;
  return answer;
}

}  // namespace angio::navigation
