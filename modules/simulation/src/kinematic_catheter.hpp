// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "catheter_body.hpp"

namespace angio::simulation {

/// A catheter whose body follows the vessels' axes. At a fork it enters the branch that its free tip points to best,
/// where the branches' lumens part; where it points into none, it stands against the wall. Friction by Euler's and
/// Eytelwein's capstan equation, wind-up of the shaft as a play operator.
class KinematicCatheter : public CatheterBody {
 public:
  KinematicCatheter(const VesselTree& tree, const CatheterSettings& settings, const TreeLocation& start);

  bool settle(const Base& base) override;
  double insertionForce_n() const override { return force_n_; }
  CatheterTruth truth() const override;
  Eigen::Matrix3Xd line(const Eigen::Matrix3Xd& points) const override;

 private:
  void slide(double insertion_m);
  bool advanceTip(double step_m);
  void retractTip(double step_m);
  int choose(int branch, double* worst) const;
  void feel(double insertion_m);
  double freePlay() const;
  double slidingForce() const;
  double radius(const TreeLocation& place) const;
  TreeLocation placeAt(double path_m) const;
  double deflection_m(const TreeLocation& place) const;
  Eigen::Vector3d freeDirection() const;
  Eigen::Vector3d heldDirection() const;

  CatheterSettings settings_;
  VesselTree tree_;
  TreeTopology map_;
  std::vector<int> path_;               // Branches from the root to the tip.
  double tip_m_ = 0;                    // Of the tip along the path, from the root.
  double roll_rad_ = 0, bend_rad_ = 0;  // Of the tip; roll without the zero's offset.
  double force_n_ = 0, tip_force_n_ = 0;
  bool blocked_ = false, buckled_ = false;
  FeltForces felt_;
};

}  // namespace angio::simulation
