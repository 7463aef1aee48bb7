// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/localisation/sequence_localiser.hpp"
#include "tip_filter.hpp"

namespace angio::localisation {

/// One frame after the forward pass.
struct ForwardFrame {
  CatheterMotion motion;
  FrameOutcome outcome;
  std::vector<double> probability;    ///< Of each place, by the frames up to this one.
  std::vector<Candidate> candidates;  ///< Empty when the frame was not used.
};

/// Runs a filter over a sequence from its reset on.
std::vector<ForwardFrame> forwardPass(TipFilter& filter, const std::vector<SequenceFrame>& frames);

/// Probabilities of the places in each frame by all frames (forward-backward; Rabiner, Proc. IEEE 77(2), 1989, eq. 27).
std::vector<std::vector<double>> smoothed(const TipFilter& filter, const std::vector<ForwardFrame>& frames);

/// The most probable places of the tip as one way (Viterbi; Rabiner 1989, eq. 30-35).
std::vector<int> mostProbableRoute(const TipFilter& filter, const std::vector<ForwardFrame>& frames);

}  // namespace angio::localisation
