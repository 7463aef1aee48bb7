// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/navigator.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "angio/geometry/se3.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

NavigationInput inputAt(const TreeTopology& map, const TreeLocation& place) {
  NavigationInput input;
  input.period_s = 1.0 / 15;
  input.latency_s = 0.08;
  TipBelief belief;
  belief.status = BeliefStatus::kSeen;
  belief.tip.branch = place.branch;
  belief.tip.arc_m = place.arc_m;
  belief.tip.path_m = map.start_m(place.branch) + place.arc_m;
  belief.tip.std_m = 1e-3;
  belief.tip.probability = 0.98;
  belief.tip.tip_model = map.point(place);
  input.belief = belief;
  return input;
}

bool rests(const CatheterCommand& c) {
  return c.insertion_speed_m_per_s == 0 && c.roll_speed_rad_per_s == 0 && c.bend_speed_rad_per_s == 0;
}

// Shows a navigator a tip far beside the axis while its drive turns: it takes the catheter for a loose one. Then the
// tip is not seen until it may be anywhere.
void showLooseTip(Navigator& navigator, NavigationInput& input) {
  for (int i = 0; i < 20; ++i) {
    input.deflection.reset();
    if (i < 10) input.deflection = TipDeflection{0, 0.05, Eigen::Vector2d::UnitX(), 3e-3, 0.4e-3};
    input.drive.roll_rad += 1;
    (void)navigator.step(input);
  }
  ASSERT_TRUE(navigator.isLoose());
}

struct NavigatorTest : testing::Test {
  VesselTree tree = test::branchingTree(4);
  TreeTopology map{tree};
  int target = map.branchCount() - 1;
  Navigator navigator{tree, {target, 3e-3}, {}};

  // The same tree of wide vessels; its first fork, with the branch that leads to the target and another one.
  VesselTree wide{tree.points(), tree.parents(), std::vector<std::optional<double>>(tree.size(), 5e-3)};
  int first = map.pathTo(target)[0], wanted = map.pathTo(target)[1];
  int other = [this] {
    const std::vector<int>& parted = map.children(first);
    return *std::find_if(parted.begin(), parted.end(), [&](int branch) { return branch != wanted; });
  }();

  // Where a branch leads to, seen along the vessel in front of the fork.
  Eigen::Vector2d sideways(int branch) const {
    const TreeFrame frame = map.frame({first, map.length_m(first)});
    const Eigen::Vector3d off = map.point({branch, 6e-3}) - map.point({branch, 0});
    return Eigen::Vector2d(off.dot(frame.normal), off.dot(frame.binormal)).normalized();
  }
};

TEST_F(NavigatorTest, PushesAlongTheRouteAndAnswersTheFrame) {
  NavigationInput input = inputAt(map, {map.pathTo(target).front(), 10e-3});
  input.time_us = 7;
  input.frame_sequence = 5;
  const NavigationAnswer answer = navigator.step(input);
  EXPECT_GT(answer.command.insertion_speed_m_per_s, 0);
  EXPECT_EQ(answer.command.time_us, 7);
  EXPECT_EQ(answer.command.frame_sequence, 5);
  EXPECT_GT(answer.command.valid_for_us, 0);
}

TEST_F(NavigatorTest, EveryDoubtStandsStillAndSaysWhy) {
  const NavigationInput good = inputAt(map, {map.pathTo(target).front(), 10e-3});
  NavigationInput unseen = good, lost = good, unsure = good, vague = good, wrong = good, sick = good, numb = good;
  unseen.belief.reset();
  lost.belief->status = BeliefStatus::kLost;
  unsure.belief->tip.probability = 0.3;
  vague.belief->tip.std_m = 0.05;
  wrong.belief->tip.branch = 100000;
  sick.belief->tip.arc_m = kNan;
  numb.drive.insertion_m = kNan;
  for (const NavigationInput& input : {unseen, lost, unsure, vague, wrong, sick, numb}) {
    const NavigationAnswer answer = Navigator(tree, {target, 3e-3}, {}).step(input);
    EXPECT_TRUE(rests(answer.command));
    EXPECT_EQ(answer.state, NavigationState::kWaiting);
    EXPECT_FALSE(answer.why.empty());
  }
}

// One view may not show a tip at all. Standing still in front of it for good shows it no better.
TEST_F(NavigatorTest, AsksForViewAfterViewWhileItSeesNoTip) {
  Navigator blind(tree, {target, 3e-3}, {});
  NavigationInput unseen = inputAt(map, {map.pathTo(target).front(), 10e-3});
  unseen.belief.reset();
  int asked = 0;
  double went_m = 0;
  for (double passed_s = 0; passed_s < 60; passed_s += unseen.period_s) {
    const NavigationAnswer answer = blind.step(unseen);
    asked += answer.another_view;
    went_m += answer.command.insertion_speed_m_per_s * unseen.period_s;
    EXPECT_LE(answer.command.insertion_speed_m_per_s, 0);
  }
  EXPECT_GE(asked, 4);
  EXPECT_LE(asked, 7);
  EXPECT_NEAR(went_m, -1e-3 * NavigatorSettings::retreat_mm, 1e-3);
}

// A tip that may stand on either side of the axis, along the beam, is turned once: what its turn shows tells which.
TEST_F(NavigatorTest, TurnsATipOnceWhosePlaceBesideTheAxisIsOpen) {
  NavigationInput input = inputAt(map, {map.pathTo(target).front(), 10e-3});
  input.belief->status = BeliefStatus::kUnsure;
  double turned_rad = 0;
  for (int i = 0; i < 100; ++i) {
    const NavigationAnswer answer = navigator.step(input);
    if (answer.state != NavigationState::kLooking) break;
    EXPECT_EQ(answer.command.insertion_speed_m_per_s, 0);
    EXPECT_GT(answer.command.roll_speed_rad_per_s, 0);
    input.drive.roll_rad += answer.command.roll_speed_rad_per_s * input.period_s;
    turned_rad = input.drive.roll_rad;
  }
  EXPECT_GT(turned_rad, 2 * kPi);
  EXPECT_LT(turned_rad, 2.5 * kPi);
  // Nothing was seen of the turn: it goes on all the same, and does not turn again at this place.
  EXPECT_GT(navigator.step(input).command.insertion_speed_m_per_s, 0);
  EXPECT_EQ(navigator.step(input).state, NavigationState::kFollowing);
}

// What the image shows of a loose tip decides in front of a fork: one that stands and points into the wanted branch is
// pushed on as it is, one that does so to the other branch is turned first, and a view along both branches' plane does
// not tell, so that another one is asked for.
TEST_F(NavigatorTest, CrossesAForkAtOnceWhereTheImageShowsTheTipOnTheWantedSide) {
  const Eigen::Vector2d side = sideways(wanted), across(-side.y(), side.x());
  enum class Shown { kRight, kWrong, kNothing };
  for (const Shown shown : {Shown::kRight, Shown::kWrong, Shown::kNothing}) {
    const bool right = shown == Shown::kRight;
    Navigator steering(tree, {target, 3e-3}, {});
    NavigationInput input = inputAt(map, {first, map.length_m(first) - 10e-3});
    showLooseTip(steering, input);
    input.deflection = TipDeflection{right ? 0.4 : -0.4, 0.05, shown == Shown::kNothing ? across : side,
                                     right ? 1.5e-3 : -1.5e-3, 0.4e-3};
    NavigationAnswer answer;
    for (int i = 0; i < 40; ++i) answer = steering.step(input);
    input.belief = inputAt(map, {first, map.length_m(first) - 3e-3}).belief;
    bool asked = false;
    for (int i = 0; i < 4; ++i) {
      answer = steering.step(input);
      asked = asked || answer.another_view;
    }
    EXPECT_EQ(asked, shown == Shown::kNothing);
    if (right) {
      EXPECT_EQ(answer.state, NavigationState::kCrossing);
      EXPECT_EQ(answer.command.roll_speed_rad_per_s, 0);
      EXPECT_GT(answer.command.insertion_speed_m_per_s, 0);
    } else {
      EXPECT_NE(answer.state, NavigationState::kCrossing);
      EXPECT_EQ(answer.command.insertion_speed_m_per_s, 0);
    }
  }
}

// From one branch to another a tip gets by way of their fork. A loose one that seems to have changed without being
// pulled back lay over the other branch in one of both frames: another view tells, before it is pulled back as one that
// took the wrong branch.
TEST_F(NavigatorTest, AsksForAnotherViewWhereALooseTipSeemsToBeInABranchThatItHasNoWayTo) {
  const TipBelief there = *inputAt(map, {wanted, 12e-3}).belief, leapt = *inputAt(map, {other, 12e-3}).belief;
  ASSERT_GT(std::min(map.length_m(wanted), map.length_m(other)), 12e-3);
  constexpr int kSteady = 3;                // Fewer frames may be bad ones.
  for (const bool again : {false, true}) {  // In the other view.
    Navigator steering(tree, {target, 3e-3}, {});
    NavigationInput input = inputAt(map, {wanted, 12e-3});
    showLooseTip(steering, input);
    input.belief = leapt;
    NavigationAnswer answer;
    for (int i = 0; i < kSteady; ++i) {
      EXPECT_FALSE(answer.another_view) << i;
      answer = steering.step(input);
      EXPECT_EQ(answer.command.insertion_speed_m_per_s, 0) << i;
    }
    EXPECT_TRUE(answer.another_view);
    EXPECT_EQ(steering.misses(), 0);
    if (!again) input.belief = there;
    for (int i = 0; i < 3 * kSteady; ++i) answer = steering.step(input);
    EXPECT_EQ(steering.misses(), again ? 1 : 0);
    EXPECT_EQ(answer.state == NavigationState::kBackingOff, again);
  }
}

// A loose tip that slips into the branch it is turned for is pushed on from there, before the turn that was planned is
// done; one frame does not tell, and the other branch is no reason. Where it fell out, it is turned past that place.
TEST_F(NavigatorTest, PushesALooseTipOnThatATurnBroughtIntoTheWantedBranch) {
  const TipBelief before = *inputAt(map, {first, map.length_m(first) - 3e-3}).belief;
  const double slipped_m = TreeTopology(wide).parting_m(first) + 3e-3;
  for (const int branch : {wanted, other}) {
    Navigator steering(wide, {target, 3e-3}, {});
    NavigationInput input = inputAt(map, {first, map.length_m(first) - 10e-3});
    showLooseTip(steering, input);
    input.deflection = TipDeflection{-0.4, 0.05, sideways(wanted), -1.5e-3, 0.4e-3};
    for (int i = 0; i < 40; ++i) (void)steering.step(input);
    input.belief = before;
    NavigationAnswer answer;
    for (int i = 0; i < 4; ++i) answer = steering.step(input);
    ASSERT_EQ(answer.state, NavigationState::kAiming);
    ASSERT_GT(answer.command.roll_speed_rad_per_s, 0);
    input.belief = inputAt(map, {branch, slipped_m}).belief;
    answer = steering.step(input);
    EXPECT_EQ(answer.command.insertion_speed_m_per_s, 0);
    for (int i = 0; i < 8 && answer.command.insertion_speed_m_per_s <= 0; ++i) answer = steering.step(input);
    EXPECT_EQ(answer.command.insertion_speed_m_per_s > 0, branch == wanted);
    EXPECT_EQ(answer.command.roll_speed_rad_per_s > 0, branch == other);
    if (branch == other) continue;
    // It falls out, into the other branch: the next try is not made from there again.
    input.belief = inputAt(map, {other, slipped_m + 5e-3}).belief;
    for (int i = 0; i < 20 && answer.state != NavigationState::kBackingOff; ++i) answer = steering.step(input);
    ASSERT_EQ(answer.state, NavigationState::kBackingOff);
    // Nor from where it springs to while it is pulled.
    input.belief = inputAt(map, {branch, 0.9 * map.length_m(branch)}).belief;
    for (int i = 0; i < 10; ++i) answer = steering.step(input);
    EXPECT_EQ(answer.state, NavigationState::kBackingOff);
    input.belief = inputAt(map, {first, map.length_m(first) - 19e-3}).belief;
    for (int i = 0; i < 60; ++i) answer = steering.step(input);
    input.belief = before;
    for (int i = 0; i < 20 && answer.state != NavigationState::kAiming; ++i) answer = steering.step(input);
    ASSERT_EQ(answer.state, NavigationState::kAiming);
    input.belief = inputAt(map, {branch, slipped_m}).belief;
    for (int i = 0; i < 8; ++i) answer = steering.step(input);
    EXPECT_EQ(answer.command.insertion_speed_m_per_s, 0);
    EXPECT_GT(answer.command.roll_speed_rad_per_s, 0);
  }
}

// In a wide vessel a loose tip that has missed a fork is turned by 135 deg from try to try, so that eight tries are 45
// deg apart; where a wall holds it, it is bent more at the same turn instead.
TEST_F(NavigatorTest, TurnsOrBendsALooseTipFurtherFromTryToTry) {
  const TipBelief before = *inputAt(map, {first, map.length_m(first) - 19e-3}).belief;
  const TipBelief near = *inputAt(map, {first, map.length_m(first) - 3e-3}).belief;
  const TipBelief beside = *inputAt(map, {other, 8e-3}).belief;
  NavigationInput input = inputAt(map, {first, map.length_m(first) - 12e-3});
  Navigator steering(wide, {target, 3e-3}, {});
  showLooseTip(steering, input);
  NavigationAnswer answer;
  const auto stepUntil = [&](NavigationState state) {
    for (int i = 0; i < 200 && answer.state != state; ++i) {
      answer = steering.step(input);
      input.drive.roll_rad += input.period_s * answer.command.roll_speed_rad_per_s;
      input.drive.bend_rad += input.period_s * answer.command.bend_speed_rad_per_s;
    }
    ASSERT_EQ(answer.state, state);
  };
  // Missed for the first time; from then on tries go by turns.
  input.belief = beside;
  stepUntil(NavigationState::kBackingOff);
  input.belief = before;
  stepUntil(NavigationState::kCrossing);
  // Half a turn from the only one, the same turn bent further, and the middle between those two.
  for (const double turn_deg : {180., 0., 0., 90.}) {
    const bool held = turn_deg == 0;
    input.belief = near;
    for (int i = 0; i < 5; ++i) answer = steering.step(input);
    const double roll_rad = input.drive.roll_rad, bend_rad = input.drive.bend_rad;
    if (held) {
      input.drive.insertion_force_n = 2;
    } else {
      input.belief = beside;
    }
    stepUntil(NavigationState::kBackingOff);
    EXPECT_EQ(answer.why, held ? "the drive pushes too hard" : "the tip has entered another branch");
    input.drive.insertion_force_n = 0;
    input.belief = before;
    stepUntil(NavigationState::kCrossing);
    // As near as an aim is: 8 deg.
    EXPECT_NEAR(input.drive.roll_rad - roll_rad, degToRad(turn_deg), degToRad(17));
    EXPECT_EQ(input.drive.bend_rad > bend_rad + degToRad(15), held);
  }
}

// What was pulled back is pushed in again before the tip follows: no wall holds it.
TEST_F(NavigatorTest, ALengthThatWasPulledBackMayBePushedInBeforeTheTipFollows) {
  for (const double pulled_m : {0.0, 10e-3}) {
    Navigator steering(tree, {target, 3e-3}, {});
    NavigationInput input = inputAt(map, {map.pathTo(target).front(), 10e-3});
    input.drive.insertion_m = 0.1;
    (void)steering.step(input);
    input.drive.insertion_m -= pulled_m;
    (void)steering.step(input);
    const double from_m = input.drive.insertion_m;
    while (steering.step(input).state != NavigationState::kBackingOff) {
      ASSERT_LT(input.drive.insertion_m, from_m + 50e-3);
      input.drive.insertion_m += 0.5e-3;
    }
    // Back to where it was, the same length once more, and then the stall that is one without pulling; in half
    // millimetres.
    EXPECT_NEAR(input.drive.insertion_m - from_m, 2 * pulled_m + 12e-3, 0.6e-3) << pulled_m;
  }
}

// A loose shaft takes up in parts what it was pulled back by: its tip springs on in between.
TEST_F(NavigatorTest, ALooseTipThatSpringsOnLeavesTheRestOfTheLengthToBePushedIn) {
  NavigationInput input = inputAt(map, {map.pathTo(target).front(), 10e-3});
  input.drive.insertion_m = 0.1;
  showLooseTip(navigator, input);
  input.drive.insertion_m -= 20e-3;
  (void)navigator.step(input);
  input.drive.insertion_m += 8e-3;
  (void)navigator.step(input);
  input.belief = inputAt(map, {map.pathTo(target).front(), 12e-3}).belief;
  (void)navigator.step(input);
  const double from_m = input.drive.insertion_m;
  while (navigator.step(input).state != NavigationState::kBackingOff) {
    ASSERT_LT(input.drive.insertion_m, from_m + 80e-3);
    input.drive.insertion_m += 0.5e-3;
  }
  // What is left of the 20 mm, and the stall that is one of a loose catheter; in half millimetres.
  EXPECT_NEAR(input.drive.insertion_m - from_m, 12e-3 + 25e-3, 0.6e-3);
}

// What does not arrive at a tip behind an ostium makes a loop in the wide vessel, which takes the tip out again: it is
// pushed no longer than a firm one, and neither coming back nor creeping on counts as following.
TEST_F(NavigatorTest, ALooseTipBehindAWideVesselIsNotPushedOutAgain) {
  // Also behind the ostium of a vessel that is itself wide, as the brachiocephalic artery is.
  const auto ostium = [&](double wide_m, double behind_m) {
    std::vector<std::optional<double>> radii(tree.size(), behind_m);
    for (const int point : map.points(first)) radii[static_cast<std::size_t>(point)] = wide_m;
    return VesselTree(tree.points(), tree.parents(), radii);
  };
  const VesselTree narrow = ostium(5e-3, 1e-3), wide_behind = ostium(12e-3, 5e-3);
  for (const auto& [vessels, back_per_step_m] :
       {std::pair(&narrow, 0.0), {&narrow, 0.1e-3}, {&narrow, -0.08e-3}, {&wide_behind, 0.0}}) {
    Navigator steering(*vessels, {target, 3e-3}, {});
    TreeLocation place{wanted, 0.6 * map.length_m(wanted)};
    NavigationInput input = inputAt(map, place);
    input.drive.insertion_m = 0.1;
    showLooseTip(steering, input);
    const double from_m = input.drive.insertion_m;
    while (steering.step(input).state != NavigationState::kBackingOff) {
      ASSERT_LT(input.drive.insertion_m, from_m + 80e-3);
      input.drive.insertion_m += 0.5e-3;
      place.arc_m -= back_per_step_m;
      input.belief = inputAt(map, place).belief;
    }
    EXPECT_NEAR(input.drive.insertion_m - from_m, 12e-3, 0.6e-3) << back_per_step_m;
    // Pulled, its tip goes on while the loop becomes straight. It is pulled until what went in while the tip stood is
    // out, and then no further than until the tip comes back.
    NavigationAnswer answer;
    for (const double step_m : {1e-3, -1e-3}) {
      for (int i = 0; i < 5; ++i) {
        place.arc_m += step_m;
        input.drive.insertion_m -= 3e-3;
        input.belief = inputAt(map, place).belief;
        answer = steering.step(input);
        if (step_m < 0 && i >= 3) continue;
        ASSERT_LT(answer.command.insertion_speed_m_per_s, 0) << i;
      }
    }
    EXPECT_NE(answer.state, NavigationState::kBackingOff);
  }
}

TEST_F(NavigatorTest, StopsWhereItWasToGo) {
  NavigationAnswer answer;
  for (int i = 0; i < 3; ++i) answer = navigator.step(inputAt(map, {target, 4e-3}));
  EXPECT_EQ(answer.state, NavigationState::kArrived);
  EXPECT_TRUE(rests(answer.command));
}

// Another branch may be as probable: being there is not knowing it. It asks for another view, and does not say that it
// has arrived for as long as it likes.
TEST_F(NavigatorTest, DoesNotArriveInABranchThatItIsNotSureOf) {
  NavigationInput input = inputAt(map, {target, 4e-3});
  input.belief->tip.probability = 0.6;
  int sibling = -1;
  for (const int child : map.children(*map.parent(target))) {
    if (child != target) sibling = child;
  }
  ASSERT_GE(sibling, 0);
  TipPlace beside = input.belief->tip;
  beside.branch = sibling;
  beside.probability = 0.38;
  beside.tip_model = map.point({sibling, 4e-3});
  ASSERT_GT((beside.tip_model - input.belief->tip.tip_model).norm(), 2e-3);
  input.belief->alternatives = {beside};
  int asked = 0;
  for (int k = 0; k < 100; ++k) {
    const NavigationAnswer answer = navigator.step(input);
    ASSERT_NE(answer.state, NavigationState::kArrived);
    ASSERT_LE(answer.command.insertion_speed_m_per_s, 0);
    asked += answer.another_view;
  }
  EXPECT_EQ(asked, 1);
  input.belief->tip.probability = 0.98;
  input.belief->alternatives.clear();
  NavigationState last{};
  for (int k = 0; k < 5; ++k) last = navigator.step(input).state;
  EXPECT_EQ(last, NavigationState::kArrived);
}

TEST_F(NavigatorTest, PullsBackFromForce) {
  NavigationInput input = inputAt(map, {map.pathTo(target).front(), 10e-3});
  input.drive.insertion_force_n = 2;
  const NavigationAnswer answer = navigator.step(input);
  EXPECT_LT(answer.command.insertion_speed_m_per_s, 0);
  EXPECT_EQ(answer.why, "the drive pushes too hard");
}

// A catheter that is hooked: no command pulls harder, so that waiting for it to come would be for ever.
TEST_F(NavigatorTest, PushesAgainWhereAPullHasComeToItsFullForce) {
  NavigationInput input = inputAt(map, {map.pathTo(target).front(), 10e-3});
  (void)navigator.step(input);
  input.drive.insertion_force_n = 0.75;
  EXPECT_EQ(navigator.step(input).state, NavigationState::kBackingOff);
  input.drive.insertion_force_n = -0.7;
  EXPECT_LT(navigator.step(input).command.insertion_speed_m_per_s, 0);
  input.drive.insertion_force_n = -0.73;
  EXPECT_GT(navigator.step(input).command.insertion_speed_m_per_s, 0);
}

TEST_F(NavigatorTest, RefusesATargetThatIsNoPlaceOfTheTree) {
  EXPECT_NE(test::refusalOf([&] { Navigator(tree, {map.branchCount(), 0}, {}); }).find("target"), std::string::npos);
  EXPECT_NE(test::refusalOf([&] { Navigator(tree, {0, 9.0}, {}); }).find("arc_m"), std::string::npos);
}

}  // namespace
}  // namespace angio::test
