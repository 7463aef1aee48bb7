// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/registration/namespace.hpp"
#include "angio/registration/xray_view.hpp"
#include "angio/tubes/tubes.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::registration {

/// Side of the pictures that are compared [px].
constexpr int kPairSide_px = 96;

/// The square part of a view in which a tree is seen, as a small camera of its own.
struct PairWindow {
  cv::Rect rect;      ///< In the view's pixels; it may reach over the detector's edge.
  XrayCamera camera;  ///< kPairSide_px wide and high.

  /// About the points that the view sees; nothing where there are too few of them to compare.
  /// @param points_centered  The tree's, about its centroid, 3 x N [m].
  static std::optional<PairWindow> about(const Eigen::Matrix3Xd& points_centered, const XrayView& view,
                                         const Pose& T_view_centered);
};

/// What a tree looks like in a view and what the tree would give there: CV_32FC1, kPairSide_px wide and high, of unit
/// variance where the view is open and zero where it is not.
struct ImagePair {
  cv::Mat seen;   ///< The image's attenuation, less what is wider than vessels.
  cv::Mat drawn;  ///< The tree's, in the same way.
  cv::Mat depth;  ///< The tree's once more, weighed by how far it is behind its centroid, in radii of gyration.
};

/// Draws a tree beside what is seen. Keeps its buffers.
class PairDrawing {
 public:
  /// Radii that the tree does not know are filled in by withPlausibleRadii.
  PairDrawing(const VesselTree& tree, double end_radius_m);

  const Eigen::Matrix3Xd& pointsCentered() const { return points_centered_; }  ///< About the centroid, 3 x N [m].

  /// @param attenuation  Of the view's image, by vesselAttenuation().
  ImagePair pair(const cv::Mat& attenuation, const XrayView& view, const PairWindow& window,
                 const Pose& T_view_centered);

 private:
  Eigen::Matrix3Xd points_centered_;
  std::vector<Tube> tubes_;
  double radius_m_;
  PathLengths lengths_;
};

/// A small motion of a tree, by what it does to the window's picture. All six are pixels: the centroid's shift (0, 1);
/// how far growth moves the picture's edge, positive when the tree goes away from the source (2); how far turns about
/// the axes x, y, z of the centroid's ray move what stands half a picture's side from the centroid (3 to 5).
using PairMotion = Vector6d;

/// The motion from a pose of the centred tree to another one.
PairMotion pairMotion(const PairWindow& window, const Pose& T_from, const Pose& T_to);

/// The pose that the motion leads to: pairMotion's inverse.
Pose movedInPair(const PairWindow& window, const Pose& T_from, const PairMotion& motion);

}  // namespace angio::registration
