// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/calibration/anatomy_registration.hpp"
#include "angio/calibration/hand_eye_simulation.hpp"
#include "angio/calibration/pose_set_import.hpp"

namespace angio {

/// A transform for a person, two lines: translation and rotation vector, each number with its sigma.
std::string transformRow(const std::string& name, const Pose& T, const Eigen::MatrixXd& covariance);

/// The result for a person: values with sigmas, residuals, condition, weak directions, outliers.
std::string handEyeTable(const PoseSet& set, const HandEyeSettings& settings, const HandEyeResult& result,
                         bool patient);

/// X against a pose of a file. Throws InputError for a file that is none.
std::string referenceTable(const std::string& path, HandEyeSetup setup, const HandEyeResult& result);

/// Other solvers' residuals on the same poses, and how far their X is from the result.
std::string comparisonTable(const PoseSet& set, const HandEyeResult& result);

/// Errors over simulated trials, and with `compare` those of the other solvers.
std::string trialsTable(const CArmGeometry& carm, const OrbitSettings& orbit, const HandEyeSettings& settings,
                        int trials, int seed, bool compare);

/// Residuals of the poses, the axes that the hand turned about, and the covariance, as pictures and a page with
/// `table`.
void writeHandEyeReport(const std::string& folder, const PoseSet& set, const HandEyeResult& result,
                        const std::string& table);

/// Both transforms and the record, for set-ups that are no C-arm.
void writeHandEyeFile(const std::string& path, const PoseSet& set, const HandEyeSettings& settings,
                      const HandEyeResult& result, const CalibrationRecord& record);

/// T_dsa_cb, the shifts of the runs and the record, where there is no C-arm file.
void writePatientFile(const std::string& path, const Pose& T_dsa_cb, const AnatomyResult& result,
                      const CalibrationRecord& record);

/// Puts a record in the place of an older one of its kind.
void replaceRecord(std::vector<CalibrationRecord>& records, const CalibrationRecord& record);

}  // namespace angio
