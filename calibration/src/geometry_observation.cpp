// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry_problem.hpp"

#include <algorithm>
#include <map>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/joined.hpp"
#include "angio/calibration/direct_linear.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/results/statistics.hpp"
#include "least_squares.hpp"

namespace angio::calibration {
namespace {

constexpr int kMinBeads = 8;
constexpr double kMinStd_px = 0.02;  // Beads are never seen better than that: rounding is no outlier.
constexpr double kMaxMedian_px = 5;  // A pose that explains beads no better explains nothing.

struct Sightings {
  Eigen::Matrix3Xd points_m;
  Eigen::Matrix2Xd pixels_px;
};

Sightings sightingsOf(const std::string& place, const BeadPhantom& phantom, const BeadView& view) {
  const auto count = static_cast<Eigen::Index>(view.beads.size());
  if (count < kMinBeads) {
    throw InputError(place, view.name, std::to_string(count) + " beads",
                     "there must be at least " + std::to_string(kMinBeads));
  }
  Sightings s{Eigen::Matrix3Xd(3, count), Eigen::Matrix2Xd(2, count)};
  for (Eigen::Index i = 0; i < count; ++i) {
    const SeenBead& bead = view.beads[i];
    if (bead.bead < 0 || bead.bead >= static_cast<int>(phantom.beads.size())) {
      throw InputError(place, view.name + ".id", std::to_string(bead.bead),
                       "must be a bead of the phantom, 0 to " + std::to_string(phantom.beads.size() - 1));
    }
    s.points_m.col(i) = phantom.beads[bead.bead].position_m;
    s.pixels_px.col(i) = bead.center_px;
  }
  return s;
}

// Without a start. The linear solution takes any K; its depth is then corrected to the one that is known.
Pose startOfView(const std::string& place, const BeadView& view, const XrayCamera& camera, const Sightings& s) {
  const auto agreed = agreedProjection(s.points_m, s.pixels_px, 0.01 * camera.width_px(), false);
  if (!agreed) throw InputError(place, view.name, "", "no camera sees the phantom's beads like this");
  const ProjectionParts parts = decomposed(agreed->P);
  if (parts.mirrored) {
    throw InputError(place, view.name, "",
                     "beads are seen mirrored against the phantom: the phantom's file or the "
                     "image is mirrored");
  }
  const double focal_px = std::sqrt(camera.parameters().fx_px * camera.parameters().fy_px);
  Pose T = parts.T_camera_model;
  const Eigen::Vector3d center_m = s.points_m.rowwise().mean();
  const Eigen::Vector2d middle_px = s.pixels_px.rowwise().mean();
  const double depth_m = (T * center_m).z() * focal_px / std::sqrt(parts.K(0, 0) * parts.K(1, 1));
  T.translation() = depth_m * camera.ray(middle_px) - T.linear() * center_m;
  return T;
}

// Residuals [px] of all beads and their derivatives by a view's changes.
struct Linearised {
  Eigen::VectorXd residual_px;
  Eigen::Matrix<double, Eigen::Dynamic, kViewChanges> J;
};

Linearised linearised(const Sightings& s, const XrayCamera& camera, const Pose& T) {
  const Eigen::Index count = s.points_m.cols();
  Linearised l{Eigen::VectorXd(2 * count),
               Eigen::Matrix<double, Eigen::Dynamic, kViewChanges>(2 * count, kViewChanges)};
  for (Eigen::Index i = 0; i < count; ++i) {
    // A start may be so wrong that a bead lies behind the source: kept in front of it, where it is far off anyhow.
    Eigen::Vector3d p = T * s.points_m.col(i);
    p.z() = std::max(p.z(), 1e-3);
    Eigen::Matrix<double, 2, 3> by_point;
    l.residual_px.segment<2>(2 * i) = *camera.project(p, &by_point) - s.pixels_px.col(i);
    auto J = l.J.middleRows<2>(2 * i);
    J.leftCols<3>() = by_point;
    J.middleCols<3>(3) = -by_point * skew(p);
    J.rightCols<4>() << p.x() / p.z(), 0, 1, 0, 0, p.y() / p.z(), 0, 1;
  }
  return l;
}

double sigmaOf(const Eigen::VectorXd& residual_px) {
  std::vector<double> sizes(residual_px.size());
  for (Eigen::Index i = 0; i < residual_px.size(); ++i) sizes[i] = std::abs(residual_px[i]);
  // The median of |x| of a normal distribution is 0.6745 of its standard deviation.
  return std::max(percentile(sizes, 0.5) / 0.6745, kMinStd_px);
}

// Gauss-Newton with Cauchy's weights, whose width follows the median.
Pose bestPose(const Sightings& s, const XrayCamera& camera, Pose T, double outlier_std) {
  for (int step = 0; step < 40; ++step) {
    const Linearised l = linearised(s, camera, T);
    const double width_px = outlier_std * sigmaOf(l.residual_px) / 2;
    Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
    Vector6d g = Vector6d::Zero();
    for (Eigen::Index i = 0; i < s.points_m.cols(); ++i) {
      const auto r = l.residual_px.segment<2>(2 * i);
      const auto J = l.J.block<2, 6>(2 * i, 0);
      const double weight = 1 / (1 + r.squaredNorm() / (width_px * width_px));
      H += weight * J.transpose() * J;
      g += weight * J.transpose() * r;
    }
    const Twist change = -solveSymmetric(H, g);
    T = expSE3(change) * T;
    T.linear() = nearestRotation(T.linear());
    if (change.head<3>().norm() < 1e-11 && change.tail<3>().norm() < 1e-11) break;
  }
  return T;
}

constexpr double kExact_m = 1e-6, kExact_rad = 1e-6;

// Of a place [m] and a turn about the object's origin [rad], camera axes.
Matrix6d placeCovariance(const HandEyePose& pose, const std::optional<PoseSigma>& usual) {
  if (pose.covariance) return *pose.covariance;
  const double translation_m = std::max(usual ? usual->translation_m : 0, kExact_m),
               rotation_rad = std::max(usual ? usual->rotation_rad : 0, kExact_rad);
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(translation_m * translation_m),
      Eigen::Vector3d::Constant(rotation_rad * rotation_rad);
  return variances.asDiagonal();
}

}  // namespace

ViewObservation observeView(const std::string& place, const BeadPhantom& phantom, const XrayCamera& camera,
                            const BeadView& view, double outlier_std) {
  const Sightings all = sightingsOf(place, phantom, view);
  ViewObservation seen;
  seen.name = view.name;
  seen.joints = view.joints;
  seen.source_detector_distance_m = view.source_detector_distance_m.value();
  seen.held_out = view.held_out;
  const auto& K = camera.parameters();
  seen.camera_px << K.fx_px, K.fy_px, K.cx_px, K.cy_px;
  seen.T_camera_phantom = bestPose(all, camera, startOfView(place, view, camera, all), outlier_std);
  const Linearised first = linearised(all, camera, seen.T_camera_phantom);
  const double std_px = sigmaOf(first.residual_px);
  if (!(0.6745 * std_px < kMaxMedian_px)) {
    throw InputError(place, view.name, formatted("%.3g px", 0.6745 * std_px),
                     "no pose of the phantom explains its beads better than that in the median; labels, the phantom's "
                     "units and the camera must be this view's");
  }
  Sightings used;
  std::vector<Eigen::Index> near;
  for (Eigen::Index i = 0; i < all.points_m.cols(); ++i) {
    if (first.residual_px.segment<2>(2 * i).norm() < outlier_std * std_px) {
      near.push_back(i);
    } else {
      seen.far_beads.push_back(view.beads[i].bead);
    }
  }
  if (near.size() < kMinBeads) {
    throw InputError(place, view.name, std::to_string(near.size()) + " beads agree with each other",
                     "there must be at least " + std::to_string(kMinBeads));
  }
  used.points_m = all.points_m(Eigen::all, near);
  used.pixels_px = all.pixels_px(Eigen::all, near);
  // All alike now: Cauchy's weights fade.
  seen.T_camera_phantom = bestPose(used, camera, seen.T_camera_phantom, 1e6);
  seen.beads = static_cast<int>(near.size());

  const Linearised l = linearised(used, camera, seen.T_camera_phantom);
  Eigen::MatrixXd system(l.J.rows(), kViewChanges + 1);
  system << l.J, l.residual_px;
  const Eigen::MatrixXd R = triangularFactor(system);
  seen.upper = R.topLeftCorner<kViewChanges, kViewChanges>();
  seen.offset = R.topRightCorner<kViewChanges, 1>();
  seen.unexplained_px2 = R(kViewChanges, kViewChanges) * R(kViewChanges, kViewChanges);
  return seen;
}

void requireSoundBeads(const std::string& place, const BeadPhantom& phantom, const std::vector<BeadView>& views,
                       const std::vector<ViewObservation>& seen) {
  std::map<int, int> shown_in, far_in;
  for (const BeadView& view : views) {
    for (const SeenBead& bead : view.beads) ++shown_in[bead.bead];
  }
  for (const ViewObservation& view : seen) {
    for (const int bead : view.far_beads) ++far_in[bead];
  }
  std::vector<std::string> named;
  for (const auto& [bead, far] : far_in) {
    if (far >= 3 && 2 * far >= shown_in[bead]) named.push_back(std::to_string(bead));
  }
  if (named.empty()) return;
  throw InputError(place, "beads", joined(named, 6),
                   formatted("%d of %d beads lie elsewhere than %s has them in half of their views or more: labels are "
                             "swapped, or it is another phantom",
                             static_cast<int>(named.size()), static_cast<int>(phantom.beads.size()),
                             phantom.name.empty() ? "the phantom's file" : phantom.name.c_str()));
}

ViewObservation observePose(const HandEyePose& pose, const std::optional<PoseSigma>& usual) {
  ViewObservation seen;
  seen.name = pose.name;
  seen.joints = pose.joints.value();
  seen.T_camera_phantom = pose.T_camera_object;
  // A twist turns about the camera: exp(v, w) T has its origin at t + v + w x t, so that v = dt + t x w.
  Matrix6d twist_by_place = Matrix6d::Identity();
  twist_by_place.topRightCorner<3, 3>() = skew(pose.T_camera_object.translation());
  const Matrix6d covariance = twist_by_place * placeCovariance(pose, usual) * twist_by_place.transpose();
  seen.upper.topLeftCorner<6, 6>() = lowerFactorOf(inverseOf(covariance)).transpose();
  return seen;
}

}  // namespace angio::calibration
