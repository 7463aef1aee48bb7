// SPDX-License-Identifier: GPL-2.0-or-later
#include "banded_system.hpp"

#include <algorithm>
#include <vector>

namespace angio::rod {

BandedSystem::BandedSystem(Eigen::Index size) : matrix_(size, size) {
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index c = 0; c < size; ++c) {
    for (Eigen::Index r = c; r < std::min(size, c + kBand + 1); ++r) {
      entries.emplace_back(static_cast<int>(r), static_cast<int>(c), 0.0);
    }
  }
  matrix_.setFromTriplets(entries.begin(), entries.end());
  matrix_.makeCompressed();
  factor_.analyzePattern(matrix_);
}

void BandedSystem::clear(double softening) {
  matrix_.coeffs().setZero();
  softening_ = softening;
}

bool BandedSystem::factorise() {
  factor_.factorize(matrix_);
  return factor_.info() == Eigen::Success;
}

}  // namespace angio::rod
