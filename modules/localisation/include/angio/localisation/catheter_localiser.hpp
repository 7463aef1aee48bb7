// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>

#include "angio/base/settings.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/localisation/namespace.hpp"
#include "angio/localisation/seen_catheter.hpp"
#include "angio/localisation/tip_belief.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::localisation {

class TipFilter;
struct FrameOutcome;

/// Settings of CatheterLocaliser.
struct LocaliserSettings {
  // Places and motion.
  double spacing_mm = 1;
  double max_speed_mm_per_s = 60;
  static constexpr double speed_std_mm_per_s =
      10;                                  ///< Usual speed of the tip, when nothing says how far it was pushed.
  static constexpr double slip_std = 0.3;  ///< Share of a pushed length that friction and bends take or give back.
  double backlash_mm = 0.5;                ///< Motion of the tip that no push explains, a frame.
  static constexpr double jump_probability = 1e-6;  ///< That the filter was wrong and the tip is anywhere.

  // The image's shift against the pose: a walk that comes back to zero.
  double shift_std_mm = 3;
  double shift_time_s = 2;         ///< Correlation time of the shift.
  double scale_std_percent = 0.5;  ///< Of the image's size, besides the pose's covariance; anew each frame.
  double roll_std_deg = 0.5;       ///< Of its turn in the image, the same.

  // When a belief is sure.
  double near_mm = 1.5;        ///< Places within this of each other are one.
  double min_probability = 0;  ///< That the tip is so near to the estimated place; below, the belief is unsure.

  // Similarity of a curve and a path.
  static constexpr double step_px = 10;  ///< Between the points of the curve that are looked at.
  double model_std_px = 2;  ///< Of the vessel's place besides the curve's own noise: the tree is not quite rigid.
  static constexpr double tip_std_px = 3;       ///< Of the seen tip along the vessel.
  double outlier_px = 12;                       ///< Distance from which a point of the curve counts as an outlier.
  static constexpr double correlation_px = 40;  ///< Length of the curve over which its errors are correlated.
  double lost_px = 15;                          ///< Mean distance above which the tip counts as lost.

  void visit(SettingsVisitor& v) {
    v.number("spacing_mm", spacing_mm, 0.1, 20, "Distance between places on the tree");
    v.number("max_speed_mm_per_s", max_speed_mm_per_s, 0.1, 1000,
             "Largest speed of the tip along the vessel, when nothing says how far it was pushed");
    v.number("shift_std_mm", shift_std_mm, 0.01, 100,
             "Standard deviation of the image's shift against the pose, per axis, at the tip's depth");
    v.fixed("backlash_mm", backlash_mm, 0.01, 20);
    v.fixed("shift_time_s", shift_time_s, 0.01, 1000);
    v.fixed("scale_std_percent", scale_std_percent, 0.01, 50);
    v.fixed("roll_std_deg", roll_std_deg, 0.01, 90);
    v.fixed("near_mm", near_mm, 0, 200);
    v.fixed("min_probability", min_probability, 0, 1);
    v.fixed("model_std_px", model_std_px, 0.1, 50);
    v.fixed("outlier_px", outlier_px, 1, 500);
    v.fixed("lost_px", lost_px, 1, 1000);
  }
};

/// What has happened since the frame before.
struct CatheterMotion {
  double period_s = 1.0 / 15;      ///< Time since the last frame [s].
  std::optional<double> pushed_m;  ///< Length pushed in at the insertion point since then, pulled back < 0 [m].

  /// Standard deviation of the tip's motion against that, besides the settings' slip and backlash [m].
  double loose_m = 0;

  /// Probability that the tip is where no frame says, whatever the evidence.
  double fault_probability = 0;
};

/// Where the frame's pose comes from and what it is worth.
struct SeenPose {
  XrayCamera camera;
  Pose T_camera_model = Pose::Identity();

  /// Of [translation; rotation] in camera axes, m and rad, as RegistrationResult::covariance; zero: the pose is exact.
  Matrix6d covariance = Matrix6d::Zero();
};

/// Tracks a catheter's tip inside a vessel tree from frame to frame.
///
/// A hidden Markov model over places of the tree (about one a millimetre), after Ambrosini et al., IEEE TMI 36(3),
/// 2017. A place is scored by the whole curve: the path from the root to it must lie under the curve in order, from the
/// tip back, so that a vessel that merely crosses it does not count. The image's shift against the pose (breathing,
/// what the registration left) is unknown in each place and carried along with it.
///
/// Knows neither clock nor random numbers; the same calls give the same beliefs.
class CatheterLocaliser {
 public:
  /// Throws InputError when a setting is out of its range.
  CatheterLocaliser(const LocaliserSettings& settings, const VesselTree& tree);
  CatheterLocaliser(CatheterLocaliser&&) noexcept = default;
  CatheterLocaliser& operator=(CatheterLocaliser&&) noexcept = default;

  /// Takes one frame's curve. A curve or pose that says nothing (too short, not finite) only predicts.
  [[nodiscard]] TipBelief update(const SeenCatheter& seen, const SeenPose& pose, const CatheterMotion& motion);

  /// The same, by the evidence of each place; the image's shift is not estimated. Evidence that is empty or not finite,
  /// or is of branches that are not there, only predicts.
  [[nodiscard]] TipBelief update(const TipEvidence& evidence, const CatheterMotion& motion);

  /// A frame without a catheter in it: time passes, the tip moves.
  [[nodiscard]] TipBelief predict(const CatheterMotion& motion);

  /// Forgets all frames: every place is as probable as any other.
  void reset();

  /// The same, with the tip known to be about `arc_m` into a branch. Throws InputError for a branch that is not there,
  /// or an arc length or sigma that cannot be.
  void reset(int branch, double arc_m, double std_m);

  /// The belief as it stands.
  const TipBelief& belief() const { return belief_; }

 private:
  void forget();
  const TipBelief& adopt(const FrameOutcome& outcome, const CatheterMotion& motion, double end_std_m = 0);

  std::shared_ptr<TipFilter> filter_;
  TipBelief belief_;
  bool seen_before_ = false;
};

/// The tip's end in 3D, model frame [m]: the point on the ray through the seen tip that is nearest to the
/// estimated place on the vessel's axis. In a wide vessel a catheter lies at the wall; the image shows its offset from
/// the axis except along the beam. Returns the place on the axis itself when the image does not show which end is the
/// tip.
Eigen::Vector3d tipOnRay(const TipPlace& place, const SeenCatheter& seen, const SeenPose& pose);

}  // namespace angio::localisation
