// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/calibration/anatomy_registration.hpp"
#include "angio/calibration/camera_calibration.hpp"
#include "angio/calibration/hand_eye_simulation.hpp"
#include "angio/calibration/pose_set_import.hpp"
#include "angio/calibration/view_set.hpp"
#include "angio/evaluation/case_run.hpp"

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

/// For a person: T_dsa_cb, the runs' shifts, each view against the others. `left_out` names those that were not
/// registered.
std::string anatomyTable(const AnatomyResult& result, const std::vector<CaseOutcome>& outcomes,
                         const std::string& left_out);

/// The views that took part, in one order, and the tree; a view from a centreline has no image.
struct ReportedAnatomy {
  const std::vector<AnatomyView>& views;
  const std::vector<SeenAnatomy>& seen;
  const std::vector<std::optional<std::string>>& image_paths;
  const VesselTree& tree;
};

/// Each view's overlay and how far it is from the others, as pictures and a page with `table`.
void writeAnatomyReport(const std::string& folder, const std::string& cases_path, const AnatomyResult& result,
                        const ReportedAnatomy& anatomy, const std::string& table);

}  // namespace angio::apps
