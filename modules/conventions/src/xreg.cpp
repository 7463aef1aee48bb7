// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/xreg.hpp"

#include <cmath>

#include "checks.hpp"
#include "convention_table.hpp"

namespace angio::conventions {
namespace {

// As in xreg's own files.
constexpr Names<XregFrame, 3> kXregFrames = {{{"origin-at-focal-pt-det-pos-z", XregFrame::kFocalPointPositiveZ},
                                              {"origin-at-focal-pt-det-neg-z", XregFrame::kFocalPointNegativeZ},
                                              {"origin-on-det", XregFrame::kOnDetector}}};

// Along the camera frame's z.
double beamOf(XregFrame frame) { return frame == XregFrame::kFocalPointPositiveZ ? 1 : -1; }

void checkIntrinsic(const Eigen::Matrix3d& K) {
  const std::string place = "xreg", field = "intrinsic";
  const double scale = std::abs(K(0, 0)) + std::abs(K(1, 1));
  if (!(std::abs(K(0, 1)) <= 1e-9 * scale)) {
    throw InputError(place, field + "[1]", formatValue(K(0, 1)), "must be 0: a detector that shears is none of ours");
  }
  if (K(1, 0) != 0 || K(2, 0) != 0 || K(2, 1) != 0 || K(2, 2) != 1) {
    throw InputError(place, field, "", "must be upper triangular with 1 as its last entry");
  }
  for (const int k : {0, 1})
    requirePositive(place, field + "[" + std::to_string(4 * k) + "] (magnitude)", std::abs(K(k, k)));
}

// xreg's FocalLenFromIntrins.
double focalLength_mm(const XregProjection& p) {
  return 0.5 * (std::abs(p.intrinsic(0, 0)) * p.col_spacing_mm + std::abs(p.intrinsic(1, 1)) * p.row_spacing_mm);
}

// Where the source is in xreg's camera frame.
Eigen::Vector3d sourceOf(XregFrame frame, double focal_length_mm) {
  return {0, 0, frame == XregFrame::kOnDetector ? focal_length_mm : 0};
}

template <typename Fields, typename Projection>
void visitXreg(Fields& fields, Projection& p) {
  fields.choice("cam_coord_frame_type", p.frame, kXregFrames);
  fields.pixels("num_rows", p.num_rows);
  fields.pixels("num_cols", p.num_cols);
  fields.positive("row_spacing_mm", p.row_spacing_mm);
  fields.positive("col_spacing_mm", p.col_spacing_mm);
  fields.numbers("intrinsic", p.intrinsic);
  fields.numbers("extrinsic", p.extrinsic);
  visitWorld(fields, p.world);
}

}  // namespace

ConvertedProjection fromXreg(const XregProjection& theirs) {
  checkIntrinsic(theirs.intrinsic);
  const Eigen::Matrix4d& E = theirs.extrinsic;
  if (E.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) throw InputError("xreg", "extrinsic", "", "must end in 0, 0, 0, 1");
  const double beam = beamOf(theirs.frame), focal_mm = focalLength_mm(theirs);
  // u = K00 x / z + K02 with z = beam * depth, or depth itself where the origin is on the detector.
  const double sign = theirs.frame == XregFrame::kFocalPointNegativeZ ? -1 : 1;
  Eigen::Vector3d axes(std::copysign(1, sign * theirs.intrinsic(0, 0)), std::copysign(1, sign * theirs.intrinsic(1, 1)),
                       beam);
  const bool mirrored = axes.prod() < 0;
  double cx_px = theirs.intrinsic(0, 2);
  if (mirrored) {
    axes.x() *= -1;
    cx_px = theirs.num_cols - 1 - cx_px;
  }
  Pose T_camera_world = Pose::Identity();
  T_camera_world.linear() =
      axes.asDiagonal() * requireRotation("xreg", "extrinsic", Eigen::Matrix3d(E.topLeftCorner<3, 3>()));
  T_camera_world.translation() =
      1e-3 * axes.cwiseProduct(Eigen::Vector3d(E.topRightCorner<3, 1>()) - sourceOf(theirs.frame, focal_mm));

  XrayCamera::Parameters p;
  p.width_px = theirs.num_cols;
  p.height_px = theirs.num_rows;
  p.fx_px = std::abs(theirs.intrinsic(0, 0));
  p.fy_px = std::abs(theirs.intrinsic(1, 1));
  p.cx_px = cx_px;
  p.cy_px = theirs.intrinsic(1, 2);
  if (theirs.row_spacing_mm == theirs.col_spacing_mm) p.pixel_spacing_m = 1e-3 * theirs.row_spacing_mm;
  p.source_detector_distance_m = 1e-3 * focal_mm;
  return {{T_camera_world * T_world_model(theirs.world, WorldAxes::kLps), XrayCamera(p)},
          mirrored ? PictureFlip::kLeftRight : PictureFlip::kNone};
}

XregResult toXreg(const XrayProjection& ours, XregFrame frame, const WorldFrame& world) {
  const XrayCamera::Parameters& camera = ours.camera.parameters();
  const double focal_mm = requireSourceDetector_mm(ours.camera, "xreg");
  XregResult result;
  XregProjection& p = result.projection;
  p.frame = frame;
  p.num_rows = camera.height_px;
  p.num_cols = camera.width_px;
  p.row_spacing_mm = focal_mm / camera.fy_px;
  p.col_spacing_mm = focal_mm / camera.fx_px;
  p.world = world;
  const bool mirrored = frame != XregFrame::kFocalPointPositiveZ;
  result.flip = mirrored ? PictureFlip::kLeftRight : PictureFlip::kNone;
  const double sign = frame == XregFrame::kFocalPointNegativeZ ? -1 : 1;
  p.intrinsic(0, 0) = sign * camera.fx_px;
  p.intrinsic(1, 1) = sign * camera.fy_px;
  p.intrinsic(0, 2) = mirrored ? camera.width_px - 1 - camera.cx_px : camera.cx_px;
  p.intrinsic(1, 2) = camera.cy_px;
  const Eigen::Vector3d axes(mirrored ? -1 : 1, 1, beamOf(frame));
  const Pose T_camera_world = ours.T_camera_model * T_world_model(world, WorldAxes::kLps).inverse();
  p.extrinsic.topLeftCorner<3, 3>() = axes.asDiagonal() * T_camera_world.linear();
  p.extrinsic.topRightCorner<3, 1>() =
      axes.cwiseProduct(1e3 * T_camera_world.translation()) + sourceOf(frame, focal_mm);
  return result;
}

ConvertedProjection readXreg(YamlMap& map) {
  XregProjection p;
  FieldReader fields(map);
  visitXreg(fields, p);
  return fromXreg(p);
}

Described describeXreg(const XrayProjection& ours, XregFrame frame, const WorldFrame& world) {
  const XregResult result = toXreg(ours, frame, world);
  FieldWriter fields;
  visitXreg(fields, result.projection);
  return {fields.json(), result.flip};
}

}  // namespace angio::conventions
