// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "angio/simulation/namespace.hpp"
#include "angio/simulation/patient_settings.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::simulation {

/// How much contrast agent is where in a tree, and when.
class Bolus {
 public:
  /// Radii must be known. Throws InputError when a setting is out of its range or a radius unknown.
  Bolus(const VesselTree& tree_with_radii, const BolusSettings& settings);

  /// When blood that was at the root at time 0 comes to each point [s].
  const Eigen::VectorXd& arrival_s() const { return arrival_s_; }

  /// Begins an injection at `time_s` [s], beside the one of the settings if the trigger is kSettings. Its end is open
  /// until endInjection(). Does nothing while another injection's end is open. Half of the full density is at the root
  /// at once.
  void beginInjection(double time_s);

  /// Ends the injection whose end is open at `time_s` [s]. Does nothing without one. An injection that does not last
  /// leaves no contrast agent.
  void endInjection(double time_s);

  /// Density at each point at a time [s], relative to the agent's full density, 0..1. Without a bolus: 1.
  ///
  /// Each injection's density rises as a logistic curve around its front's arrival, and falls exponentially after its
  /// end's. Densities of several injections add up, because transport is linear in the concentration. The sum is cut at
  /// 1, the density of the undiluted agent.
  Eigen::VectorXd densities(double time_s) const;

 private:
  struct Injection {
    double begin_s;
    std::optional<double> duration_s;  // Nothing while the end is open.
  };
  bool isOpen() const { return !injections_.empty() && !injections_.back().duration_s; }
  Eigen::VectorXd densitiesOf(const Injection& injection, double time_s) const;

  BolusSettings settings_;
  Eigen::VectorXd arrival_s_;
  std::vector<Injection> injections_;
};

}  // namespace angio::simulation
