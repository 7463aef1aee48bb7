// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/projection_files.hpp"

#include "angio/conventions/rtk_geometry_file.hpp"
#include "angio/conventions/tfm_file.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/xa_files.hpp"
#include "checks.hpp"
#include "convention_table.hpp"

namespace angio::conventions {
namespace {

struct Convention {
  const char* key;  // What `convention` has to say in a file.
  ConvertedProjection (*read)(YamlMap& map);
};

constexpr Convention kConventions[] = {
    {"angio", readOwnView},        {"diffdrr", readDiffDrr}, {"xreg", readXreg},   {"rtk", readRtk},
    {"rtk-matrix", readRtkMatrix}, {"visp", readVispPose},   {"itk", readItkView},
};

// What can be written; several variants have one key.
struct Variant {
  const char* name;
  const char* key;
  const char* words;
  Described (*describe)(const XrayProjection& ours, const WorldFrame& world);
};

const Variant kVariants[] = {
    {"angio", "angio", "our own pose and camera",
     [](const XrayProjection& ours, const WorldFrame&) { return describeOwnView(ours); }},
    {"diffdrr", "diffdrr", "DiffDRR, orientation AP",
     [](const XrayProjection& ours, const WorldFrame& world) {
       return describeDiffDrr(ours, DiffDrrOrientation::kAp, world);
     }},
    {"diffdrr-pa", "diffdrr", "DiffDRR, orientation PA",
     [](const XrayProjection& ours, const WorldFrame& world) {
       return describeDiffDrr(ours, DiffDrrOrientation::kPa, world);
     }},
    {"diffdrr-none", "diffdrr", "DiffDRR without an orientation",
     [](const XrayProjection& ours, const WorldFrame& world) {
       return describeDiffDrr(ours, DiffDrrOrientation::kNone, world);
     }},
    {"xreg", "xreg", "xreg, origin at the focal point, +z to the detector",
     [](const XrayProjection& ours, const WorldFrame& world) {
       return describeXreg(ours, XregFrame::kFocalPointPositiveZ, world);
     }},
    {"xreg-negative-z", "xreg", "xreg, origin at the focal point, -z to the detector",
     [](const XrayProjection& ours, const WorldFrame& world) {
       return describeXreg(ours, XregFrame::kFocalPointNegativeZ, world);
     }},
    {"xreg-detector", "xreg", "xreg, origin on the detector",
     [](const XrayProjection& ours, const WorldFrame& world) {
       return describeXreg(ours, XregFrame::kOnDetector, world);
     }},
    {"rtk", "rtk", "RTK's nine numbers", describeRtk},
    {"rtk-matrix", "rtk-matrix", "RTK's 3 x 4 matrix", describeRtkMatrix},
    {"visp", "visp", "ViSP's cMo as translation and theta u",
     [](const XrayProjection& ours, const WorldFrame&) { return describeVispPose(ours); }},
    {"itk", "itk", "ITK's Euler3DTransform",
     [](const XrayProjection& ours, const WorldFrame& world) {
       return describeItkView(ours, ItkTransformType::kEuler3D, world);
     }},
    {"itk-versor", "itk", "ITK's VersorRigid3DTransform",
     [](const XrayProjection& ours, const WorldFrame& world) {
       return describeItkView(ours, ItkTransformType::kVersorRigid3D, world);
     }},
    {"itk-affine", "itk", "ITK's AffineTransform",
     [](const XrayProjection& ours, const WorldFrame& world) {
       return describeItkView(ours, ItkTransformType::kAffine, world);
     }},
};

const Variant& variantNamed(const std::string& name) {
  std::vector<std::string> known;
  for (const Variant& variant : kVariants) {
    if (variant.name == name) return variant;
    known.emplace_back(variant.name);
  }
  throw InputError("", "convention", name, "must be one of " + joined(known));
}

XrayCamera cameraBeside(const ProjectionSource& source) {
  if (!source.camera.empty()) return readCamera(source.camera);
  throw InputError(source.path, "camera", "", "is not said by this file: a camera file has to stand beside it");
}

ConvertedProjection readDescribed(const ProjectionSource& source) {
  const YamlNode root = readYaml(source.path);
  YamlMap map(source.path, root, "projection");
  const auto convention = map.find("convention");
  if (!convention) return {{readPose(source.path).T_camera_model, cameraBeside(source)}};
  if (!source.camera.empty()) convention->refuse("says the camera itself: no camera file may stand beside it");
  std::vector<std::string> known;
  for (const Convention& one : kConventions) {
    known.emplace_back(one.key);
    if (convention->text() != one.key) continue;
    try {
      const ConvertedProjection result = one.read(map);
      map.refuseOthers();
      return result;
    } catch (const InputError& error) {
      if (std::string(error.what()).rfind(source.path, 0) == 0) throw;
      throw error.within(source.path);
    }
  }
  convention->refuse("must be one of " + joined(known));
}

// The file says where source and detector are, the camera how the detector's pixels lie.
ConvertedProjection readFromRtk(const ProjectionSource& source) {
  const auto projections = readRtkGeometry(source.path);
  requireBetween(source.path, "projection", source.frame, 0, static_cast<double>(projections.size()) - 1);
  const XrayCamera beside = cameraBeside(source);
  XrayCamera::Parameters grid = beside.parameters();
  if (!grid.pixel_spacing_m) {
    throw InputError(source.camera, "pixel_spacing_mm", "", "is missing: RTK's geometry does not say the pixels");
  }
  const RtkProjection& p = projections[source.frame];
  grid.source_detector_distance_m = 1e-3 * p.source_to_detector_mm;
  grid.fx_px = grid.fy_px = *grid.source_detector_distance_m / *grid.pixel_spacing_m;
  return fromRtk(p, centeredRtkDetector(XrayCamera(grid)), source.world);
}

ConvertedProjection readFromTfm(const ProjectionSource& source) {
  const Pose T_camera_world = poseOf(readTfm(source.path), source.path);
  return {{T_camera_world * T_world_model(source.world, WorldAxes::kLps), cameraBeside(source)}};
}

ConvertedProjection readFromRun(const ProjectionSource& source) {
  if (!source.camera.empty()) {
    throw InputError(source.path, "camera", source.camera, "must not stand beside a DICOM run, which says its own");
  }
  const XaGeometry geometry = XaRun(source.path, source.angle_signs).geometry(source.frame);
  if (geometry.T_camera_patient) return {{*geometry.T_camera_patient, geometry.camera}};
  throw InputError(source.path, "pose", "", "is not said: " + joined(geometry.assumed, 3, "; "));
}

ItkTransformType itkTypeNamed(const std::string& name) {
  if (name == "itk-versor") return ItkTransformType::kVersorRigid3D;
  return name == "itk-affine" ? ItkTransformType::kAffine : ItkTransformType::kEuler3D;
}

const char* commentOf(PictureFlip flip) {
  if (flip == PictureFlip::kLeftRight)
    return "# Of the picture flipped left for right, as it is seen from the detector.\n";
  if (flip == PictureFlip::kUpDown) return "# Of the picture flipped upside down.\n";
  return "";
}

}  // namespace

std::vector<ConventionName> conventionNames() {
  std::vector<ConventionName> names;
  for (const Variant& variant : kVariants) names.push_back({variant.name, variant.words});
  return names;
}

ConvertedProjection readProjection(const ProjectionSource& source) {
  if (hasExtension(source.path, ".xml")) return readFromRtk(source);
  if (hasExtension(source.path, ".tfm")) return readFromTfm(source);
  if (hasExtension(source.path, ".yaml") || hasExtension(source.path, ".yml")) return readDescribed(source);
  if (isDicom(source.path)) return readFromRun(source);
  throw InputError(source.path, "extension", extensionOf(source.path),
                   "must be .yaml, .yml, .xml (RTK), .tfm (ITK), or the file a DICOM run");
}

std::string describeProjection(const std::string& name, const XrayProjection& projection, const WorldFrame& world) {
  const Variant& variant = variantNamed(name);
  const Described described = variant.describe(projection, world);
  nlohmann::ordered_json json = {{"convention", variant.key}};
  for (const auto& [key, value] : described.json.items()) json[key] = value;
  return commentOf(described.flip) + asYaml(json);
}

void writeProjection(const std::string& path, const std::string& name, const XrayProjection& projection,
                     const WorldFrame& world) {
  const Variant& variant = variantNamed(name);
  if (hasExtension(path, ".yaml") || hasExtension(path, ".yml")) {
    if (variant.key == std::string("angio")) return writePose(path, {projection.T_camera_model, {}, ModelId::kUnknown});
    return writeWholeFile(path, describeProjection(name, projection, world));
  }
  if (variant.key == std::string("rtk") && hasExtension(path, ".xml")) {
    return writeRtkGeometry(path, {toRtk(projection, world)});
  }
  if (variant.key == std::string("itk") && hasExtension(path, ".tfm")) {
    const Pose T_camera_world = projection.T_camera_model * T_world_model(world, WorldAxes::kLps).inverse();
    return writeTfm(path, itkTransformOf(T_camera_world, itkTypeNamed(name)));
  }
  throw InputError(path, "extension", extensionOf(path),
                   "must be .yaml or .yml, for rtk also .xml, for itk, itk-versor and itk-affine also .tfm");
}

}  // namespace angio::conventions
