// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio {

/// Which injection a bolus has from the start: the one of its settings, or none until one is demanded.
enum class BolusTrigger { kSettings, kDemand };

/// Injections of contrast agent at the tree's root, and the blood that carries it.
///
/// Blood moves at `speed_m_per_s` where the radius is 2 mm, and in proportion to the radius elsewhere, as it does in a
/// tree of Murray's law. The defaults are plausible for a liver's arteriogram by hand injection; they are nobody's
/// measurement.
struct BolusSettings {
  bool enabled = false;  ///< Otherwise the tree is full of contrast agent at all times.
  BolusTrigger trigger = BolusTrigger::kSettings;
  double start_s = 0.3;        ///< Trigger kSettings: when the injection begins, after the first frame.
  double injection_s = 2;      ///< Trigger kSettings: how long the injection lasts.
  double speed_m_per_s = 0.3;  ///< Of blood where the radius is 2 mm.
  double wash_in_s = 0.25;     ///< From a tenth to nine tenths of the full density, at the root.
  double wash_out_s = 0.8;     ///< Time constant of the end.
  double dispersion = 0.15;    ///< Fronts get longer by this part of the time since the root.

  void visit(SettingsVisitor& v) {
    v.flag("enabled", enabled);
    v.choice("trigger", trigger, {"settings", "demand"});
    v.number("start_s", start_s, 0, 3600);
    v.number("injection_s", injection_s, 0.05, 600);
    v.number("speed_m_per_s", speed_m_per_s, 0.01, 5);
    v.number("wash_in_s", wash_in_s, 0.01, 30);
    v.number("wash_out_s", wash_out_s, 0.01, 60);
  }
};

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

}  // namespace angio
