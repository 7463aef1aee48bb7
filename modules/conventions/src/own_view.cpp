// SPDX-License-Identifier: GPL-2.0-or-later
#include "checks.hpp"
#include "convention_table.hpp"

namespace angio::conventions {
namespace {

// The keys of our pose file and of our camera file, in one.
struct OwnView {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();
  XrayCamera::Parameters camera;
};

template <typename Fields, typename View>
void visitOwn(Fields& fields, View& view) {
  fields.numbers("rotation", view.rotation);
  fields.numbers("translation_mm", view.translation_mm);
  visitCamera(fields, view.camera);
}

}  // namespace

ConvertedProjection readOwnView(YamlMap& map) {
  OwnView view;
  FieldReader fields(map);
  visitOwn(fields, view);
  Pose T = Pose::Identity();
  T.linear() = requireRotation("angio", "rotation", view.rotation);
  T.translation() = 1e-3 * view.translation_mm;
  return {{T, XrayCamera(view.camera)}};
}

Described describeOwnView(const XrayProjection& ours) {
  const OwnView view{ours.T_camera_model.linear(), 1e3 * ours.T_camera_model.translation(), ours.camera.parameters()};
  FieldWriter fields;
  visitOwn(fields, view);
  return {fields.json()};
}

}  // namespace angio::conventions
