// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "angio/registration/namespace.hpp"
#include "angio/registration/xray_view.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::registration {

/// What a certificate is asked for: the box of poses that it covers, and what counts as another pose.
struct CertificateSettings {
  double box_rotation_deg = 45;    ///< +- about each axis, as a rotation vector in model axes.
  double box_translation_mm = 60;  ///< +- along each model axis, of the tree's centroid.
  double alternative_share = 0.9;  ///< Of the found pose's score: a different pose that reaches it is an alternative.
  double distance_mm = 5;          ///< Poses further from the found one than this are different; see poseDistance_m.
  double seconds = 30;             ///< After so long it stops without a proof.
  int threads = 0;                 ///< 0: as many as the processor has.
};

/// What is known of all other poses of a box.
struct PoseCertificate {
  bool proven = false;  ///< No different pose of the box reaches `alternative_share` of the found pose's score.
  double score = 0;     ///< Of the found pose, see certifiedScore.
  double bound = 0;     ///< No different pose of the box has a higher score than this times `score`.

  /// A different pose of the box that reaches the share.
  struct Alternative {
    Pose T_camera_model = Pose::Identity();
    double share = 0;       ///< Of the found pose's score; may be above 1.
    double distance_m = 0;  ///< From the found pose.
  };
  std::optional<Alternative> alternative;

  double seconds = 0;
  long cells = 0;            ///< Bounds that were computed.
  std::string reason;        ///< Why it is not proven, in words; empty when it is.
  int unexplained_cost = 1;  ///< In the scores, see certifiedScore.
};

/// Returns how far two poses of a tree are apart as a certificate has it [m]: the root mean square distance of the
/// tree's places under both, without what moves the tree's centroid along its own beam. Depth does not count: one view
/// hardly sees it, and the result's covariance says how far it is open.
double poseDistance_m(const VesselTree& tree, const Pose& a, const Pose& b);

/// Returns the score that a certificate is about, in [0, 1]: of 256 places evenly spaced along the tree, the share that
/// the image explains, less `unexplained_cost` times the share that should be seen and is not explained; 0 when that is
/// negative.
///
/// A place is explained when it projects within 4 px of a point of the image whose vessel runs within 10 deg of its
/// own, on a raster of 2 px and 32 directions. It should be seen when it projects onto the detector and into the
/// collimator's opening, of which a window with sides along the image counts.
///
/// A certificate takes the highest cost of 3, 2 and 1 that leaves the found pose half of the points of its explained
/// places, and otherwise 1. The more a place costs, the further is a pose with much of the tree in view and a part of
/// it explained by chance from a pose that explains what it shows.
double certifiedScore(const VesselTree& tree, const XrayView& view, const Pose& T_camera_model,
                      int unexplained_cost = 1);

/// Called now and then by the calling thread: share of the box that is closed, and the bound so far.
using CertificateProgress = std::function<void(double share_closed, double bound)>;

/// Proves by branch and bound that in a box of poses nothing different from the found pose scores nearly as well, or
/// finds what does.
///
/// @param box_center  T_camera_model of the box's middle.
/// @param found       The pose that is certified; it need not be in the box.
///
/// Every bound is rounded outward: a certificate is about all poses of the box, not about those that were looked at.
/// Throws InputError when a setting is out of its range.
PoseCertificate certify(const VesselTree& tree, const XrayView& view, const Pose& box_center, const Pose& found,
                        const CertificateSettings& settings, const CertificateProgress& progress = {});

}  // namespace angio::registration
