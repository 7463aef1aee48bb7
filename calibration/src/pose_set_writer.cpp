// SPDX-License-Identifier: GPL-2.0-or-later
#include <filesystem>

#include "angio/base/formatted.hpp"
#include "angio/calibration/pose_set.hpp"
#include "angio/calibration_records/pose_fields.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::calibration {
namespace {

using Json = nlohmann::ordered_json;

Json stdAsJson(const PoseSigma& sigma) {
  return {{"rotation_deg", radToDeg(sigma.rotation_rad)}, {"translation_mm", 1e3 * sigma.translation_m}};
}

std::string tableOf(const HandEyePose& pose) {
  std::string table = "x_px,y_px,x_mm,y_mm,z_mm\n";
  for (Eigen::Index i = 0; i < pose.points_px.cols(); ++i) {
    // A thousandth of a pixel is finer than any detector of points.
    table += formatted("%.3f,%.3f", pose.points_px(0, i), pose.points_px(1, i));
    for (int k = 0; k < 3; ++k) table += "," + exactMillimetres(pose.points_object_m(k, i));
    table += "\n";
  }
  return table;
}

}  // namespace

void writePoseSet(const std::string& path, const PoseSet& set) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  Json file;
  file["setup"] = setupName(set.setup);
  if (!set.machine.empty()) file["machine"] = set.machine;
  if (set.hand_std) file["hand_sigma"] = stdAsJson(*set.hand_std);
  if (set.camera_std) file["camera_sigma"] = stdAsJson(*set.camera_std);
  if (set.camera) {
    file["camera"] = "camera.yaml";
    writeCamera((folder / "camera.yaml").string(), *set.camera);
  }
  for (const HandEyePose& pose : set.poses) {
    Json entry = {{"name", pose.name}};
    if (pose.joints) {
      entry["primary_deg"] = radToDeg((*pose.joints)[0]);
      entry["secondary_deg"] = radToDeg((*pose.joints)[1]);
      entry["table_mm"] = matrixAsJson(1e3 * pose.joints->tail<3>());
    } else {
      entry["T_base_hand"] = poseAsJson(pose.T_base_hand);
    }
    if (pose.points_px.cols() > 0) {
      entry["points"] = "points_" + pose.name + ".csv";
      writeWholeFile((folder / entry["points"].get<std::string>()).string(), tableOf(pose));
    } else {
      entry["T_camera_object"] = poseAsJson(pose.T_camera_object, pose.covariance);
    }
    file["poses"].push_back(entry);
  }
  writeWholeFile(path, asYaml(file));
}

}  // namespace angio::calibration
