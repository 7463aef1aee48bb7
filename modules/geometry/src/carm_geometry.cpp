// SPDX-License-Identifier: GPL-2.0-or-later
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/geometry/decompositions.hpp"

namespace angio::geometry {
namespace {

// Row and column of the table's parameters.
constexpr int kTableEntries[8][2] = {{0, 0}, {2, 0}, {0, 1}, {1, 1}, {2, 1}, {0, 2}, {1, 2}, {2, 2}};

// A line that the camera can turn about, camera axes: how fast it moves then.
Twist turnAbout(const Eigen::Vector3d& axis, const Eigen::Vector3d& point) {
  return (Twist() << -axis.cross(point), axis).finished();
}

Twist shiftAlong(const Eigen::Vector3d& direction) {
  return (Twist() << direction, Eigen::Vector3d::Zero()).finished();
}

// The arm of a C-arm that deviates, before it bends.
struct RigidArm {
  Eigen::Matrix3d R_iso_primary;   // The frame that primary turns.
  Eigen::Vector3d gap_point;       // Where the common perpendicular meets the secondary axis, iso.
  Eigen::Vector3d secondary_axis;  // Iso.
  Eigen::Matrix3d R_camera_ideal;  // The mount's turns.
  Pose T_camera_iso;
};

RigidArm rigidArm(const CArmGeometry& carm, const CArmJoints& joints) {
  const CArmDeviations& d = carm.deviations;
  RigidArm arm;
  arm.R_iso_primary = Eigen::AngleAxisd(joints[0] + d.primary_offset_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  arm.gap_point = arm.R_iso_primary.col(1) * d.axis_gap_m;
  const Eigen::Matrix3d R_iso_skewed =
      arm.R_iso_primary * Eigen::AngleAxisd(d.axis_skew_rad, Eigen::Vector3d::UnitY()).toRotationMatrix();
  arm.secondary_axis = -R_iso_skewed.col(0);
  const Eigen::Matrix3d R_iso_arm =
      R_iso_skewed *
      Eigen::AngleAxisd(joints[1] + d.secondary_offset_rad, -Eigen::Vector3d::UnitX()).toRotationMatrix();
  arm.R_camera_ideal = (Eigen::AngleAxisd(-d.detector_roll_rad, Eigen::Vector3d::UnitZ()) *
                        Eigen::AngleAxisd(-d.detector_turn_rad, Eigen::Vector3d::UnitY()))
                           .toRotationMatrix();
  arm.T_camera_iso.linear() = arm.R_camera_ideal * viewRotation({}) * R_iso_arm.transpose();
  arm.T_camera_iso.translation() =
      arm.R_camera_ideal * Eigen::Vector3d(-d.source_right_m, -d.source_down_m, carm.source_isocenter_distance_m) -
      arm.T_camera_iso.linear() * arm.gap_point;
  arm.T_camera_iso.makeAffine();
  return arm;
}

// The frame that the L-arm has turned: its axes are the arm's, its origin the isocentre.
Eigen::Matrix3d R_gantry_iso(double l_arm_rad) {
  return Eigen::AngleAxisd(-l_arm_rad, Eigen::Vector3d::UnitY()).toRotationMatrix();
}

Pose bend(const CArmDeviations& d, const CArmJoints& joints) {
  return d.flex.count == 0 ? Pose::Identity() : expSE3(-d.flex.at(joints[0], joints[1]));
}

void requireSmall(const std::string& field, double value, double largest) {
  requireBetween("c-arm", field, value, -largest, largest);
}

}  // namespace

void CArmGeometry::check() const {
  const std::string place = "c-arm";
  requirePositive(place, "source_isocentre_distance_mm", source_isocenter_distance_m * 1e3);
  requirePositive(place, "source_detector_distance_mm", source_detector_distance_m * 1e3);
  if (source_detector_distance_m <= source_isocenter_distance_m) {
    throw InputError(place, "source_detector_distance_mm", formatValue(source_detector_distance_m * 1e3),
                     "must exceed source_isocentre_distance_mm");
  }
  requireSmall("l_arm_deg", radToDeg(l_arm_rad), 180);
  const CArmDeviations& d = deviations;
  // In the order of kCArmPoseParameterNames; the distance from source to isocentre is checked above.
  constexpr double kMax[kFirstTableParameter] = {20, 20, 20, 200, 200, 200, 1e9, 20, 20};
  const auto values = poseParameters();
  for (int i = 0; i < kFirstTableParameter; ++i) {
    const CArmParameter& parameter = kCArmPoseParameterNames[i];
    requireSmall("deviations." + std::string(parameter.name), values[i] / parameter.unit, kMax[i]);
  }
  for (const double x : (d.table - Eigen::Matrix3d::Identity()).reshaped()) requireSmall("deviations.table", x, 0.5);
  requireBetween(place, "deviations.table[3]", d.table(1, 0), 0, 0);
  requireSmall("deviations.source_detector_offset_mm", d.source_detector_offset_m * 1e3, 200);
  requireSmall("deviations.pixel_aspect", d.pixel_aspect, 0.2);
  for (const double x : d.principal_point_px) requireSmall("deviations.principal_point_px", x, 1000);
  for (const double x : d.principal_point_slope_px_per_m) {
    requireSmall("deviations.principal_point_slope_px_per_mm", 1e-3 * x, 10);
  }
  for (int i = 0; i < d.flex.count; ++i) {
    const CArmFlexTerm& term = d.flex.terms[i];
    for (int k = 0; k < 6; ++k) {
      requireSmall("deviations.flex", k < 3 ? term.twist[k] * 1e3 : radToDeg(term.twist[k]), k < 3 ? 50 : 5);
    }
    requireSmall("deviations.flex", term.frequency_primary, 8);
    requireSmall("deviations.flex", term.frequency_secondary, 8);
    requireSmall("deviations.flex", radToDeg(term.phase_rad), 360);
  }
  camera();
}

XrayCamera CArmGeometry::camera(double encoder_distance_m) const {
  const CArmDeviations& d = deviations;
  const XrayCamera ideal = XrayCamera::centered(image_width_px, image_height_px, pixel_spacing_m,
                                                encoder_distance_m + d.source_detector_offset_m);
  XrayCamera::Parameters p = ideal.parameters();
  const Eigen::Vector2d shift_px =
      d.principal_point_px + d.principal_point_slope_px_per_m * (encoder_distance_m - source_detector_distance_m);
  p.fy_px *= 1 + d.pixel_aspect;
  p.cx_px += shift_px.x();
  p.cy_px += shift_px.y();
  return XrayCamera(p);
}

Pose CArmGeometry::T_camera_patient(const CArmJoints& joints) const {
  if (!deviations.movesCamera()) {
    Eigen::Matrix3d R = viewRotation({joints[0], joints[1]});
    if (l_arm_rad != 0) R = R * R_gantry_iso(l_arm_rad);
    Pose T = Pose::Identity();
    T.linear() = R;
    T.translation() = Eigen::Vector3d(0, 0, source_isocenter_distance_m) + R * joints.tail<3>();
    return T;
  }
  return T_camera_patient(joints, nullptr);
}

Pose CArmGeometry::T_camera_patient(const CArmJoints& joints, CArmPoseJacobian* J) const {
  const RigidArm arm = rigidArm(*this, joints);
  const Pose T_bent_camera = bend(deviations, joints);
  Pose T = T_bent_camera * arm.T_camera_iso;
  if (l_arm_rad != 0) T.linear() = T.linear() * R_gantry_iso(l_arm_rad);
  T.translation() += T.linear() * (deviations.table * joints.tail<3>());
  if (!J) return T;

  const Pose& T_camera_iso = arm.T_camera_iso;
  const Eigen::Matrix3d& R = T_camera_iso.linear();
  const Eigen::Vector3d knee = T_camera_iso * arm.gap_point, perpendicular = R * arm.R_iso_primary.col(1);
  J->col(0) = turnAbout(R.col(2), T_camera_iso.translation());
  J->col(1) = turnAbout(R * arm.secondary_axis, knee);
  J->col(2) = turnAbout(perpendicular, knee);
  J->col(3) = shiftAlong(perpendicular);
  J->col(4) = shiftAlong(arm.R_camera_ideal.col(0));
  J->col(5) = shiftAlong(arm.R_camera_ideal.col(1));
  J->col(6) = shiftAlong(-arm.R_camera_ideal.col(2));
  const Eigen::AngleAxisd unroll(-deviations.detector_roll_rad, Eigen::Vector3d::UnitZ());
  J->col(7) = turnAbout(unroll * Eigen::Vector3d::UnitY(), Eigen::Vector3d::Zero());
  J->col(8) = turnAbout(Eigen::Vector3d::UnitZ(), Eigen::Vector3d::Zero());
  J->leftCols<kFirstTableParameter>() = (adjointSE3(T_bent_camera) * J->leftCols<kFirstTableParameter>()).eval();
  for (int k = 0; k < 8; ++k) {
    J->col(kFirstTableParameter + k) =
        shiftAlong(-T.linear().col(kTableEntries[k][0]) * joints[2 + kTableEntries[k][1]]);
  }
  return T;
}

Eigen::Matrix<double, 6, 5> CArmGeometry::eJe(const CArmJoints& joints) const {
  Eigen::Matrix<double, 6, 5> J = Eigen::Matrix<double, 6, 5>::Zero();
  if (!deviations.movesCamera()) {
    Eigen::Matrix3d R = viewRotation({joints[0], joints[1]});
    const double ca = std::cos(joints[0]), sa = std::sin(joints[0]);
    // Primary turns the arm about the patient's long axis; secondary about the axis that primary has turned.
    const Eigen::Vector3d axes_iso[2] = {Eigen::Vector3d::UnitZ(), Eigen::Vector3d(-ca, -sa, 0)};
    const Eigen::Vector3d source_from_isocenter(0, 0, -source_isocenter_distance_m);
    for (int i = 0; i < 2; ++i) {
      const Eigen::Vector3d w = R * axes_iso[i];
      J.block<3, 1>(0, i) = w.cross(source_from_isocenter);
      J.block<3, 1>(3, i) = w;
    }
    if (l_arm_rad != 0) R = R * R_gantry_iso(l_arm_rad);
    J.block<3, 3>(0, 2) = -R;  // The table moves the patient; the camera moves the other way relative to the patient.
    return J;
  }
  CArmPoseJacobian by_parameters;
  const Pose T = T_camera_patient(joints, &by_parameters);
  J.leftCols<2>() = by_parameters.leftCols<2>();  // An angle and its offset do the same, but for the bending.
  if (deviations.flex.count != 0) {
    const Twist bent = deviations.flex.at(joints[0], joints[1]);
    J.leftCols<2>() += inverseOf(rightJacobianInverseSE3(bent)) * deviations.flex.derivatives(joints[0], joints[1]);
  }
  J.block<3, 3>(0, 2) = -T.linear() * deviations.table;
  return J;
}

Eigen::Matrix<double, kCArmPoseParameters, 1> CArmGeometry::poseParameters() const {
  const CArmDeviations& d = deviations;
  Eigen::Matrix<double, kCArmPoseParameters, 1> values;
  values.head<kFirstTableParameter>() << d.primary_offset_rad, d.secondary_offset_rad, d.axis_skew_rad, d.axis_gap_m,
      d.source_right_m, d.source_down_m, source_isocenter_distance_m, d.detector_turn_rad, d.detector_roll_rad;
  for (int k = 0; k < 8; ++k) values[kFirstTableParameter + k] = d.table(kTableEntries[k][0], kTableEntries[k][1]);
  return values;
}

void CArmGeometry::setPoseParameters(const Eigen::Matrix<double, kCArmPoseParameters, 1>& values) {
  CArmDeviations& d = deviations;
  int i = 0;
  for (double* field :
       {&d.primary_offset_rad, &d.secondary_offset_rad, &d.axis_skew_rad, &d.axis_gap_m, &d.source_right_m,
        &d.source_down_m, &source_isocenter_distance_m, &d.detector_turn_rad, &d.detector_roll_rad}) {
    *field = values[i++];
  }
  for (const auto& entry : kTableEntries) d.table(entry[0], entry[1]) = values[i++];
}

}  // namespace angio::geometry
