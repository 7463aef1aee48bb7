// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/registration/registration.hpp"
#include "field_search.hpp"

namespace angio::registration {

/// One pass of a search: how far the belief is widened, and what is supposed of the frame.
struct SearchPass {
  /// Outlier masses: some of the branches may be empty of contrast agent, or most of them.
  static constexpr double kSomeEmpty = 5, kMaxEmpty = 50;

  double widened;
  FieldHypothesis frame;
  int draws = 1500;              ///< Of rotation and depth, where all shifts are tried,
  std::size_t candidates = 512;  ///< and of what comes of them.
};

/// Returns the passes of a search, in their order; the first that settles the question is the last. Far from the
/// belief, and in a box, poses differ in how much of the tree they have in view, and a tree that is mostly empty is
/// found among many candidates.
std::vector<SearchPass> searchPasses(const StartSettings& starts, const PosePrior& prior);

/// Returns what a search believes before it begins. One through a box knows no more of the pose than that it is in it:
/// the box's own spread.
PosePrior beforeSearch(PosePrior prior, const StartSettings& starts);

}  // namespace angio::registration
