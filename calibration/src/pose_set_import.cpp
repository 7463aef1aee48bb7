// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/pose_set.hpp"

#include <visp3/core/vpXmlParserCamera.h>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/geometry/visp.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/yaml.hpp"
#include "silence.hpp"

namespace angio::calibration {
namespace {

constexpr std::size_t kMaxSamples = std::size_t{64} << 20;

// A 4 x 4 matrix of a JSON file as a pose.
Pose poseOfRows(const std::string& place, const std::string& field, const nlohmann::json& rows) {
  Eigen::Matrix4d M;
  bool good = rows.is_array() && rows.size() == 4;
  for (std::size_t r = 0; good && r < 4; ++r) {
    good = rows[r].is_array() && rows[r].size() == 4;
    for (std::size_t c = 0; good && c < 4; ++c) {
      good = rows[r][c].is_number();
      if (good) M(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) = rows[r][c].get<double>();
    }
  }
  if (!good) throw InputError(place, field, "", "must be four rows of four numbers");
  const Eigen::Matrix3d R = M.topLeftCorner<3, 3>();
  if (!M.allFinite() || !(rotationDefect(R) < 1e-3) || !(M.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).isZero(1e-9)) {
    throw InputError(place, field, "", "must be a rotation and a translation, with 0 0 0 1 as the last row");
  }
  Pose T = Pose::Identity();
  T.linear() = nearestRotation(R);
  T.translation() = M.topRightCorner<3, 1>();
  return T;
}

// ViSP's vpPoseVector as YAML: rows: 6, cols: 1, data: [[tx], ...] in metres and radians.
Pose readPoseVector(const std::string& path) {
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "pose vector");
  const YamlField rows = map.need("rows"), columns = map.need("cols"), data = map.need("data");
  if (rows.integer() != 6) rows.refuse("must be 6");
  if (columns.integer() != 1) columns.refuse("must be 1");
  map.refuseOthers();
  if (data.node->kind != YamlNode::Kind::kSequence || data.node->items.size() != 6) data.refuse("must be six rows");
  Vector6d v;
  for (std::size_t k = 0; k < 6; ++k) v[k] = data.item(k).numbers(1)[0];
  Pose T = Pose::Identity();
  T.linear() = expSO3(v.tail<3>());
  T.translation() = v.head<3>();
  return T;
}

// ViSP's programs write the model with distortion also where there is none.
XrayCamera readVispCamera(const std::string& path, const cv::Mat& image) {
  readWholeFile(path);  // For its own refusals.
  vpXmlParserCamera parser;
  vpCameraParameters camera;
  const auto holds = [&](vpCameraParameters::vpCameraParametersProjType model) {
    const Silence silence;
    return parser.parse(camera, path, "Camera", model) == vpXmlParserCamera::SEQUENCE_OK;
  };
  if (!holds(vpCameraParameters::perspectiveProjWithDistortion) &&
      !holds(vpCameraParameters::perspectiveProjWithoutDistortion)) {
    throw InputError(path, "camera", "", "must hold ViSP's parameters of a camera named Camera");
  }
  if (camera.get_kud() != 0) throw InputError(path, "kud", formatValue(camera.get_kud()), "must be zero");
  vpCameraParameters plain;
  plain.initPersProjWithoutDistortion(camera.get_px(), camera.get_py(), camera.get_u0(), camera.get_v0());
  return fromVisp(plain, image.cols, image.rows);
}

void findCorners(const std::string& path, const Chessboard& board, const XrayCamera& camera, HandEyePose& pose) {
  const cv::Mat image = readXrayImage(path, camera);
  if (image.type() != CV_8UC1) throw InputError(path, "image", "", "must have 8 bits");
  std::vector<cv::Point2f> corners;
  if (!cv::findChessboardCorners(image, {board.columns, board.rows}, corners,
                                 cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE)) {
    throw InputError(path, "chessboard", std::to_string(board.columns) + " x " + std::to_string(board.rows),
                     "was not found");
  }
  cv::cornerSubPix(image, corners, {11, 11}, {-1, -1},
                   cv::TermCriteria(cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 100, 1e-4));
  pose.points_px.resize(2, static_cast<Eigen::Index>(corners.size()));
  pose.points_object_m.resize(3, static_cast<Eigen::Index>(corners.size()));
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i), columns = static_cast<Eigen::Index>(board.columns);
    pose.points_px.col(at) << corners[i].x, corners[i].y;
    pose.points_object_m.col(at) << board.square_m * static_cast<double>(at % columns),
        board.square_m * static_cast<double>(at / columns), 0;
  }
}

}  // namespace

PoseSet readMoveItSamples(const std::string& path, HandEyeSetup setup) {
  PoseSet set;
  set.path = path;
  set.setup = setup;
  set.input_paths.push_back(path);
  const auto samples = nlohmann::json::parse(readWholeFile(path, kMaxSamples), nullptr, false);
  if (!samples.is_array() || samples.empty())
    throw InputError(path, "samples", "", "must be a list of pairs of matrices (JSON)");
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const std::string name = formatted("%02zu", i + 1), place = path + ": sample " + name;
    if (!samples[i].is_array() || samples[i].size() != 2) throw InputError(place, "", "", "must be a pair of matrices");
    HandEyePose pose;
    pose.name = name;
    pose.T_base_hand = poseOfRows(place, "T_base_hand", samples[i][0]);
    pose.T_camera_object = poseOfRows(place, "T_camera_object", samples[i][1]);
    set.poses.push_back(std::move(pose));
  }
  checkPoseSet(set);
  return set;
}

PoseSet readVispFolder(const std::string& folder, const Chessboard& board) {
  const std::filesystem::path at(folder);
  PoseSet set;
  set.path = folder;
  set.input_paths.push_back((at / "franka_camera.xml").string());
  for (int number = 1;; ++number) {
    const std::string image = (at / formatted("franka_image-%d.png", number)).string();
    if (!std::filesystem::exists(image)) break;
    if (!set.camera) set.camera = readVispCamera(set.input_paths.front(), readXrayImage(image));
    HandEyePose pose;
    pose.name = std::to_string(number);
    set.input_paths.push_back(image);
    set.input_paths.push_back((at / formatted("franka_pose_rPe_%d.yaml", number)).string());
    pose.T_base_hand = readPoseVector(set.input_paths.back());
    findCorners(image, board, *set.camera, pose);
    const PoseOfPoints found = poseOfPoints(image, *set.camera, pose.points_object_m, pose.points_px);
    pose.T_camera_object = found.T_camera_object;
    pose.covariance = found.covariance;
    set.poses.push_back(std::move(pose));
  }
  if (set.poses.empty()) throw InputError(folder, "franka_image-1.png", "", "is not there");
  checkPoseSet(set);
  return set;
}

}  // namespace angio::calibration
