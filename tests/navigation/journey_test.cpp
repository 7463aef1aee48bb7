// SPDX-License-Identifier: GPL-2.0-or-later
// The whole way without images: a simulated catheter, its projected and disturbed line, the localiser, the navigator.
#include <gtest/gtest.h>

#include "angio/rehearsal/navigate_study.hpp"
#include "angio/test/phantoms.hpp"

namespace angio {
namespace {

TEST(Journey, ReachesTheBranchesOfAMadeUpTree) {
  const VesselTree tree = test::branchingTree(6);
  NavigateStudySettings study;
  study.images = false;
  const std::vector<TreePlace> targets = navigateTargets(tree, study, 4);
  ASSERT_EQ(targets.size(), 4u);
  for (std::size_t k = 0; k < targets.size(); ++k) {
    const NavigateRow row = studyNavigation(tree, targets[k], study, {}, 1 + k);
    EXPECT_TRUE(row.reached) << "branch " << targets[k].chain << ": " << row.ended;
    EXPECT_GT(row.errors_m.size(), 0.8 * row.frames);
  }
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
