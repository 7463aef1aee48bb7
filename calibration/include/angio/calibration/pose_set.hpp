// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/calibration/namespace.hpp"
#include "angio/geometry/carm.hpp"

namespace angio::calibration {

/// Where the camera is: on the hand, looking at an object that stands with the base; or standing with the base, looking
/// at an object on the hand.
enum class HandEyeSetup { kEyeInHand, kEyeToHand };

/// "eye_in_hand", "eye_to_hand".
std::string setupName(HandEyeSetup setup);

/// Standard deviations of a pose, per axis.
struct PoseSigma {
  double rotation_rad = 0;
  double translation_m = 0;
};

/// One moment: where the hand was by the machine, and where the camera saw the object.
struct HandEyePose {
  std::string name;
  std::optional<CArmJoints> joints;  ///< What T_base_hand was computed from, for a C-arm.
  Pose T_base_hand = Pose::Identity();
  Pose T_camera_object = Pose::Identity();
  std::optional<Matrix6d> covariance;  ///< Of T_camera_object, as RegistrationResult has it: [m; rad], camera axes.

  /// Points of the object and where they were seen, as many columns; empty when only the pose is known.
  Eigen::Matrix3Xd points_object_m;
  Eigen::Matrix2Xd points_px;
};

/// Moments of one machine with one camera and one object.
struct PoseSet {
  std::string path;     ///< The file itself, for messages.
  std::string machine;  ///< Empty when the file does not say.
  HandEyeSetup setup = HandEyeSetup::kEyeInHand;
  std::optional<PoseSigma> hand_std;    ///< Of T_base_hand, when it is known.
  std::optional<PoseSigma> camera_std;  ///< Of T_camera_object where a pose has no covariance, when it is known.
  std::optional<XrayCamera> camera;     ///< Of the points.
  std::vector<HandEyePose> poses;
  std::vector<std::string> input_paths;  ///< Every file that was read.
};

/// Reads a pose set:
///
///     setup: eye_in_hand                     # or eye_to_hand
///     machine: lab-1                         # optional
///     hand_std: {rotation_deg: 0.02, translation_mm: 0.1}      # optional; 0: exact
///     camera_std: {rotation_deg: 0.1, translation_mm: 0.3}     # optional
///     camera: camera.yaml                    # needed where there are points
///     poses:
///       - name: "01"
///         T_base_hand: {rotation: [9 numbers, row-major], translation_mm: [x, y, z]}
///         T_camera_object: {rotation: [...], translation_mm: [...], covariance: [36 numbers]}   # covariance optional
///         points: p01.csv                    # instead of T_camera_object or beside it: x_px,y_px,x_mm,y_mm,z_mm
///
/// On a C-arm the hand may be given by `primary_deg`, `secondary_deg` and optionally `table_mm` instead of T_base_hand:
/// base is the patient frame with the table at zero and hand the camera as `carm` has it. A pose that is not given is
/// found from its points, with a covariance from their measured scatter. Paths count from the file's folder.
///
/// Throws InputError that names file, line, key, value and rule: unknown or missing keys, names that stand twice, a
/// matrix that is no rotation (mirrored ones are named as such), lengths that only fit a file in other units, poses
/// that are copies of each other, or an image seen twice though the hand moved.
PoseSet readPoseSet(const std::string& path, const CArmGeometry* carm = nullptr);

/// Writes what readPoseSet reads; points go to files beside it, named after the poses. Throws InputError when a file
/// cannot be written.
void writePoseSet(const std::string& path, const PoseSet& set);

/// Throws InputError for poses that no calibration should see, as readPoseSet says.
void checkPoseSet(const PoseSet& set);

/// T_camera_object from points by projection, and its covariance from how they scatter (image noise is the same in all
/// points, at least 1e-6 px). Throws InputError named `place` for fewer than four points, points in a line, and points
/// that no pose in front of the camera explains within 5 % of the object's size in the image.
struct PoseOfPoints {
  Pose T_camera_object;
  Matrix6d covariance;
  double rms_px;
};
PoseOfPoints poseOfPoints(const std::string& place, const XrayCamera& camera, const Eigen::Matrix3Xd& points_object_m,
                          const Eigen::Matrix2Xd& points_px);

/// Reads the samples that MoveIt's hand-eye calibration saves (.json): a list of pairs of 4 x 4 matrices, rows first,
/// metres: T_base_hand and T_camera_object. The file does not say its set-up. Throws InputError that names file, sample
/// and rule.
PoseSet readMoveItSamples(const std::string& path, HandEyeSetup setup);

/// A chessboard by its inner corners. The first is the object's origin, x runs along a row, y along a column.
struct Chessboard {
  int columns = 9;
  int rows = 6;
  double square_m = 0.0236;
};

/// Reads a folder as ViSP's calibration programs write it, eye in hand: images `franka_image-%d.png`, hands
/// `franka_pose_rPe_%d.yaml` (metres and rotation vector) from number 1 on, and `franka_camera.xml`. Finds the corners
/// of the chessboard to a fraction of a pixel, and from them the poses. Throws InputError that names the file: what
/// cannot be read, an image in which the board is not found, no image at all.
PoseSet readVispFolder(const std::string& folder, const Chessboard& board);

}  // namespace angio::calibration
