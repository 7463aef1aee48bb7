// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "angio/geometry/se3.hpp"
#include "angio/perception/namespace.hpp"
#include "angio/registration/result.hpp"
#include "angio/types/registration_points.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::perception {

/// Returns the standard deviation in the worst direction [m], of a covariance [m^2].
double worstStd_m(const Eigen::Matrix3d& covariance_m2);

/// Returns the matrix that takes an error of a point p [m, camera axes] to the one across its ray: d(x - z p.x / p.z),
/// and the same of y.
Eigen::Matrix<double, 2, 3> acrossRay(const Eigen::Vector3d& p_camera);

/// Returns the covariance of a pose by that of a point p and of a rotation about it, all camera axes, as
/// PatientObservation has it: dt = dp + (R p)^ dw.
///
/// @param Rp  The point in camera axes, from the model's origin [m].
Matrix6d covarianceAbout(const Eigen::Vector3d& Rp, const Eigen::Matrix3d& point_m2,
                         const Eigen::Matrix3d& rotation_rad2);

/// Where points of the model are in a frame, where that is known better than by the pose alone.
class PointPlaces {
 public:
  virtual ~PointPlaces() = default;
  /// Returns the place of a point of the tree as it was given, model frame [m]: camera axes [m].
  virtual Eigen::Vector3d placeAt(const Eigen::Vector3d& p_model) const = 0;
};

/// Returns what a registration says of each point of the tree, for a bus; nothing when it knows no covariance.
std::optional<RegistrationPoints> registrationPoints(const RegistrationResult& seen, const VesselTree& tree,
                                                     ModelId model_id, std::int64_t frame_time_us,
                                                     std::int64_t frame_sequence);

/// Where one trusted frame shows the model: a pose, its covariance, and what is known of single points.
struct PatientObservation {
  Pose T_camera_model = Pose::Identity();
  Matrix6d covariance =
      Matrix6d::Zero();  ///< As RegistrationResult has it: (translation, rotation), camera axes [m, rad].
  std::shared_ptr<const PointUncertainty> points =
      {};  ///< As RegistrationResult has it; null: the covariance says all.

  std::shared_ptr<const PointPlaces> places = {};  ///< Null: the pose says all.

  /// Returns what a registration says that has a covariance.
  static PatientObservation of(const RegistrationResult& seen) {
    return {seen.T_camera_model, *seen.covariance, seen.points};
  }

  /// Returns where a model point is, camera axes [m].
  Eigen::Vector3d placeAt(const Eigen::Vector3d& p_model) const {
    return places ? places->placeAt(p_model) : T_camera_model * p_model;
  }

  /// Returns the pose, moved so that a model point is there.
  Pose poseAt(const Eigen::Vector3d& p_model) const {
    Pose T = T_camera_model;
    return T.pretranslate(placeAt(p_model) - T * p_model);
  }

  /// Returns the covariance of a model point [m^2]: that of `points`, and without them J S J^T, where
  /// dp = dt - (R p)^ dw.
  ///
  /// @param R_axes_camera  The axes in which it is wanted, from the camera's; the camera's own by default.
  Eigen::Matrix3d pointCovariance(const Eigen::Vector3d& p_model,
                                  const Eigen::Matrix3d& R_axes_camera = Eigen::Matrix3d::Identity()) const;

  /// Returns the covariance, camera axes, whose 90 % intervals are the point's [m^2]: see PointUncertainty.
  Eigen::Matrix3d centralCovariance(const Eigen::Vector3d& p_model) const {
    return points ? points->centralCovarianceAt(p_model) : pointCovariance(p_model);
  }

  /// Returns the standard deviation of a model point along the camera's optical axis [m].
  double depthStd_m(const Eigen::Vector3d& p_model) const;

  /// Returns the standard deviation of a model point in its worst direction [m].
  double worstStd_m(const Eigen::Vector3d& p_model) const;

  /// Returns the same across the ray to the point [m]: in the image, at the point's depth.
  double worstStdAcross_m(const Eigen::Vector3d& p_model) const;
};

}  // namespace angio::perception
