// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/itk_transform.hpp"

#include <cmath>

#include "angio/conventions/euler_zxy.hpp"
#include "checks.hpp"
#include "convention_table.hpp"
#include "itk_names.hpp"

namespace angio::conventions {
namespace {

void requireCount(const std::string& place, const std::string& field, std::size_t count, std::size_t low,
                  std::size_t high) {
  if (count >= low && count <= high) return;
  throw InputError(place, field, std::to_string(count) + " numbers",
                   "must be " + std::to_string(low) + (low == high ? "" : " or " + std::to_string(high)));
}

Eigen::Matrix3d rotationZyx(const Eigen::Vector3d& x_y_z_rad) {
  return (Eigen::AngleAxisd(x_y_z_rad.z(), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(x_y_z_rad.y(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(x_y_z_rad.x(), Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

Eigen::Matrix3d matrixOf(const ItkTransform& transform, const std::string& place) {
  const Eigen::Vector3d first = Eigen::Map<const Eigen::Vector3d>(transform.parameters.data());
  if (transform.type == ItkTransformType::kEuler3D) {
    const bool zyx = transform.fixed_parameters.size() == 4 && transform.fixed_parameters[3] != 0;
    return zyx ? rotationZyx(first) : rotationZxy(first);
  }
  if (transform.type == ItkTransformType::kVersorRigid3D) {
    const double squared = first.squaredNorm();
    if (!(squared <= 1 + 1e-9)) {
      throw InputError(place, "Parameters", formatValue(std::sqrt(squared)), "must be a versor: no longer than 1");
    }
    const double scalar = std::sqrt(std::max(0.0, 1 - squared));
    return Eigen::Quaterniond(scalar, first.x(), first.y(), first.z()).normalized().toRotationMatrix();
  }
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(transform.parameters.data());
}

enum class Maps { kModelToCamera, kCameraToModel };
constexpr Names<Maps, 2> kMaps = {
    {{"model_to_camera", Maps::kModelToCamera}, {"camera_to_model", Maps::kCameraToModel}}};

struct ItkView {
  ItkTransform transform;
  Maps maps = Maps::kModelToCamera;
  XrayCamera::Parameters camera;
  WorldFrame world;
};

template <typename Fields, typename View>
void visitItk(Fields& fields, View& view) {
  fields.choice("Transform", view.transform.type, kItkTransforms);
  fields.list("Parameters", view.transform.parameters);
  fields.list("FixedParameters", view.transform.fixed_parameters);
  fields.whenGiven("maps", true, [&](auto& f) { f.choice("maps", view.maps, kMaps); });
  visitCamera(fields, view.camera);
  visitWorld(fields, view.world);
}

}  // namespace

Pose poseOf(const ItkTransform& transform, const std::string& place) {
  const bool affine = transform.type == ItkTransformType::kAffine, euler = transform.type == ItkTransformType::kEuler3D;
  const std::size_t count = affine ? 12 : 6;
  requireCount(place, "Parameters", transform.parameters.size(), count, count);
  // Older files of ITK have no fourth one for the order of the angles.
  requireCount(place, "FixedParameters", transform.fixed_parameters.size(), 3, euler ? 4 : 3);
  Pose T = Pose::Identity();
  T.linear() = requireRotation(place, "Parameters", matrixOf(transform, place));
  const Eigen::Vector3d center_mm = Eigen::Map<const Eigen::Vector3d>(transform.fixed_parameters.data());
  const Eigen::Vector3d t_mm = Eigen::Map<const Eigen::Vector3d>(transform.parameters.data() + count - 3);
  T.translation() = 1e-3 * (center_mm + t_mm - T.linear() * center_mm);
  return T;
}

ItkTransform itkTransformOf(const Pose& T, ItkTransformType type, const Eigen::Vector3d& center_mm) {
  const Eigen::Matrix3d& R = T.linear();
  ItkTransform transform;
  transform.type = type;
  if (type == ItkTransformType::kEuler3D) {
    const Eigen::Vector3d x_y_z_rad = eulerZxy(R);
    transform.parameters.assign(x_y_z_rad.begin(), x_y_z_rad.end());
  } else if (type == ItkTransformType::kVersorRigid3D) {
    Eigen::Quaterniond q(R);
    q.normalize();
    if (q.w() < 0) q.coeffs() *= -1;
    transform.parameters = {q.x(), q.y(), q.z()};
  } else {
    for (Eigen::Index k = 0; k < 9; ++k) transform.parameters.push_back(R(k / 3, k % 3));
  }
  const Eigen::Vector3d t_mm = 1e3 * T.translation() - center_mm + R * center_mm;
  transform.parameters.insert(transform.parameters.end(), t_mm.begin(), t_mm.end());
  transform.fixed_parameters.assign(center_mm.begin(), center_mm.end());
  if (type == ItkTransformType::kEuler3D) transform.fixed_parameters.push_back(0);
  return transform;
}

ConvertedProjection readItkView(YamlMap& map) {
  ItkView view;
  FieldReader fields(map);
  visitItk(fields, view);
  const Pose T = poseOf(view.transform, "itk");
  const Pose T_camera_world = view.maps == Maps::kModelToCamera ? T : T.inverse();
  return {{T_camera_world * T_world_model(view.world, WorldAxes::kLps), XrayCamera(view.camera)}};
}

Described describeItkView(const XrayProjection& ours, ItkTransformType type, const WorldFrame& world) {
  const Pose T_camera_world = ours.T_camera_model * T_world_model(world, WorldAxes::kLps).inverse();
  const ItkView view{itkTransformOf(T_camera_world, type), Maps::kModelToCamera, ours.camera.parameters(), world};
  FieldWriter fields;
  visitItk(fields, view);
  return {fields.json()};
}

}  // namespace angio::conventions
