// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/registration/iterative_pnp_settings.hpp"
#include "angio/registration/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::registration {

/// Two points of a tree whose displacements are held together by weight |r_i - r_j|^2, i > j.
struct DisplacementPair {
  int i, j;
  double weight;
};

/// The pairs of the chain and neighbour terms of E_reg, eq. 4 of the paper, sorted, each pair once. lambda2 is not in
/// the weights. The paper's sums run over ordered pairs, so a chain edge counts twice.
std::vector<DisplacementPair> displacementPairs(const VesselTree& tree, const IterativePnpSettings& settings);

}  // namespace angio::registration
