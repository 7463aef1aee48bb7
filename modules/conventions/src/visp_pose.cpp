// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/visp_pose.hpp"

#include "convention_table.hpp"

namespace angio::conventions {
namespace {

template <typename Fields, typename Projection>
void visitVisp(Fields& fields, Projection& p) {
  fields.numbers("t_mm", p.t_mm);
  fields.numbers("thetau_deg", p.thetau_deg);
  fields.positive("px", p.px);
  fields.positive("py", p.py);
  fields.number("u0", p.u0);
  fields.number("v0", p.v0);
  visitDetectorOf(fields, p.detector);
}

}  // namespace

XrayProjection fromVispPose(const VispProjection& theirs) {
  XrayCamera::Parameters camera = theirs.detector;
  camera.fx_px = theirs.px;
  camera.fy_px = theirs.py;
  camera.cx_px = theirs.u0;
  camera.cy_px = theirs.v0;
  Pose cMo = Pose::Identity();
  cMo.linear() = expSO3(degToRad(1) * theirs.thetau_deg);
  cMo.translation() = 1e-3 * theirs.t_mm;
  return {cMo, XrayCamera(camera)};
}

VispProjection toVispPose(const XrayProjection& ours) {
  const XrayCamera::Parameters& camera = ours.camera.parameters();
  return {1e3 * ours.T_camera_model.translation(),
          radToDeg(1) * logSO3(ours.T_camera_model.linear()),
          camera.fx_px,
          camera.fy_px,
          camera.cx_px,
          camera.cy_px,
          camera};
}

ConvertedProjection readVispPose(YamlMap& map) {
  VispProjection p;
  FieldReader fields(map);
  visitVisp(fields, p);
  return {fromVispPose(p)};
}

Described describeVispPose(const XrayProjection& ours) {
  const VispProjection p = toVispPose(ours);
  FieldWriter fields;
  visitVisp(fields, p);
  return {fields.json()};
}

}  // namespace angio::conventions
