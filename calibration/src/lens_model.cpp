// SPDX-License-Identifier: GPL-2.0-or-later
#include "lens_model.hpp"

#include "angio/geometry/distortion.hpp"

namespace angio::calibration {

Eigen::Vector2d LensModel::seen(const LensNumbers& lens, double distance_m, const Eigen::Vector3d& p_camera,
                                Eigen::Matrix<double, 2, 3>* J_point,
                                Eigen::Matrix<double, 2, kLensNumbers>* J_lens) const {
  const double step_m = distance_m - reference_distance_m, length_m = reference_distance_m + lens[kOffset];
  const double stretch = 1 + step_m / length_m, inv_z = 1 / p_camera.z();
  const Eigen::Vector2d f = stretch * lens.segment<2>(kFx);
  const Eigen::Vector2d c = lens.segment<2>(kCx) + step_m * lens.segment<2>(kSlopeX);
  const Eigen::Vector2d tangent = p_camera.head<2>() * inv_z;
  const RadialBend bend{lens[kK1], lens[kK2], lens[kS1], lens[kS2]};
  const bool tube = kind == LensKind::kIntensifier;

  // An intensifier bends what a pinhole would show, about its middle; a lens the ray, before K.
  const Eigen::Vector2d pinhole_px = f.cwiseProduct(tangent) + c;
  const Eigen::Vector2d point = tube ? Eigen::Vector2d((pinhole_px - middle_px) / half_width_px) : tangent;
  Eigen::Matrix2d J_bent = Eigen::Matrix2d::Identity();
  Eigen::Matrix<double, 2, 4> J_bend = Eigen::Matrix<double, 2, 4>::Zero();
  const bool derive = J_point || J_lens;
  const Eigen::Vector2d q =
      kind == LensKind::kNone ? point : bend.bent(point, derive ? &J_bent : nullptr, J_lens ? &J_bend : nullptr);
  Eigen::Matrix2d A;
  if (tube) {
    A = half_width_px * Eigen::Matrix2d::Identity();
  } else {
    A << f.x(), lens[kSkew], 0, f.y();
  }
  if (derive) {
    const Eigen::Matrix2d J_tangent = tube ? Eigen::Matrix2d(J_bent * f.asDiagonal()) : Eigen::Matrix2d(A * J_bent);
    if (J_point) {
      J_point->leftCols<2>() = J_tangent * inv_z;
      J_point->col(2) = -J_tangent * tangent * inv_z;
    }
    if (J_lens) {
      J_lens->setZero();
      J_lens->middleCols<4>(kK1) = A * J_bend;
      // By f and c as they are at this distance, then by what makes them so.
      const Eigen::Matrix2d by_f =
          tube ? Eigen::Matrix2d(J_bent * tangent.asDiagonal()) : Eigen::Matrix2d(q.asDiagonal());
      const Eigen::Matrix2d by_c = tube ? J_bent : Eigen::Matrix2d::Identity();
      J_lens->middleCols<2>(kFx) = stretch * by_f;
      J_lens->middleCols<2>(kCx) = by_c;
      if (!tube) J_lens->col(kSkew) = Eigen::Vector2d(q.y(), 0);
      J_lens->col(kOffset) = by_f * lens.segment<2>(kFx) * (-step_m / (length_m * length_m));
      J_lens->middleCols<2>(kSlopeX) = step_m * by_c;
    }
  }
  return tube ? Eigen::Vector2d(middle_px + A * q) : Eigen::Vector2d(c + A * q);
}

LensParameters freeParameters(const CameraCalibrationSettings& settings, bool several_distances) {
  LensParameters parameters;
  parameters.map.resize(kLensNumbers, 0);
  const auto add = [&](const char* name, std::initializer_list<LensNumber> numbers, double unit = 1) {
    parameters.names.push_back(name);
    parameters.map.conservativeResize(Eigen::NoChange, parameters.map.cols() + 1);
    parameters.map.rightCols<1>().setZero();
    for (const LensNumber number : numbers) parameters.map(number, parameters.map.cols() - 1) = unit;
  };
  if (settings.square_pixels) {
    add("f_px", {kFx, kFy});
  } else {
    add("fx_px", {kFx});
    add("fy_px", {kFy});
  }
  add("cx_px", {kCx});
  add("cy_px", {kCy});
  if (settings.skew && settings.distortion != LensKind::kIntensifier) add("skew_px", {kSkew});
  if (settings.distortion != LensKind::kNone) {
    add("k1", {kK1});
    add("k2", {kK2});
  }
  if (settings.distortion == LensKind::kIntensifier) {
    add("s1_deg", {kS1}, degToRad(1));
    add("s2_deg", {kS2}, degToRad(1));
  }
  if (several_distances) {
    add("source_detector_offset_mm", {kOffset}, 1e-3);
    add("principal_point_slope_x_px_per_mm", {kSlopeX}, 1e3);
    add("principal_point_slope_y_px_per_mm", {kSlopeY}, 1e3);
  }
  return parameters;
}

}  // namespace angio::calibration
