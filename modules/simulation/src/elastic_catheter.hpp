// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/rod/elastic_rod.hpp"
#include "catheter_body.hpp"

namespace angio::simulation {

/// A catheter that is an elastic rod between the walls of the vessels. Its drive has the settings' backlash, and lets
/// it bulge outside the vessels where it would have to push with more than `buckling_force_n`.
class ElasticCatheter : public CatheterBody {
 public:
  /// Throws InputError when the tip starts nearer to the root than ElasticRod::kMinInserted_m.
  ElasticCatheter(const VesselTree& tree, const CatheterSettings& settings, const TreeLocation& start);

  bool settle(const Base& base) override;
  double minInsertion_m() const override { return rod::ElasticRod::kMinInserted_m; }
  double insertionForce_n() const override { return forces_.insertion_n; }
  CatheterTruth truth() const override;
  Eigen::Matrix3Xd line(const Eigen::Matrix3Xd& points) const override;

 private:
  void feel();

  CatheterSettings settings_;
  VesselTree tree_;
  Base drive_;                          // The drive's base when it was last looked at.
  Base followed_;                       // That of the rod behind the drive's backlash: where it should be.
  double roll_rad_ = 0, bend_rad_ = 0;  // Of the rod at its base, without the zero's offset; of its tip, by steering.
  rod::ElasticRod rod_;
  rod::RodForces forces_;
  FeltForces felt_;
  double tip_roll_rad_ = 0;  // Against the vessel's frame, not wrapped.
  bool bulges_ = false;
};

}  // namespace angio::simulation
