// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/calibration/camera_calibration.hpp"
#include "angio/calibration/hand_eye.hpp"
#include "angio/calibration/pose_set.hpp"
#include "angio/calibration/view_set.hpp"
#include "angio/calibration_records/carm_calibration.hpp"

namespace angio::apps {

/// For a person: values and their standard deviations, residuals, condition, weak directions, what was left out.
std::string cameraTable(const CameraCalibration& result);

/// The camera file with its record, which names `views`, the hashes of the views' files. Throws InputError when it
/// cannot be written.
void writeCalibratedCamera(const std::string& path, const CameraCalibration& result, const ViewSet& set,
                           const std::vector<CalibrationInput>& views);

/// Pictures and a page (index.html) of them: each view's beads as seen and as projected, the residuals over the
/// detector, enlarged, and where on the detector beads were seen; overview.jpg shows one of each. Makes the folder.
/// Throws InputError when it cannot be written.
void writeCameraReport(const std::string& folder, const CameraCalibration& result, const ViewSet& set);

/// A transform for a person, two lines: translation and rotation vector, each number with its sigma.
std::string transformRow(const std::string& name, const Pose& T, const Eigen::MatrixXd& covariance);

/// The result for a person: values with sigmas, residuals, condition, weak directions, outliers.
std::string handEyeTable(const PoseSet& set, const HandEyeSettings& settings, const HandEyeResult& result,
                         bool patient);

/// X against a pose of a file. Throws InputError for a file that is none.
std::string referenceTable(const std::string& path, HandEyeSetup setup, const HandEyeResult& result);

/// Other solvers' residuals on the same poses, and how far their X is from the result.
std::string comparisonTable(const PoseSet& set, const HandEyeResult& result);

/// Residuals of the poses, the axes that the hand turned about, and the covariance, as pictures and a page with
/// `table`.
void writeHandEyeReport(const std::string& folder, const PoseSet& set, const HandEyeResult& result,
                        const std::string& table);

/// Both transforms and the record, for set-ups that are no C-arm.
void writeHandEyeFile(const std::string& path, const PoseSet& set, const HandEyeSettings& settings,
                      const HandEyeResult& result, const CalibrationRecord& record);

/// Writes a C-arm file with T_dsa_cb and its record, in the place of an older one of its kind; the machine is the
/// record's where the file names none.
void writePatient(const std::string& path, CArmFile carm, const Pose& T_dsa_cb, const CalibrationRecord& record);

}  // namespace angio::apps
