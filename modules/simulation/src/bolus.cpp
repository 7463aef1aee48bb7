// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/bolus.hpp"

#include <cmath>

#include "angio/base/errors.hpp"

namespace angio::simulation {
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
  if (settings.trigger == BolusTrigger::kSettings) injections_.push_back({settings.start_s, settings.injection_s});
}

void Bolus::beginInjection(double time_s) {
  if (!isOpen()) injections_.push_back({time_s, std::nullopt});
}

void Bolus::endInjection(double time_s) {
  if (!isOpen()) return;
  const double duration_s = time_s - injections_.back().begin_s;
  if (duration_s > 0) {
    injections_.back().duration_s = duration_s;
  } else {
    injections_.pop_back();
  }
}

Eigen::VectorXd Bolus::densities(double time_s) const {
  if (!settings_.enabled) return Eigen::VectorXd::Ones(arrival_s_.size());
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(arrival_s_.size());
  for (const Injection& injection : injections_) sum += densitiesOf(injection, time_s);
  return sum.cwiseMin(1.0);
}

Eigen::VectorXd Bolus::densitiesOf(const Injection& injection, double time_s) const {
  return arrival_s_.unaryExpr([&](double arrival_s) {
    const double since_front = time_s - injection.begin_s - arrival_s;
    const double spread = (settings_.wash_in_s + settings_.dispersion * arrival_s) / kTenToNinety;
    if (!injection.duration_s) return logistic(since_front / spread);
    const double tail = settings_.wash_out_s + settings_.dispersion * arrival_s;
    const double since_end = since_front - *injection.duration_s;
    const double left = since_end > 0 ? std::exp(-since_end / tail) : 1.0;
    return logistic(since_front / spread) * left;
  });
}

}  // namespace angio::simulation
