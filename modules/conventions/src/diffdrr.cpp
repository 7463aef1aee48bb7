// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/diffdrr.hpp"

#include "angio/conventions/euler_zxy.hpp"
#include "checks.hpp"
#include "convention_table.hpp"

namespace angio::conventions {
namespace {

constexpr Names<DiffDrrOrientation, 3> kOrientations = {
    {{"AP", DiffDrrOrientation::kAp}, {"PA", DiffDrrOrientation::kPa}, {"none", DiffDrrOrientation::kNone}}};

// DiffDRR's `reorient`; that of PA mirrors.
Eigen::Matrix3d reorientOf(DiffDrrOrientation orientation) {
  Eigen::Matrix3d M = Eigen::Matrix3d::Identity();
  if (orientation == DiffDrrOrientation::kAp) M << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  if (orientation == DiffDrrOrientation::kPa) M << 1, 0, 0, 0, 0, 1, 0, 1, 0;
  return M;
}

// Right in the picture as seen from the source, along DiffDRR's camera x: so that right, down and beam turn as x, y
// and z do in the world, mirrored or not.
double rightOf(DiffDrrOrientation orientation) { return orientation == DiffDrrOrientation::kPa ? 1 : -1; }

// From our camera's axes to the world's, before the C-arm is turned.
Eigen::Matrix3d R_world_camera(DiffDrrOrientation orientation) {
  return reorientOf(orientation) * Eigen::Vector3d(rightOf(orientation), -1, 1).asDiagonal();
}

// In the order of the file to that of eulerZxy().
Eigen::Vector3d xyzOf(const Eigen::Vector3d& z_x_y) { return {z_x_y[1], z_x_y[2], z_x_y[0]}; }

template <typename Fields, typename Projection>
void visitDiffDrr(Fields& fields, Projection& p) {
  fields.numbers("rotations_deg", p.rotations_deg);
  fields.numbers("translations_mm", p.translations_mm);
  fields.choice("orientation", p.orientation, kOrientations);
  fields.flag("reverse_x_axis", p.reverse_x_axis);
  fields.positive("sdd_mm", p.sdd_mm);
  fields.pixels("height_px", p.height_px);
  fields.pixels("width_px", p.width_px);
  fields.positive("delx_mm", p.delx_mm);
  fields.positive("dely_mm", p.dely_mm);
  fields.whenGiven("x0_mm", p.x0_mm != 0, [&](auto& f) { f.length("x0_mm", p.x0_mm); });
  fields.whenGiven("y0_mm", p.y0_mm != 0, [&](auto& f) { f.length("y0_mm", p.y0_mm); });
  visitWorld(fields, p.world);
}

}  // namespace

ConvertedProjection fromDiffDrr(const DiffDrrProjection& theirs) {
  const double right = rightOf(theirs.orientation);
  const Eigen::Vector2d principal_point_px(0.5 * (theirs.width_px - 1) - right * theirs.x0_mm / theirs.delx_mm,
                                           0.5 * (theirs.height_px - 1) + theirs.y0_mm / theirs.dely_mm);
  const Eigen::Matrix3d R = rotationZxy(degToRad(1) * xyzOf(theirs.rotations_deg));
  Pose T_world_camera = Pose::Identity();
  T_world_camera.linear() = R * R_world_camera(theirs.orientation);
  T_world_camera.translation() = 1e-3 * (R * theirs.translations_mm);
  const bool mirrored = theirs.reverse_x_axis != (right < 0);
  return {{T_world_camera.inverse() * T_world_model(theirs.world, WorldAxes::kRas),
           cameraOf(theirs.width_px, theirs.height_px, theirs.sdd_mm, {theirs.delx_mm, theirs.dely_mm},
                    principal_point_px)},
          mirrored ? PictureFlip::kLeftRight : PictureFlip::kNone};
}

DiffDrrProjection toDiffDrr(const XrayProjection& ours, DiffDrrOrientation orientation, const WorldFrame& world) {
  const XrayCamera::Parameters& camera = ours.camera.parameters();
  const double right = rightOf(orientation);
  DiffDrrProjection p;
  p.sdd_mm = requireSourceDetector_mm(ours.camera, "DiffDRR");
  p.orientation = orientation;
  p.reverse_x_axis = right < 0;
  p.height_px = camera.height_px;
  p.width_px = camera.width_px;
  p.delx_mm = p.sdd_mm / camera.fx_px;
  p.dely_mm = p.sdd_mm / camera.fy_px;
  p.x0_mm = right * (0.5 * (camera.width_px - 1) - camera.cx_px) * p.delx_mm;
  p.y0_mm = (camera.cy_px - 0.5 * (camera.height_px - 1)) * p.dely_mm;
  p.world = world;
  const Pose T_world_camera = T_world_model(world, WorldAxes::kRas) * ours.T_camera_model.inverse();
  const Eigen::Matrix3d R = T_world_camera.linear() * R_world_camera(orientation).transpose();
  const Eigen::Vector3d x_y_z_deg = radToDeg(1) * eulerZxy(R);
  p.rotations_deg = {x_y_z_deg.z(), x_y_z_deg.x(), x_y_z_deg.y()};
  p.translations_mm = 1e3 * (R.transpose() * T_world_camera.translation());
  return p;
}

ConvertedProjection readDiffDrr(YamlMap& map) {
  DiffDrrProjection p;
  FieldReader fields(map);
  visitDiffDrr(fields, p);
  return fromDiffDrr(p);
}

Described describeDiffDrr(const XrayProjection& ours, DiffDrrOrientation orientation, const WorldFrame& world) {
  const DiffDrrProjection p = toDiffDrr(ours, orientation, world);
  FieldWriter fields;
  visitDiffDrr(fields, p);
  return {fields.json()};
}

}  // namespace angio::conventions
