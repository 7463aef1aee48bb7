// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "angio/navigation/catheter_tracer.hpp"
#include "angio/navigation/namespace.hpp"

namespace angio::navigation {

/// Estimates how far a catheter lies beside its vessel's axis at the tip, apart from what the tip's bend puts it there.
///
/// An elastic shaft lies anywhere in the lumen: at the outer wall of a bend, or across it. The offset has two
/// components in the vessel's frame, of which one view shows one. It is a random walk that comes back to zero over the
/// way that the tip slides and turns (a Kalman filter), so that two views in turn show both. How large it usually is,
/// is learnt from the component that is seen, since the other is of the same size: a catheter that keeps to where its
/// bend puts it in the image is taken to do so along the beam too.
class ShaftOffset {
 public:
  /// The tip has slid by `slid_m` [m] and the drive has rolled by `rolled_rad`.
  void move(double slid_m, double rolled_rad);

  /// A frame shows that the tip's end stands `offset_m` beside the axis in the direction `observable_axis` (in the
  /// vessel's frame, at most 1 long), with a standard deviation of `std_m`, where its bend alone would put it at
  /// `bent`.
  void see(const TipOffset& bent, const Eigen::Vector2d& observable_axis, double offset_m, double std_m);

  /// Where the tip's end is beside the axis, both together.
  TipOffset with(const TipOffset& bent) const;

  /// Standard deviation of an offset that nothing has been seen of, per axis [m].
  double usual_m() const;

  /// How much the catheter is one that lies anywhere in the lumen: 0 for one that keeps to where its bend puts it.
  double looseness() const;

 private:
  static constexpr double kFirst_m2 = 0.36e-6;  // Of a catheter of which nothing has been seen: between both kinds.
  double usual_variance_ = kFirst_m2;           // [m^2], per axis.
  double nature_variance_ = kFirst_m2;          // The same over a longer way.
  double learnt_ = 0;  // Of the last way, what the usual variance has not yet been learnt from.
  Eigen::Vector2d mean_m_ = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_ = Eigen::Matrix2d::Identity() * kFirst_m2;
};

}  // namespace angio::navigation
