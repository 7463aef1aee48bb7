// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/calibration/pose_set.hpp"

namespace angio::calibration {

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
