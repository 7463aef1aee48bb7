// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/pose_set.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/calib3d.hpp>
#include <set>
#include <utility>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration_records/pose_fields.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/table.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/yaml.hpp"
#include "hand_eye_problem.hpp"
#include "least_squares.hpp"

namespace angio::calibration {
namespace {

constexpr double kMinFileNoise_px = 1e-6;
constexpr double kWorstFit = 0.05;  // Of the object's size in the image.
constexpr int kSteps = 20;

Pose startOfPattern(const XrayCamera& camera, const Eigen::Matrix3Xd& object, const Eigen::Matrix2Xd& seen) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (Eigen::Index i = 0; i < object.cols(); ++i) {
    points.emplace_back(object(0, i), object(1, i), object(2, i));
    pixels.emplace_back(seen(0, i), seen(1, i));
  }
  const auto& p = camera.parameters();
  const cv::Matx33d K(p.fx_px, 0, p.cx_px, 0, p.fy_px, p.cy_px, 0, 0, 1);
  cv::Vec3d rvec, tvec;
  cv::solvePnP(points, pixels, K, cv::noArray(), rvec, tvec, false, cv::SOLVEPNP_SQPNP);
  Pose T = Pose::Identity();
  T.linear() = expSO3(Eigen::Vector3d(rvec[0], rvec[1], rvec[2]));
  T.translation() = Eigen::Vector3d(tvec[0], tvec[1], tvec[2]);
  return T;
}

// Normal equations of [dt; dw] with T = (t + dt, exp(dw) R).
struct Normal {
  Matrix6d A = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
  double squares = 0;
  bool in_front = true;
};

Normal normalAt(const XrayCamera& camera, const Eigen::Matrix3Xd& object, const Eigen::Matrix2Xd& seen, const Pose& T) {
  Normal n;
  for (Eigen::Index i = 0; i < object.cols(); ++i) {
    const Eigen::Vector3d turned = T.linear() * object.col(i);
    Eigen::Matrix<double, 2, 3> Jp;
    const auto pixel = camera.project(turned + T.translation(), &Jp);
    if (!pixel) {
      n.in_front = false;
      return n;
    }
    Eigen::Matrix<double, 2, 6> J;
    J << Jp, -Jp * skew(turned);
    const Eigen::Vector2d r = seen.col(i) - *pixel;
    n.A += J.transpose() * J;
    n.b += J.transpose() * r;
    n.squares += r.squaredNorm();
  }
  return n;
}

// Root mean square from the mean.
double spread(const Eigen::Ref<const Eigen::MatrixXd>& points) {
  return std::sqrt((points.colwise() - points.rowwise().mean()).squaredNorm() / static_cast<double>(points.cols()));
}

}  // namespace

PoseOfPoints poseOfPoints(const std::string& place, const XrayCamera& camera, const Eigen::Matrix3Xd& points_object_m,
                          const Eigen::Matrix2Xd& points_px) {
  const Eigen::Index count = points_object_m.cols();
  if (count < 4 || points_px.cols() != count) {
    throw InputError(place, "points", std::to_string(count), "must be at least 4, each with its pixel");
  }
  const Eigen::Matrix3Xd centered = points_object_m.colwise() - points_object_m.rowwise().mean();
  const Eigen::Vector3d extent = singularValuesOf(centered).values.head<3>();
  if (!(extent[1] > 1e-3 * extent[0])) throw InputError(place, "points", "", "must not lie in a line");
  PoseOfPoints found{Pose::Identity(), Matrix6d::Zero(), 0};
  try {
    found.T_camera_object = startOfPattern(camera, points_object_m, points_px);
  } catch (const cv::Exception&) {
    throw InputError(place, "points", "", "no pose of the object explains them");
  }
  Normal n = normalAt(camera, points_object_m, points_px, found.T_camera_object);
  for (int step = 0; step < kSteps && n.in_front; ++step) {
    const Pose next = movedBy(found.T_camera_object, solveSymmetric(n.A, n.b));
    const Normal there = normalAt(camera, points_object_m, points_px, next);
    if (!there.in_front || !(there.squares < n.squares)) break;
    found.T_camera_object = next;
    n = there;
  }
  found.rms_px = std::sqrt(n.squares / static_cast<double>(count));
  if (!n.in_front || !(found.rms_px <= kWorstFit * spread(points_px))) {
    throw InputError(place, "points", n.in_front ? formatValue(found.rms_px) + " px from their projection" : "",
                     "no pose of the object explains them: are they in order, and not mirrored?");
  }
  const double freedom = std::max(1.0, static_cast<double>(2 * count - 6));
  const double variance = std::max(n.squares / freedom, kMinFileNoise_px * kMinFileNoise_px);
  found.covariance = variance * inverseOfSymmetric(n.A);
  return found;
}

namespace {

namespace fs = std::filesystem;

constexpr double kNearestObject_m = 0.01, kFarthestObject_m = 20;
constexpr double kSame = 1e-9;  // Two measurements are never so near each other [m, rad].
constexpr std::size_t kMaxPoses = 2000;

PoseSigma readSigma(const std::string& path, const YamlField& field) {
  YamlMap map(path, *field.node, field.key);
  const YamlField rotation = map.need("rotation_deg"), translation = map.need("translation_mm");
  map.refuseOthers();
  return {degToRad(rotation.between(0, 90)), 1e-3 * translation.between(0, 1e3)};
}

void readPoints(const std::string& path, HandEyePose& pose) {
  std::vector<double> seen, object;
  readTable(path, {{"x_px", "y_px", "x_mm", "y_mm", "z_mm"}, {}}, [&](const TableRow& row) {
    for (const char* column : {"x_px", "y_px"}) seen.push_back(row.number(column));
    for (const char* column : {"x_mm", "y_mm", "z_mm"}) {
      object.push_back(1e-3 * requireBetween(row.place(), column, row.number(column), -1e4, 1e4));
    }
  });
  const std::size_t points = seen.size() / 2;
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
  const YamlField list = map.need("poses");
  const std::vector<YamlField> poses = list.items("must be a list of poses");
  if (poses.size() > kMaxPoses) list.refuse("must hold at most " + std::to_string(kMaxPoses));
  PoseReader reader(set, carm);
  for (const YamlField& pose : poses) reader.read(pose);
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
  std::nth_element(distances_m.begin(), distances_m.begin() + distances_m.size() / 2, distances_m.end());
  const double distance_m = distances_m[distances_m.size() / 2];
  if (distance_m < kNearestObject_m || distance_m > kFarthestObject_m) {
    throw InputError(set.path, "T_camera_object.translation_mm",
                     formatValue(1e3 * distance_m) + " from camera to object, median",
                     "must be 10 to 20000 mm: is the file in millimetres?");
  }
}

namespace {

using Json = nlohmann::ordered_json;

Json stdAsJson(const PoseSigma& sigma) {
  return {{"rotation_deg", radToDeg(sigma.rotation_rad)}, {"translation_mm", 1e3 * sigma.translation_m}};
}

std::string tableOfMarks(const HandEyePose& pose) {
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
      writeWholeFile((folder / entry["points"].get<std::string>()).string(), tableOfMarks(pose));
    } else {
      entry["T_camera_object"] = poseAsJson(pose.T_camera_object, pose.covariance);
    }
    file["poses"].push_back(entry);
  }
  writeWholeFile(path, asYaml(file));
}

}  // namespace angio::calibration
