// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <memory>

#include "angio/simulation/simulated_catheter.hpp"

namespace angio::simulation {

/// What of a simulated catheter lies in the vessels and follows the drive's base.
class CatheterBody {
 public:
  using Base = SimulatedCatheter::Base;

  CatheterBody(const CatheterBody&) = delete;
  CatheterBody& operator=(const CatheterBody&) = delete;
  virtual ~CatheterBody() = default;

  /// The drive's base is at `base` now, a step after the last call. Returns whether it has moved along.
  virtual bool settle(const Base& base) = 0;

  /// How far the base can be pulled out [m].
  virtual double minInsertion_m() const { return 0; }

  /// With which the drive pushes (+) or pulls (-) [N].
  virtual double insertionForce_n() const = 0;

  virtual CatheterTruth truth() const = 0;

  /// Its line, 3 x N [m], the tip last, where the tree's points stand at `points`.
  virtual Eigen::Matrix3Xd line(const Eigen::Matrix3Xd& points) const = 0;

 protected:
  CatheterBody() = default;
};

/// The body that the settings choose; all its settings checked, its tip at `start`, all radii of the tree known.
std::unique_ptr<CatheterBody> makeCatheterBody(const VesselTree& tree, const CatheterSettings& settings,
                                               const TreeLocation& start);

/// A play operator: what follows `input` with a dead band of `half_width` to either side.
inline double followed(double output, double input, double half_width) {
  return std::clamp(output, input - half_width, input + half_width);
}

/// The wall's force on the tip, contacts counted, and the largest forces since the start.
class FeltForces {
 public:
  void feel(double tip_force_n, double insertion_force_n) {
    // Counted anew only after the tip has come half free, or one that trembles would be many.
    const bool touches = tip_force_n > (touches_ ? 0.5 : 1.0) * CatheterSettings::contact_force_n;
    count_ += touches && !touches_;
    touches_ = touches;
    force_n_ = tip_force_n;
    max_force_n_ = std::max(max_force_n_, tip_force_n);
    max_push_n_ = std::max(max_push_n_, insertion_force_n);
    max_pull_n_ = std::max(max_pull_n_, -insertion_force_n);
  }

  void describe(CatheterTruth& truth) const {
    truth.touches_wall = touches_;
    truth.wall_contacts = count_;
    truth.tip_force_n = force_n_;
    truth.max_tip_force_n = max_force_n_;
    truth.max_push_n = max_push_n_;
    truth.max_pull_n = max_pull_n_;
  }

 private:
  bool touches_ = false;
  int count_ = 0;
  double force_n_ = 0, max_force_n_ = 0, max_push_n_ = 0, max_pull_n_ = 0;
};

}  // namespace angio::simulation
