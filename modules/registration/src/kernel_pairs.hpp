// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "angio/geometry/bucket_grid.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/registration/cvo_settings.hpp"
#include "angio/registration/xray_view.hpp"
#include "line_samples.hpp"
#include "rigid_step.hpp"

namespace angio::registration {

/// The kernel of two pieces of a vessel, k = exp(-|u - q|^2 / 2 l^2 + kappa (cos 2 angle - 1)) less kMinKernel, and 0
/// where that would be negative.
///
/// Both factors are positive definite, as the source's kernels of places and of colors are. For small angles the
/// second is exp(-angle^2 / 2 std^2). The source drops pairs below a threshold; taking it off besides leaves a
/// function without a jump, whose gradient is the same.
struct PairKernel {
  /// The source's programs drop pairs below 0.8 of the peak. That leaves 0.6 l of reach, too little to find anything
  /// beyond the scale, and its paper gives no number. This one is 3 l of reach.
  static constexpr double kMinKernel = 0.011;

  PairKernel(double scale_px, double direction_std_rad, CvoObjective objective);

  bool of_distance;  ///< Whether pairs of the model with itself count.
  double scale_px, inverse_2l2, kappa, reach_px;
};

/// Two pieces within reach of each other.
struct KernelPair {
  int i = 0;                       ///< Of the model.
  int j = 0;                       ///< Of the image, or of the model.
  double weight = 0;               ///< The kernel as it was before the threshold was taken off, times both masses.
  Eigen::Vector2d apart_px{0, 0};  ///< Pixel of i less pixel of j.
};

/// One view of the model at one scale. What the source calls features, the directions and masses, is fixed with it.
struct FlowView {
  /// Takes the pieces of the model that the view sees under a pose, and the image's pieces.
  ///
  /// @param match_m  Length of the model that counts as one match [m].
  FlowView(const ModelSamples& model, const XrayView& view, const Pose& T_camera_centered, const PairKernel& kernel,
           double match_m);

  int size() const { return static_cast<int>(points.cols()); }

  const XrayView* view;
  ImageSamples image;
  BucketGrid image_grid;
  Eigen::Matrix3Xd points;     ///< 3 x n, about the centroid [m].
  Eigen::Matrix2Xd direction;  ///< 2 x n, as ImageSamples has it.
  std::vector<int> of_model;   ///< n, which of the model's pieces.
  Eigen::VectorXd length_px;   ///< n, of the projected pieces.
  Eigen::VectorXd matches;     ///< n, lengths in matches.
  /// What brings a product of lengths to the currency of matches [1/px^2]: with it the weights of all pieces, each
  /// summed over an image that shows them, add up to the sum of `matches`.
  double unit = 0;
};

/// Value, gradient and pairs of the alignment of one view at a pose.
struct ViewAlignment {
  Eigen::Matrix2Xd pixel;               ///< 2 x n.
  std::vector<KernelPair> image_pairs;  ///< Model and image.
  std::vector<KernelPair> model_pairs;  ///< Model and model, each once, i < j; of the distance only.
  /// 2 l^2 unit (sum over image pairs - sum over model pairs): l^2 unit (2 <f, g> - <f, f>) but for a constant [px^2].
  double value_px2 = 0;
  Eigen::Matrix2Xd force;  ///< 2 x n: gradient of the value with respect to the pixels [px].

  BucketGrid model_grid;  // Kept for its memory.
};

/// Finds the pairs of a view at a pose. Returns false when a piece is not in front of the source.
bool alignView(const FlowView& view, const Pose& T_camera_centered, const PairKernel& kernel, ViewAlignment& to);

/// Gradient of a view's value with respect to dx, T exp(dx).
Vector6d twistGradient(const FlowView& view, const Pose& T_camera_centered, const ViewAlignment& alignment);

/// Adds the sum of matches J^T J over a view's pieces, J of their pixels with respect to dx: how far a twist moves the
/// picture, squared [px^2].
void addPictureMetric(const FlowView& view, const Pose& T_camera_centered, Matrix6d& metric);

/// Where the image pulls each of the model's pieces and how strongly, all its pairs taken together, for
/// normalEquations(); the squares are those of the distances to the nearest piece of the image.
Pull pullOf(const FlowView& view, int model_size, const ViewAlignment& alignment);

/// Taylor coefficients, of t to t^4, of a view's value along T exp(t xi), for the pairs there are at t = 0.
///
/// Source: the step of Ghaffari et al. 2019, from an expansion of the kernel to the fourth order. There the points move
/// by isometries; here the series of a pixel is that of the moved point, divided by that of its depth.
std::array<double, 4> taylorAlong(const FlowView& view, const Pose& T_camera_centered, const Twist& xi,
                                  const PairKernel& kernel, const ViewAlignment& alignment);

}  // namespace angio::registration
