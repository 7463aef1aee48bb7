// SPDX-License-Identifier: GPL-2.0-or-later
#include "search_passes.hpp"

namespace angio::registration {

std::vector<SearchPass> searchPasses(const StartSettings& starts, const PosePrior& prior) {
  constexpr double kSomeEmpty = SearchPass::kSomeEmpty, kMaxEmpty = SearchPass::kMaxEmpty;
  if (starts.box()) {
    return {{1, {kSomeEmpty, 0.9}},
            {1, {kMaxEmpty, 0.9, true}, 1500, 16384},
            {1, {kSomeEmpty, 1.1}},
            {1, {kSomeEmpty, 0.7}},
            {1, {kSomeEmpty, 0.9}, 12000, 4096}};
  }
  if (prior.covariance) return {{1, {kSomeEmpty}}, {1, {kMaxEmpty}}};
  return {{1, {kSomeEmpty}},  {1, {kMaxEmpty}},       {1.8, {kSomeEmpty}},
          {1.8, {kMaxEmpty}}, {3, {kSomeEmpty, 0.9}}, {3, {kMaxEmpty, 0.9, true}, 1500, 8192}};
}

PosePrior beforeSearch(PosePrior prior, const StartSettings& starts) {
  if (!starts.box() || prior.covariance) return prior;
  prior.covariance = Matrix6d::Zero();
  prior.covariance->diagonal() << Eigen::Vector3d::Constant(1e-3 * starts.box_translation_mm),
      Eigen::Vector3d::Constant(degToRad(starts.box_rotation_deg));
  prior.covariance->diagonal() = (prior.covariance->diagonal().array().square() / 3).matrix().eval();
  return prior;
}

}  // namespace angio::registration
