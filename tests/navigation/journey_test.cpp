// SPDX-License-Identifier: GPL-2.0-or-later
// The whole way without images: a simulated catheter, its projected and disturbed line, the localiser, the navigator.
#include <gtest/gtest.h>

#include "angio/rehearsal/navigate_study.hpp"
#include "angio/test/phantoms.hpp"

namespace angio {
namespace {

// Forks a few millimetres apart are told apart by luck: one of four journeys may be given up, but none may end in a
// wrong branch and say that it has arrived.
TEST(Journey, ReachesTheBranchesOfAMadeUpTree) {
  const VesselTree tree = test::branchingTree(6);
  NavigateStudySettings study;
  study.images = false;
  const std::vector<TreePlace> targets = navigateTargets(tree, study, 4);
  ASSERT_EQ(targets.size(), 4u);
  int reached = 0;
  for (std::size_t k = 0; k < targets.size(); ++k) {
    const NavigateRow row = studyNavigation(tree, targets[k], study, {}, 1 + k);
    reached += row.reached;
    EXPECT_TRUE(row.reached || row.ended.find("arrived") == std::string::npos) << targets[k].chain;
    EXPECT_GT(row.errors_m.size(), 0.8 * row.frames);
  }
  EXPECT_GE(reached, 3);
}

TEST(Journey, IsTheSameTwice) {
  const VesselTree tree = test::branchingTree(6);
  NavigateStudySettings study;
  study.images = false;
  study.longest_s = 10;
  const TreePlace target = navigateTargets(tree, study, 1).front();
  const NavigateRow a = studyNavigation(tree, target, study, {}, 3), b = studyNavigation(tree, target, study, {}, 3);
  EXPECT_EQ(a.errors_m, b.errors_m);
  EXPECT_EQ(a.time_s, b.time_s);
}

}  // namespace
}  // namespace angio
