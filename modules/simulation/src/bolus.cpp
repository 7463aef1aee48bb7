// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/bolus.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"

namespace angio {
namespace {

constexpr double kReferenceRadius = 2e-3;  // [m]
// A logistic curve 1 / (1 + exp(-x)) goes from a tenth to nine tenths within 2 ln 9.
const double kTenToNinety = 2 * std::log(9.0);

double logistic(double x) { return 1 / (1 + std::exp(-x)); }

}  // namespace

Bolus::Bolus(const VesselTree& tree, const BolusSettings& settings)
    : settings_(settings), arrival_s_(Eigen::VectorXd::Zero(tree.size())) {
  checkSettings("bolus", settings);
  const auto radius = [&](int i) {
    if (!tree.radii()[i]) throw InputError("vessel tree", "radius of point " + std::to_string(i), "", "must be known");
    return *tree.radii()[i];
  };
  for (const int i : tree.parentsFirst()) {
    const int from = tree.parents()[i];
    if (from < 0) continue;
    const double speed = settings.speed_m_per_s * 0.5 * (radius(from) + radius(i)) / kReferenceRadius;
    arrival_s_[i] = arrival_s_[from] + (tree.points().col(i) - tree.points().col(from)).norm() / speed;
  }
}

Eigen::VectorXd Bolus::densities(double time_s) const {
  if (!settings_.enabled) return Eigen::VectorXd::Ones(arrival_s_.size());
  return arrival_s_.unaryExpr([&](double arrival_s) {
    const double since_front = time_s - settings_.start_s - arrival_s;
    const double spread = (settings_.wash_in_s + settings_.dispersion * arrival_s) / kTenToNinety;
    const double tail = settings_.wash_out_s + settings_.dispersion * arrival_s;
    const double since_end = since_front - settings_.injection_s;
    const double left = since_end > 0 ? std::exp(-since_end / tail) : 1.0;
    return logistic(since_front / spread) * left;
  });
}

}  // namespace angio
