// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/rtk.hpp"

#include <Eigen/LU>
#include <cmath>

#include "angio/conventions/euler_zxy.hpp"
#include "checks.hpp"
#include "convention_table.hpp"

namespace angio::conventions {
namespace {

Eigen::Matrix3d rtkRotation(const RtkProjection& p) {
  return rotationZxy(-degToRad(1) * Eigen::Vector3d(p.out_of_plane_deg, p.gantry_deg, p.in_plane_deg));
}

// Within [0, 360), as RTK keeps them.
double wrapped(double angle_deg) {
  const double turn = angle_deg - 360 * std::floor(angle_deg / 360);
  return turn < 360 ? turn : 0;
}

void setAngles(const Eigen::Matrix3d& R, RtkProjection& p) {
  const Eigen::Vector3d x_y_z_deg = -radToDeg(1) * eulerZxy(R);
  p.out_of_plane_deg = wrapped(x_y_z_deg.x());
  p.gantry_deg = wrapped(x_y_z_deg.y());
  p.in_plane_deg = wrapped(x_y_z_deg.z());
}

void checkRtk(const RtkProjection& p, const RtkDetector& d) {
  const std::string place = "rtk";
  requirePositive(place, "SourceToIsocenterDistance", p.source_to_isocenter_mm);
  requirePositive(place, "SourceToDetectorDistance", p.source_to_detector_mm);
  for (const int k : {0, 1}) {
    const std::string at = "[" + std::to_string(k) + "]";
    requirePositive(place, "spacing_mm" + at, d.spacing_mm[k]);
    if (std::abs(d.direction[k]) != 1) {
      throw InputError(place, "direction" + at, formatValue(d.direction[k]), "must be 1 or -1");
    }
  }
}

struct RtkView {
  RtkProjection projection;
  RtkMatrix matrix;
  RtkDetector detector;
  WorldFrame world;
};

template <typename Fields, typename Detector>
void visitDetector(Fields& fields, Detector& d) {
  fields.pixels("width_px", d.width_px);
  fields.pixels("height_px", d.height_px);
  fields.numbers("origin_mm", d.origin_mm);
  fields.numbers("spacing_mm", d.spacing_mm);
  fields.whenGiven("direction", !(d.direction.array() == 1).all(),
                   [&](auto& f) { f.numbers("direction", d.direction); });
}

// RTK's own names, with what it leaves out where it is zero.
template <typename Fields, typename View>
void visitRtk(Fields& fields, View& view) {
  auto& p = view.projection;
  fields.length("SourceToIsocenterDistance", p.source_to_isocenter_mm);
  fields.length("SourceToDetectorDistance", p.source_to_detector_mm);
  fields.number("GantryAngle", p.gantry_deg);
  const auto other = [&](const char* key, auto& value) {
    fields.whenGiven(key, value != 0, [&](auto& f) { f.number(key, value); });
  };
  other("OutOfPlaneAngle", p.out_of_plane_deg);
  other("InPlaneAngle", p.in_plane_deg);
  other("SourceOffsetX", p.source_offset_mm.x());
  other("SourceOffsetY", p.source_offset_mm.y());
  other("ProjectionOffsetX", p.projection_offset_mm.x());
  other("ProjectionOffsetY", p.projection_offset_mm.y());
  visitDetector(fields, view.detector);
  visitWorld(fields, view.world);
}

template <typename Fields, typename View>
void visitRtkMatrix(Fields& fields, View& view) {
  fields.numbers("Matrix", view.matrix);
  visitDetector(fields, view.detector);
  visitWorld(fields, view.world);
}

RtkView viewOf(const XrayProjection& ours, const WorldFrame& world) {
  RtkView view{toRtk(ours, world), {}, centeredRtkDetector(ours.camera), world};
  view.matrix = rtkMatrix(view.projection);
  return view;
}

}  // namespace

RtkMatrix rtkMatrix(const RtkProjection& p) {
  Eigen::Matrix3d K = Eigen::Vector3d(-p.source_to_detector_mm, -p.source_to_detector_mm, 1).asDiagonal();
  K.topRightCorner<2, 1>() = p.source_offset_mm - p.projection_offset_mm;
  RtkMatrix from_source;
  from_source.leftCols<3>() = rtkRotation(p);
  from_source.col(3) << -p.source_offset_mm.x(), -p.source_offset_mm.y(), -p.source_to_isocenter_mm;
  return K * from_source;
}

RtkProjection rtkProjectionOf(const RtkMatrix& matrix) {
  const std::string place = "rtk", field = "Matrix";
  const double scale = matrix.row(2).head<3>().norm();
  const double determinant = matrix.leftCols<3>().determinant();
  if (!(scale > 0) || !matrix.allFinite() || !(std::abs(determinant) > 1e-12 * scale * scale * scale)) {
    throw InputError(place, field, "", "must be a projection from one source: its left 3 x 3 part is singular");
  }
  // RTK's third row counts towards the source, and then the determinant is positive.
  const RtkMatrix P = matrix * (std::copysign(1, determinant) / scale);
  const Eigen::RowVector3d beam = P.row(2).head<3>();
  const Eigen::Vector2d middle(P.row(0).head<3>().dot(beam), P.row(1).head<3>().dot(beam));
  const Eigen::RowVector3d right = P.row(0).head<3>() - middle.x() * beam,
                           down = P.row(1).head<3>() - middle.y() * beam;
  const double distance_mm = 0.5 * (right.norm() + down.norm());
  if (!(std::abs(right.dot(down)) <= 1e-6 * distance_mm * distance_mm) ||
      !(std::abs(right.norm() - down.norm()) <= 1e-6 * distance_mm)) {
    throw InputError(place, field, "", "must not shear, and have one source-detector distance along u and v");
  }
  Eigen::Matrix3d R;
  R << -right / distance_mm, -down / distance_mm, beam;
  R = requireRotation(place, field, R);
  RtkProjection p;
  setAngles(R, p);
  const Eigen::Vector3d source_mm = -R * P.leftCols<3>().inverse() * P.col(3);
  p.source_to_detector_mm = distance_mm;
  p.source_to_isocenter_mm = source_mm.z();
  p.source_offset_mm = source_mm.head<2>();
  p.projection_offset_mm = p.source_offset_mm - middle;
  return p;
}

RtkDetector centeredRtkDetector(const XrayCamera& camera) {
  const XrayCamera::Parameters& c = camera.parameters();
  const double distance_mm = requireSourceDetector_mm(camera, "RTK");
  RtkDetector d;
  d.width_px = c.width_px;
  d.height_px = c.height_px;
  d.spacing_mm = {distance_mm / c.fx_px, distance_mm / c.fy_px};
  d.direction = {1, -1};
  d.origin_mm =
      -0.5 * d.direction.cwiseProduct(d.spacing_mm).cwiseProduct(Eigen::Vector2d(c.width_px - 1, c.height_px - 1));
  return d;
}

ConvertedProjection fromRtk(const RtkProjection& p, const RtkDetector& d, const WorldFrame& world) {
  checkRtk(p, d);
  Eigen::Vector2d principal_point_px =
      (p.source_offset_mm - p.projection_offset_mm - d.origin_mm).cwiseProduct(d.direction).cwiseQuotient(d.spacing_mm);
  Eigen::Vector3d axes(d.direction.x(), d.direction.y(), -1);  // The beam goes against the rotated z.
  const bool mirrored = axes.prod() < 0;
  if (mirrored) {
    axes.y() *= -1;
    principal_point_px.y() = d.height_px - 1 - principal_point_px.y();
  }
  const Eigen::Vector3d source_mm(p.source_offset_mm.x(), p.source_offset_mm.y(), p.source_to_isocenter_mm);
  Pose T_camera_world = Pose::Identity();
  T_camera_world.linear() = axes.asDiagonal() * rtkRotation(p);
  T_camera_world.translation() = -1e-3 * axes.cwiseProduct(source_mm);
  return {{T_camera_world * T_world_model(world, WorldAxes::kIec),
           cameraOf(d.width_px, d.height_px, p.source_to_detector_mm, d.spacing_mm, principal_point_px)},
          mirrored ? PictureFlip::kUpDown : PictureFlip::kNone};
}

RtkProjection toRtk(const XrayProjection& ours, const WorldFrame& world) {
  const XrayCamera::Parameters& camera = ours.camera.parameters();
  const RtkDetector d = centeredRtkDetector(ours.camera);
  const Eigen::Vector3d axes(1, -1, -1);
  const Pose T_camera_world = ours.T_camera_model * T_world_model(world, WorldAxes::kIec).inverse();
  RtkProjection p;
  setAngles(axes.asDiagonal() * T_camera_world.linear(), p);
  const Eigen::Vector3d source_mm = -1e3 * axes.cwiseProduct(T_camera_world.translation());
  p.source_to_isocenter_mm = source_mm.z();
  p.source_to_detector_mm = 1e3 * *camera.source_detector_distance_m;
  p.source_offset_mm = source_mm.head<2>();
  const Eigen::Vector2d middle_mm =
      d.origin_mm + d.direction.cwiseProduct(d.spacing_mm).cwiseProduct(Eigen::Vector2d(camera.cx_px, camera.cy_px));
  p.projection_offset_mm = p.source_offset_mm - middle_mm;
  if (!(p.source_to_isocenter_mm > 0)) {
    throw InputError("rtk", "SourceToIsocenterDistance", formatValue(p.source_to_isocenter_mm),
                     "must be positive: the isocentre has to lie in front of the source");
  }
  return p;
}

ConvertedProjection readRtk(YamlMap& map) {
  RtkView view;
  FieldReader fields(map);
  visitRtk(fields, view);
  return fromRtk(view.projection, view.detector, view.world);
}

Described describeRtk(const XrayProjection& ours, const WorldFrame& world) {
  const RtkView view = viewOf(ours, world);
  FieldWriter fields;
  visitRtk(fields, view);
  return {fields.json()};
}

ConvertedProjection readRtkMatrix(YamlMap& map) {
  RtkView view;
  FieldReader fields(map);
  visitRtkMatrix(fields, view);
  return fromRtk(rtkProjectionOf(view.matrix), view.detector, view.world);
}

Described describeRtkMatrix(const XrayProjection& ours, const WorldFrame& world) {
  const RtkView view = viewOf(ours, world);
  FieldWriter fields;
  visitRtkMatrix(fields, view);
  return {fields.json()};
}

}  // namespace angio::conventions
