// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>

#include "angio/base/settings.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/localisation/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::localisation {

/// Which end of a seen curve is the catheter's tip.
enum class TipEnd { kLast, kUnknown };

/// A catheter in one X-ray frame: one curve, in order.
struct SeenCatheter {
  Eigen::Matrix2Xd points_px;  ///< 2 x N, from where it comes in to its tip [px].
  double std_px = 1;           ///< Of a point, across the curve [px].
  TipEnd tip_end = TipEnd::kLast;
};

/// How pieces of a device become one curve.
struct SeenCatheterSettings {
  static constexpr double max_gap_px = 60;    ///< Ends of pieces further apart are not joined.
  static constexpr double max_turn_deg = 60;  ///< A gap is crossed about straight on.
  static constexpr double min_piece_px = 15;  ///< Shorter pieces are noise unless a gap's other side needs them.
  static constexpr double min_curve_px = 40;  ///< A shorter catheter says nothing.
  double border_px = 25;
  double std_px = 1;

  void visit(SettingsVisitor& v) {
    v.number("border_px", border_px, 0, 1000,
             "A catheter's end this near to the detector's border leaves the image there");
    v.number("std_px", std_px, 0.01, 100, "Standard deviation of points whose extractor does not say one");
  }
};

/// What is known of the catheter from the frame before.
struct CatheterHint {
  Eigen::Vector2d tip_px = Eigen::Vector2d::Zero();  ///< Where its tip was or must be [px].
};

/// The catheter among what an extractor has seen: the points of CurveKind::kDevice, whose pieces are joined end to end
/// where they go on about straight, the longest curve taken. Its tip is the end that does not leave the image, or the
/// one nearer to the hint; with neither to tell, TipEnd::kUnknown. Nothing comes back without a device of some length.
/// Throws InputError when a setting is out of its range.
std::optional<SeenCatheter> seenCatheter(const Centerline2d& seen, const XrayCamera& camera,
                                         const SeenCatheterSettings& settings = {},
                                         const std::optional<CatheterHint>& hint = std::nullopt);

}  // namespace angio::localisation
