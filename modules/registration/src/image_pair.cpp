// SPDX-License-Identifier: GPL-2.0-or-later
#include "image_pair.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/vessel/plausible_radii.hpp"
#include "drawn_tubes.hpp"
#include "image_gradient.hpp"

namespace angio::registration {
namespace {

// Of the window: so much more than the tree's own size, so that a tree which is off by a tenth of it is in the window.
constexpr double kPairMargin = 1.3;
constexpr int kMinPairSide_px = 32, kMinPairPoints = 10;
// A vessel is drawn at least so wide [px of the window's camera].
constexpr double kMinDrawn_px = 0.6;
constexpr double kMostDeviations = 4;

// Zero where the view is closed, unit variance where it is open, outliers cut.
void normalizePicture(cv::Mat& picture, const cv::Mat& open) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(picture, mean, deviation, open);
  picture = (picture - mean) / std::max(1e-12, deviation[0]);
  cv::min(cv::max(picture, -kMostDeviations), kMostDeviations, picture);
  picture.setTo(0, open == 0);
}

// Where the window lies on the detector and inside the collimator, 255.
cv::Mat openPart(const XrayView& view, const cv::Rect& rect) {
  const double scale = static_cast<double>(kPairSide_px) / rect.width;
  cv::Mat open(kPairSide_px, kPairSide_px, CV_8U, cv::Scalar(0));
  for (int y = 0; y < kPairSide_px; ++y) {
    for (int x = 0; x < kPairSide_px; ++x) {
      const Eigen::Vector2d at = Eigen::Vector2d(x + 0.5, y + 0.5) / scale + Eigen::Vector2d(rect.x, rect.y);
      if (view.sees(at - Eigen::Vector2d(0.5, 0.5))) open.at<uchar>(y, x) = 255;
    }
  }
  return open;
}

// Axes whose z is the ray to the centroid.
Eigen::Matrix3d alongRay(const Pose& T_centered) {
  return Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), T_centered.translation()).toRotationMatrix();
}

}  // namespace

std::optional<PairWindow> PairWindow::about(const Eigen::Matrix3Xd& points_centered, const XrayView& view,
                                            const Pose& T_view_centered) {
  if (!T_view_centered.matrix().allFinite() || !(T_view_centered.translation().z() > 0)) return std::nullopt;
  Eigen::AlignedBox2d box;
  int seen = 0;
  for (Eigen::Index i = 0; i < points_centered.cols(); ++i) {
    const auto pixel = view.camera.project(T_view_centered * points_centered.col(i));
    if (!pixel || !view.sees(*pixel)) continue;
    box.extend(*pixel);
    ++seen;
  }
  if (seen < kMinPairPoints) return std::nullopt;
  const int side_px = std::max(kMinPairSide_px, static_cast<int>(std::lround(kPairMargin * box.sizes().maxCoeff())));
  const Eigen::Vector2d corner = box.center() - Eigen::Vector2d::Constant(0.5 * side_px);
  const cv::Rect rect(cvRound(corner.x()), cvRound(corner.y()), side_px, side_px);

  const double scale = static_cast<double>(kPairSide_px) / side_px;
  XrayCamera::Parameters p = view.camera.parameters();
  p.width_px = p.height_px = kPairSide_px;
  p.fx_px *= scale;
  p.fy_px *= scale;
  p.cx_px = (p.cx_px - rect.x + 0.5) * scale - 0.5;
  p.cy_px = (p.cy_px - rect.y + 0.5) * scale - 0.5;
  p.pixel_spacing_m.reset();
  return PairWindow{rect, XrayCamera(p)};
}

PairDrawing::PairDrawing(const VesselTree& tree, double end_radius_m)
    : points_centered_(tree.points().colwise() - tree.centroid()),
      tubes_(TubeTree(withPlausibleRadii(tree, end_radius_m)).tubes(points_centered_, {})),
      radius_m_(std::sqrt(points_centered_.colwise().squaredNorm().mean())) {}

ImagePair PairDrawing::pair(const cv::Mat& attenuation, const XrayView& view, const PairWindow& window,
                            const Pose& T_view_centered) {
  const cv::Size size(kPairSide_px, kPairSide_px);
  const cv::Mat open = openPart(view, window.rect);
  ImagePair pair;

  const cv::Rect inside = window.rect & cv::Rect({0, 0}, attenuation.size());
  cv::Mat part(window.rect.size(), CV_32F, cv::Scalar(0));
  if (!inside.empty()) attenuation(inside).copyTo(part(inside - window.rect.tl()));
  cv::resize(part, pair.seen, size, 0, 0, part.cols > size.width ? cv::INTER_AREA : cv::INTER_LINEAR);
  normalizePicture(pair.seen, open);

  const double depth_m = T_view_centered.translation().z();
  std::vector<Tube> tubes = withMinRadius(tubes_, kMinDrawn_px * depth_m / window.camera.parameters().fx_px);
  const cv::Mat lengths = lengths_.compute(tubes, window.camera, T_view_centered);
  cv::Mat wide;
  cv::GaussianBlur(lengths, wide, {}, kAnatomy_px * kPairSide_px / window.rect.width);
  pair.drawn = lengths - wide;
  cv::Scalar mean, deviation;
  cv::meanStdDev(pair.drawn, mean, deviation, open);
  normalizePicture(pair.drawn, open);

  for (Tube& tube : tubes) {
    const Eigen::Vector3d middle = T_view_centered.linear() * (0.5 * (tube.a + tube.b));
    tube.density *= middle.z() / radius_m_;
  }
  pair.depth = lengths_.compute(tubes, window.camera, T_view_centered) / std::max(1e-12, deviation[0]);
  cv::min(cv::max(pair.depth, -kMostDeviations), kMostDeviations, pair.depth);
  pair.depth.setTo(0, open == 0);
  return pair;
}

PairMotion pairMotion(const PairWindow& window, const Pose& T_from, const Pose& T_to) {
  constexpr double kHalf_px = 0.5 * kPairSide_px;
  const auto from = window.camera.project(T_from.translation()), to = window.camera.project(T_to.translation());
  PairMotion motion = PairMotion::Zero();
  if (!from || !to) return motion;
  const Eigen::Matrix3d R_camera_ray = alongRay(T_from);
  motion.head<2>() = *to - *from;
  motion[2] = kHalf_px * std::log(T_to.translation().z() / T_from.translation().z());
  motion.tail<3>() = kHalf_px * R_camera_ray.transpose() * logSO3(T_to.linear() * T_from.linear().transpose());
  return motion;
}

Pose movedInPair(const PairWindow& window, const Pose& T_from, const PairMotion& motion) {
  constexpr double kHalf_px = 0.5 * kPairSide_px;
  Pose T = T_from;
  const auto from = window.camera.project(T_from.translation());
  if (!from) return T;
  const double z_m = T_from.translation().z() * std::exp(motion[2] / kHalf_px);
  T.translation() = z_m * window.camera.ray(*from + motion.head<2>());
  T.linear() = nearestRotation(expSO3(alongRay(T_from) * motion.tail<3>() / kHalf_px) * T_from.linear());
  return T;
}

}  // namespace angio::registration
