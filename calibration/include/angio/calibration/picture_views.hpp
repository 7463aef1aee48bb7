// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/calibration/bead_detection.hpp"
#include "angio/calibration/camera_calibration.hpp"
#include "angio/calibration/uncoded_phantom.hpp"
#include "angio/geometry/distortion.hpp"

namespace angio::calibration {

/// What somebody knows of a picture.
struct PictureHint {
  std::vector<BeadDetection> known_beads;  ///< Places in the picture, each with its bead's number.
  std::optional<Pose> T_near;              ///< The phantom's pose, roughly.
  bool any_reading = false;                ///< Of readings that fit equally well any will do, if they agree about K.
};

/// A picture of a phantom of equal beads, with each bead named.
struct PictureView {
  BeadView view;                          ///< Its name is the picture's path.
  std::vector<BeadDetection> detections;  ///< All, in the picture as it is; numbered where they are beads.
  std::size_t readings = 0;               ///< How many fit equally well, without those of a mirrored picture.
  PhantomReading reading;                 ///< The one that was taken.
};

/// Finds the beads of a picture (CV_8UC1 or CV_16UC1) and which is which; shadows that are much larger, smaller, darker
/// or fainter than most are no beads. Throws InputError as readingsOf() and chosenReading() do, and with
/// `any_reading` when readings that fit equally well differ in K by more than a hundredth.
PictureView readPicture(const std::string& path, const cv::Mat& picture, const BeadPhantom& phantom,
                        const std::optional<DetectorDistortion>& distortion, const BeadDetectionSettings& settings,
                        const PictureHint& hint);

/// Where a second camera stands against a first, by what both have seen of one phantom that has not moved.
struct RelativePose {
  Pose T_second_first = Pose::Identity();  ///< First camera's frame to the second's [m].
  /// A change of its translation [m] and a small turn about the second camera's axes [rad].
  Matrix6d covariance = Matrix6d::Zero();
};

/// The relative pose of two calibrated views; their errors are independent but for what both have of the phantom's
/// shifted plates, whose covariance is that of `plates`. Both must have a covariance.
RelativePose relativePose(const CalibratedView& first, const CalibratedView& second, const PlateShifts& plates = {});

}  // namespace angio::calibration
