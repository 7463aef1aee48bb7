// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/localisation/localiser_settings.hpp"
#include "angio/localisation/seen_catheter.hpp"
#include "angio/localisation/tip_belief.hpp"
#include "angio/localisation/tip_evidence.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::localisation {

/// What has happened since the frame before.
struct CatheterMotion {
  double period_s = 1.0 / 15;      ///< Time since the last frame [s].
  std::optional<double> pushed_m;  ///< Length pushed in at the insertion point since then, pulled back < 0 [m].
};

/// Where the frame's pose comes from and what it is worth.
struct SeenPose {
  XrayCamera camera;
  Pose T_camera_model = Pose::Identity();

  /// Of [translation; rotation] in camera axes, m and rad, as RegistrationResult::covariance; zero: the pose is exact.
  Matrix6d covariance = Matrix6d::Zero();
};

/// Follows a catheter's tip inside a vessel tree, by what one X-ray frame after another shows.
///
/// A hidden Markov model over places of the tree (about one a millimetre), after Ambrosini et al., IEEE TMI 36(3),
/// 2017. A place is judged by the whole curve: the path from the root to it must lie under the curve in order, from the
/// tip back, so that a vessel that merely crosses it does not count. The image's shift against the pose (breathing,
/// what the registration left) is unknown in each place and carried along with it.
///
/// Knows neither clock nor random numbers; the same calls give the same beliefs.
class CatheterLocaliser {
 public:
  /// Throws InputError when a setting is out of its range.
  CatheterLocaliser(const LocaliserSettings& settings, const VesselTree& tree);
  ~CatheterLocaliser();
  CatheterLocaliser(CatheterLocaliser&&) noexcept;
  CatheterLocaliser& operator=(CatheterLocaliser&&) noexcept;

  /// Takes one frame's curve. A curve or pose that says nothing (too short, not finite) only predicts.
  [[nodiscard]] TipBelief update(const SeenCatheter& seen, const SeenPose& pose, const CatheterMotion& motion);

  /// The same, by what somebody else has found each place to be worth; the image's shift is not looked at. Evidence
  /// that is empty or not finite, or is of chains that are not there, only predicts.
  [[nodiscard]] TipBelief update(const TipEvidence& evidence, const CatheterMotion& motion);

  /// A frame without a catheter in it: time passes, the tip moves.
  [[nodiscard]] TipBelief predict(const CatheterMotion& motion);

  /// Forgets all frames: every place is as probable as any other.
  void reset();

  /// The same, with the tip known to be about `arc_m` into a chain. Throws InputError for a chain that is not there, or
  /// an arc length or sigma that cannot be.
  void reset(int chain, double arc_m, double std_m);

  /// The belief as it stands.
  const TipBelief& belief() const;

 private:
  class Filter;
  std::unique_ptr<Filter> filter_;
};

}  // namespace angio::localisation
