// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "angio/navigation/namespace.hpp"
#include "angio/types/any_message.hpp"

namespace angio::navigation {

/// Cuts commands so that a catheter's drive pushes and pulls with no more than a given force.
///
/// A frame shows the force that was at its exposure. Until its command moves the drive, earlier commands do, and a
/// command is obeyed until the next one comes or it runs out. While a wall holds the tip, all of that way adds to the
/// force, in proportion to the stiffness of the catheter. A command is therefore cut to the speed and the validity for
/// which the force stays below the limit though no other command follows: at once where the force is far from the
/// limit, and the slower the nearer it is.
///
/// The stiffness is the largest that was seen, `assumed_n_per_m` at least: a stiffer catheter may exceed the limit at
/// its first contact. Standing still, turning and bending are not cut.
///
/// Knows neither clock nor bus; the same states and commands give the same cuts.
class DriveForceLimiter {
 public:
  /// Of a catheter in compression, until more is seen; never less, since a soft hold bounds nothing of the next one. Of
  /// the simulated ones the kinematic one has 400 N/m. The elastic one has 94 N/m at most where a fork of the liver holds
  /// its tip, 203 N/m over a millimetre where a pull becomes a push, and 577 N/m at the end of a narrow vessel. Nobody's
  /// measurement of a real one.
  static constexpr double assumed_n_per_m = 450;

  /// Forces from this share of the limit on are as much as a push or a pull comes to soon: the nearer to the limit, the
  /// slower.
  static constexpr double full_share = 0.9;

  /// @param max_force_n  The limit [N, > 0].
  /// @param latency_s    From an exposure until its command moves the drive [s]; a quarter of a period more is allowed
  /// for.
  DriveForceLimiter(double max_force_n, double latency_s) : max_force_n_(max_force_n), latency_s_(latency_s) {}

  /// The drive at the exposure of the next frame. Call exactly once per frame, before limited().
  void observe(const CatheterState& drive);

  /// The command, which answers the frame that was observed last, with its insertion cut. Its roll and its bend are
  /// obeyed no longer than the insertion is.
  CatheterCommand limited(const CatheterCommand& wanted) const;

  /// What was sent for the frame that was observed last, or for one that was not looked at.
  void commit(const CatheterCommand& sent);

  /// The stiffness that commands are cut by [N/m].
  double stiffness_n_per_m() const { return stiffness_n_per_m_; }

 private:
  void learn(const CatheterState& drive);
  double reach_s(std::int64_t frame_us) const;
  double wayInFlight_m(double direction, double reach_s) const;

  double max_force_n_, latency_s_;
  double stiffness_n_per_m_ = assumed_n_per_m;
  double period_s_ = 1.0 / 15;                      // From the frame before to this one.
  std::optional<CatheterState> drive_;              // At the last exposure.
  std::optional<CatheterState> from_, risen_from_;  // From where the next stiffness counts, and the last one did.
  std::vector<CatheterCommand> sent_;               // That may still move the drive, by time.
};

}  // namespace angio::navigation
