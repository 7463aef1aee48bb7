// SPDX-License-Identifier: GPL-2.0-or-later
#include "inspect_conversion.hpp"

#include <iostream>

#include "angio/base/errors.hpp"
#include "angio/base/joined.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/further_options.hpp"
#include "angio/cli/program.hpp"
#include "angio/conventions/carm_urdf.hpp"
#include "angio/conventions/projection_files.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::apps {
namespace {

WorldFrame worldOf(const PoseToConvert& o) {
  WorldFrame world;
  if (o.model_axes == "RAS") world.model_axes = ModelAxes::kRas;
  if (o.model_axes == "world") world.model_axes = ModelAxes::kWorld;
  for (std::size_t k = 0; k < o.isocentre_mm.size(); ++k) {
    world.isocenter_mm[static_cast<Eigen::Index>(k)] =
        requireBetween("--isocentre-mm", "value " + std::to_string(k + 1), o.isocentre_mm[k], -1e5, 1e5);
  }
  return world;
}

}  // namespace

void addConversionOptions(cli::Command& app, PoseToConvert& o, const cli::Option* file) {
  std::vector<std::string> names;
  for (const ConventionName& one : conventionNames()) names.push_back(one.name);
  auto* convert =
      app.addOption(
             "--convert-pose", o.convention,
             "Pose and camera that the file says as another program writes them, to --out or stdout: " + joined(names))
          ->needs(file);
  for (const char* other : {"--json", "--picture", "--calibration"}) convert->excludes(other);
  app.addOption("--camera", o.camera, "With --convert-pose: of a pose, an RTK geometry or a .tfm (.yaml, .xml)")
      ->needs(convert)
      ->group(cli::kFurtherOptions);
  app.addOption("--model-axes", o.model_axes,
                "With --convert-pose: axes of the model's file; world: those of the other program's world")
      ->check(cli::oneOf({"LPS", "RAS", "world"}))
      ->needs(convert)
      ->group(cli::kFurtherOptions);
  app.addOption(
         "--isocentre-mm", o.isocentre_mm,
         "With --convert-pose: x,y,z of the model's point at the other program's isocentre or volume centre [mm]")
      ->delimiter(',')
      ->expected(3)
      ->needs(convert)
      ->group(cli::kFurtherOptions);
}

void convertPose(const PoseToConvert& o, const std::string& file, int frame, XaAngleSigns angle_signs,
                 const std::string& out, const std::string& write_camera) {
  requireFolderOf(out);
  const WorldFrame world = worldOf(o);
  const ConvertedProjection seen = readProjection({file, o.camera, frame, world, angle_signs});
  const std::string described = describeProjection(o.convention, seen.projection, world);
  if (seen.flip != PictureFlip::kNone) {
    std::cerr << file << ": its picture has to be flipped "
              << (seen.flip == PictureFlip::kLeftRight ? "left for right" : "upside down")
              << " to be the one as seen from the source, of which the result is\n";
  }
  if (out.empty()) {
    std::cout << described;
  } else {
    writeProjection(out, o.convention, seen.projection, world);
  }
  if (!write_camera.empty()) writeCamera(write_camera, seen.projection.camera);
}

void addUrdfOption(cli::Command& app, std::string& out, const cli::Option* file) {
  app.addOption("--write-urdf", out,
                "Of a C-arm file (carm.yaml): the calibrated arm and its table as a robot description, with the limits "
                "of a typical machine (.urdf)")
      ->needs(file)
      ->excludes("--convert-pose");
}

void writeUrdf(const std::string& carm_file, const std::string& out) {
  const CArmFile file = readCArmFile(carm_file);
  const CArmUrdf urdf = carmAsUrdf(file.carm, CArmLimits::typical(), file.machine);
  writeWholeFile(out, urdf.text);
  if (urdf.left_out_mm == 0 && urdf.left_out_deg == 0) return;
  std::cerr << out << ": lacks the arm's bending, which moves the camera by up to " << formatValue(urdf.left_out_mm)
            << " mm and " << formatValue(urdf.left_out_deg) << " deg\n";
}

}  // namespace angio::apps
