// SPDX-License-Identifier: GPL-2.0-or-later
#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "angio/base/errors.hpp"
#include "angio/calibration/pose_set.hpp"

namespace angio::calibration {
namespace {

constexpr double kMinNoise_px = 1e-6;
constexpr double kWorstFit = 0.05;  // Of the object's size in the image.
constexpr int kSteps = 20;

Pose startOf(const XrayCamera& camera, const Eigen::Matrix3Xd& object, const Eigen::Matrix2Xd& seen) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (Eigen::Index i = 0; i < object.cols(); ++i) {
    points.emplace_back(object(0, i), object(1, i), object(2, i));
    pixels.emplace_back(seen(0, i), seen(1, i));
  }
  const auto& p = camera.parameters();
  const cv::Matx33d K(p.fx_px, 0, p.cx_px, 0, p.fy_px, p.cy_px, 0, 0, 1);
  cv::Vec3d rvec, tvec;
  cv::solvePnP(points, pixels, K, cv::noArray(), rvec, tvec, false, cv::SOLVEPNP_SQPNP);
  Pose T = Pose::Identity();
  T.linear() = expSO3(Eigen::Vector3d(rvec[0], rvec[1], rvec[2]));
  T.translation() = Eigen::Vector3d(tvec[0], tvec[1], tvec[2]);
  return T;
}

// Normal equations of [dt; dw] with T = (t + dt, exp(dw) R).
struct Normal {
  Matrix6d A = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
  double squares = 0;
  bool in_front = true;
};

Normal normalAt(const XrayCamera& camera, const Eigen::Matrix3Xd& object, const Eigen::Matrix2Xd& seen, const Pose& T) {
  Normal n;
  for (Eigen::Index i = 0; i < object.cols(); ++i) {
    const Eigen::Vector3d turned = T.linear() * object.col(i);
    Eigen::Matrix<double, 2, 3> Jp;
    const auto pixel = camera.project(turned + T.translation(), &Jp);
    if (!pixel) {
      n.in_front = false;
      return n;
    }
    Eigen::Matrix<double, 2, 6> J;
    J << Jp, -Jp * skew(turned);
    const Eigen::Vector2d r = seen.col(i) - *pixel;
    n.A += J.transpose() * J;
    n.b += J.transpose() * r;
    n.squares += r.squaredNorm();
  }
  return n;
}

// Root mean square from the mean.
double spread(const Eigen::Ref<const Eigen::MatrixXd>& points) {
  return std::sqrt((points.colwise() - points.rowwise().mean()).squaredNorm() / static_cast<double>(points.cols()));
}

}  // namespace

PoseOfPoints poseOfPoints(const std::string& place, const XrayCamera& camera, const Eigen::Matrix3Xd& points_object_m,
                          const Eigen::Matrix2Xd& points_px) {
  const Eigen::Index count = points_object_m.cols();
  if (count < 4 || points_px.cols() != count) {
    throw InputError(place, "points", std::to_string(count), "must be at least 4, each with its pixel");
  }
  const Eigen::Matrix3Xd centered = points_object_m.colwise() - points_object_m.rowwise().mean();
  const Eigen::Vector3d extent = Eigen::JacobiSVD<Eigen::MatrixXd>(centered).singularValues().head<3>();
  if (!(extent[1] > 1e-3 * extent[0])) throw InputError(place, "points", "", "must not lie in a line");
  PoseOfPoints found{Pose::Identity(), Matrix6d::Zero(), 0};
  try {
    found.T_camera_object = startOf(camera, points_object_m, points_px);
  } catch (const cv::Exception&) {
    throw InputError(place, "points", "", "no pose of the object explains them");
  }
  Normal n = normalAt(camera, points_object_m, points_px, found.T_camera_object);
  for (int step = 0; step < kSteps && n.in_front; ++step) {
    const Vector6d d = n.A.ldlt().solve(n.b);
    Pose next = found.T_camera_object;
    next.translation() += d.head<3>();
    next.linear() = expSO3(d.tail<3>()) * next.linear();
    const Normal there = normalAt(camera, points_object_m, points_px, next);
    if (!there.in_front || !(there.squares < n.squares)) break;
    found.T_camera_object = next;
    n = there;
  }
  found.rms_px = std::sqrt(n.squares / static_cast<double>(count));
  if (!n.in_front || !(found.rms_px <= kWorstFit * spread(points_px))) {
    throw InputError(place, "points", n.in_front ? formatValue(found.rms_px) + " px from their projection" : "",
                     "no pose of the object explains them: are they in order, and not mirrored?");
  }
  const double freedom = std::max(1.0, static_cast<double>(2 * count - 6));
  const double variance = std::max(n.squares / freedom, kMinNoise_px * kMinNoise_px);
  found.covariance = variance * n.A.ldlt().solve(Matrix6d::Identity());
  return found;
}

}  // namespace angio::calibration
