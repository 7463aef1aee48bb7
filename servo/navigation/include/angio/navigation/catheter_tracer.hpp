// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "angio/base/settings.hpp"
#include "angio/localisation/catheter_localiser.hpp"
#include "angio/navigation/namespace.hpp"

namespace angio::navigation {

/// What the tracer knows of the catheter, and how far it looks.
struct CatheterTracerSettings {
  double diameter_mm = 0.7;
  double marker_length_mm = 1.5;
  double behind_mm = 80;  ///< How far behind the believed tip the trace begins.
  double ahead_mm = 30;
  static constexpr double slack_mm = 0.8;      ///< The image may show vessels beside where the pose has them.
  static constexpr double along_std_mm = 0.6;  ///< Of a tip beside the cross-section that its place stands for.
  static constexpr double marker_ratio = 2;    ///< The band is more than so many times as dark as the catheter.

  void visit(SettingsVisitor& v) {
    v.number("diameter_mm", diameter_mm, 0.1, 5, "Diameter of the catheter");
    v.number("marker_length_mm", marker_length_mm, 0.1, 20, "Length of the radio-opaque band at the catheter's tip");
    v.number("ahead_mm", ahead_mm, 5, 200, "How far ahead of the believed tip, along any vessel, a tip is looked for");
    v.fixed("behind_mm", behind_mm, 20, 500);
  }
};

/// How far a tip's end stands beside its vessel's axis, in the vessel's frame: normal, binormal [m].
struct TipOffset {
  Eigen::Vector2d mean_m = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity() * 1e-6;
  double free_m = 0;  ///< How far the tip's bend deflects it where no wall holds it; 0 where that is not known.
};

/// Returns what is known of an offset whose length is known too, as `length_m` [m] with a standard deviation of a sixth
/// of it: mean and covariance of the product of both densities, by sums over directions and lengths. A seen side of the
/// offset then tells how far it stands along the beam, up to the side. Returns `offset` where `length_m` is 0 or less,
/// and where both contradict each other.
TipOffset ofLength(const TipOffset& offset, double length_m);

/// A catheter found in a frame.
struct CatheterTrace {
  SeenCatheter seen;        ///< From behind the believed tip to the tip's end.
  TipEvidence evidence;     ///< Of the places where its tip may be.
  double marker = 0;        ///< Contrast of the tip's band over the catheter's.
  double unseen_share = 0;  ///< Part of the trace with less than half of the catheter's contrast.
};

/// Traces a catheter in frames without contrast agent: the dark line along one of the projected vessels that ends at
/// its radio-opaque tip.
///
/// Every path through the tree near the believed tip is followed at once: a place of a vessel and a displacement of the
/// image there (the catheter rests against walls and cuts bends) score by the darkness of the line up to there, by
/// its smoothness, and by the band at its end (Viterbi's algorithm over the tree). The best end wins, so that a gap or
/// a crossing does not end the trace and a branch without a line in it is not entered.
class CatheterTracer {
 public:
  /// Throws InputError when a setting is out of its range.
  CatheterTracer(const VesselTree& tree, const CatheterTracerSettings& settings);
  ~CatheterTracer();

  /// Nothing comes back when no end has the band, or no part of the tree near `expected` is in the image. Throws
  /// InputError for an image that is neither CV_8UC1 nor CV_16UC1.
  std::optional<CatheterTrace> trace(const cv::Mat& image, const SeenPose& pose, const TipBelief& expected,
                                     const TipOffset& offset = {});

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace angio::navigation
