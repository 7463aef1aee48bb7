// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/pose_set.hpp"

#include <algorithm>
#include <filesystem>
#include <set>

#include "angio/base/errors.hpp"
#include "angio/calibration_records/pose_fields.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/table.hpp"
#include "angio/io/yaml.hpp"

namespace angio::calibration {
namespace {

namespace fs = std::filesystem;

constexpr double kNearestObject_m = 0.01, kFarthestObject_m = 20;
constexpr double kSame = 1e-9;  // Two measurements are never so near each other [m, rad].
constexpr int kMaxPoses = 2000;

PoseSigma readSigma(const std::string& path, const YamlField& field) {
  YamlMap map(path, *field.node, field.key);
  PoseSigma sigma;
  const YamlField rotation = map.need("rotation_deg"), translation = map.need("translation_mm");
  sigma.rotation_rad = degToRad(requireBetween(rotation.place(), rotation.key, rotation.number(), 0, 90));
  sigma.translation_m = 1e-3 * requireBetween(translation.place(), translation.key, translation.number(), 0, 1e3);
  map.refuseOthers();
  return sigma;
}

void readPoints(const std::string& path, HandEyePose& pose) {
  std::vector<double> seen, object;
  readTable(path, {{"x_px", "y_px", "x_mm", "y_mm", "z_mm"}, {}}, [&](const TableRow& row) {
    for (const char* column : {"x_px", "y_px"}) seen.push_back(row.number(column));
    for (const char* column : {"x_mm", "y_mm", "z_mm"}) {
      object.push_back(1e-3 * requireBetween(row.place(), column, row.number(column), -1e4, 1e4));
    }
  });
  const auto points = static_cast<Eigen::Index>(seen.size() / 2);
  pose.points_px = Eigen::Map<Eigen::Matrix2Xd>(seen.data(), 2, points);
  pose.points_object_m = Eigen::Map<Eigen::Matrix3Xd>(object.data(), 3, points);
}

class PoseReader {
 public:
  PoseReader(PoseSet& set, const CArmGeometry* carm)
      : set_(set), carm_(carm), folder_(fs::path(set.path).parent_path()) {}

  void read(const YamlField& item) {
    YamlMap map(set_.path, *item.node, item.key);
    HandEyePose pose;
    const YamlField name = map.need("name");
    pose.name = name.text();
    if (!names_.insert(pose.name).second) name.refuse("must be given once");
    readHand(map, pose);
    const auto seen = map.find("T_camera_object"), points = map.find("points");
    if (points) {
      if (!set_.camera) points->refuse("needs the set's camera");
      const std::string path = (folder_ / points->text()).string();
      readPoints(path, pose);
      set_.input_paths.push_back(path);
    }
    if (seen) {
      pose.T_camera_object = readPoseField(set_.path, *seen, &pose.covariance);
    } else if (points) {
      const PoseOfPoints found =
          poseOfPoints(set_.input_paths.back(), *set_.camera, pose.points_object_m, pose.points_px);
      pose.T_camera_object = found.T_camera_object;
      pose.covariance = found.covariance;
    } else {
      map.need("T_camera_object");
    }
    map.refuseOthers();
    set_.poses.push_back(std::move(pose));
  }

 private:
  void readHand(YamlMap& map, HandEyePose& pose) {
    const auto primary = map.find("primary_deg");
    if (!primary) {
      pose.T_base_hand = readPoseField(set_.path, map.need("T_base_hand"), nullptr);
      return;
    }
    if (!carm_) primary->refuse("needs the C-arm's geometry (--carm)");
    if (set_.setup != HandEyeSetup::kEyeInHand) primary->refuse("is for eye_in_hand only: a C-arm carries its camera");
    pose.joints = readJoints(map);
    pose.T_base_hand = carm_->T_camera_patient(*pose.joints).inverse();
  }

  PoseSet& set_;
  const CArmGeometry* carm_;
  fs::path folder_;
  std::set<std::string> names_;
};

bool same(const Pose& a, const Pose& b) {
  return (a.translation() - b.translation()).norm() < kSame &&
         rotationAngle(a.linear().transpose() * b.linear()) < kSame;
}

}  // namespace

std::string setupName(HandEyeSetup setup) { return setup == HandEyeSetup::kEyeInHand ? "eye_in_hand" : "eye_to_hand"; }

PoseSet readPoseSet(const std::string& path, const CArmGeometry* carm) {
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "pose set");
  PoseSet set;
  set.path = path;
  set.input_paths.push_back(path);
  const YamlField setup = map.need("setup");
  if (setup.text() == "eye_to_hand") {
    set.setup = HandEyeSetup::kEyeToHand;
  } else if (setup.text() != "eye_in_hand") {
    setup.refuse("must be eye_in_hand or eye_to_hand");
  }
  if (const auto machine = map.find("machine")) set.machine = machine->text();
  if (const auto sigma = map.find("hand_sigma")) set.hand_std = readSigma(path, *sigma);
  if (const auto sigma = map.find("camera_sigma")) set.camera_std = readSigma(path, *sigma);
  if (const auto camera = map.find("camera")) {
    const std::string camera_path = (fs::path(path).parent_path() / camera->text()).string();
    set.camera = readCamera(camera_path);
    set.input_paths.push_back(camera_path);
  }
  const YamlField poses = map.need("poses");
  if (poses.node->kind != YamlNode::Kind::kSequence) poses.refuse("must be a list of poses");
  if (poses.node->items.size() > kMaxPoses) poses.refuse("must hold at most " + std::to_string(kMaxPoses));
  PoseReader reader(set, carm);
  for (std::size_t i = 0; i < poses.node->items.size(); ++i) reader.read(poses.item(i));
  map.refuseOthers();
  checkPoseSet(set);
  return set;
}

void checkPoseSet(const PoseSet& set) {
  if (set.poses.empty()) throw InputError(set.path, "poses", "", "must hold at least one pose");
  std::vector<double> distances_m;
  for (std::size_t i = 0; i < set.poses.size(); ++i) {
    const HandEyePose& b = set.poses[i];
    distances_m.push_back(b.T_camera_object.translation().norm());
    for (std::size_t k = 0; k < i; ++k) {
      const HandEyePose& a = set.poses[k];
      if (!same(a.T_camera_object, b.T_camera_object)) continue;
      if (same(a.T_base_hand, b.T_base_hand)) {
        throw InputError(set.path, "poses", b.name,
                         "is a copy of " + a.name + ": every pose must be a measurement of its own");
      }
      throw InputError(
          set.path, "poses", b.name,
          "has the very T_camera_object of " + a.name + " though the hand moved: one image was used twice");
    }
  }
  std::nth_element(distances_m.begin(), distances_m.begin() + static_cast<std::ptrdiff_t>(distances_m.size() / 2),
                   distances_m.end());
  const double distance_m = distances_m[distances_m.size() / 2];
  if (distance_m < kNearestObject_m || distance_m > kFarthestObject_m) {
    throw InputError(set.path, "T_camera_object.translation_mm",
                     formatValue(1e3 * distance_m) + " from camera to object, median",
                     "must be 10 to 20000 mm: is the file in millimetres?");
  }
}

}  // namespace angio::calibration
