// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/calibration/namespace.hpp"
#include "angio/calibration_records/record.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/vessel/centerline2d.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::calibration {

/// One view in which the model was registered, with what the C-arm said of it.
struct AnatomyView {
  std::string name;
  std::string run;                           ///< Views of one run share the isocentre's place in the patient.
  Pose T_camera_patient = Pose::Identity();  ///< By the C-arm's angles and table.
  Eigen::Vector3d isocenter_camera_m = Eigen::Vector3d::Zero();  ///< About which the C-arm turns.
  Pose T_camera_model = Pose::Identity();                        ///< As registered, on its own.
  Matrix6d covariance = Matrix6d::Zero();                        ///< Of it, as RegistrationResult has it.
};

/// Expected spreads of a calibration of T_dsa_cb by registered runs, and when a view is an outlier.
struct AnatomyRegistrationSettings {
  double angle_std_deg = 0.5;
  double shift_std_mm = 30;
  double outlier_gate = 4.5;  ///< A view further off than so many sigma (of six dimensions) is an outlier.

  void visit(SettingsVisitor& v) {
    v.number("angle_std_deg", angle_std_deg, 1e-4, 30,
             "Standard deviation of the C-arm's angles, per axis: C-arms hold about a degree");
    v.number("shift_std_mm", shift_std_mm, 0, 1000,
             "Standard deviation of the isocentre from run to run, per axis; 0: it stays");
    v.fixed("outlier_gate", outlier_gate, 2, 100);
  }
};

/// One view against what all of them say together.
struct AnatomyViewFit {
  std::string name;
  double rotation_rad = 0;   ///< Between the registered pose and the joint one by the C-arm's angles.
  double translation_m = 0;  ///< The same, at the model's centre.
  double sigmas = 0;         ///< Distance by the noise, of six dimensions.
  bool outlier = false;
  std::optional<double> held_out_rotation_rad;  ///< Of its rotation as the other views predict it.
};

/// Where the isocentre of a run lies in the patient, against the mean of the runs.
struct RunShift {
  std::string run;
  Eigen::Vector3d shift_m;  ///< Moves the patient, patient axes: p_iso = T_dsa_cb p + shift.
  Eigen::Matrix3d covariance;
};

/// T_dsa_cb by registered runs, how certain it is, and how each run and view fits it.
struct AnatomyResult {
  Pose T_dsa_cb = Pose::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< [m; rad], patient axes; of the mean over runs.
  std::vector<RunShift> runs;
  std::vector<AnatomyViewFit> views;
  double chi2_per_freedom = 1;
  std::optional<double> held_out_rotation_rms_rad;
};

/// Finds the one T_dsa_cb, and a shift per run, with which the C-arm's angles explain all registered views:
/// T_camera_model = T_camera_patient Trans(shift of the run) T_dsa_cb, up to each registration's covariance and to
/// errors of the angles, which turn the C-arm about its isocentre.
///
/// `centre_model` is the model's centre [m]. Views that disagree with the others (a registration that is reversed in
/// depth, say) are outliers. Each view is also predicted from the others where there are three or more. Throws
/// InputError for no view, names that stand twice, copies of a view, and when less than half of the views agree.
AnatomyResult registerAnatomy(const std::vector<AnatomyView>& views, const Eigen::Vector3d& center_model,
                              const AnatomyRegistrationSettings& settings = {});

/// A view as it was seen, for refineAnatomy.
struct SeenAnatomy {
  Centerline2d centerline;
  XrayCamera camera;
};

/// The same estimate, made anew on the image points of all views at once, from where `result` stands: each point is
/// matched with the nearest projected vessel that runs the same way, again and again. `seen` has an entry for each
/// view. Outliers stay out.
AnatomyResult refineAnatomy(const AnatomyResult& result, const std::vector<AnatomyView>& views,
                            const std::vector<SeenAnatomy>& seen, const VesselTree& tree,
                            const AnatomyRegistrationSettings& settings = {});

/// The result as it goes into a file's section `calibration`; lengths in mm, angles in deg, turns about patient axes.
CalibrationRecord anatomyRecord(const AnatomyResult& result, const std::string& machine,
                                const std::vector<std::string>& input_paths);

/// What the C-arm said of one view.
struct AnatomyAngles {
  std::string name;  ///< Of the case.
  std::string run;   ///< The name, when nobody said.
  CArmJoints joints = CArmJoints::Zero();
  std::optional<double> source_isocenter_distance_m;
};

/// Angles of a case set's views.
struct AnatomyAngleSet {
  std::string machine;  ///< Empty when the file does not say.
  std::vector<AnatomyAngles> views;
};

/// Reads angles:
///
///     machine: lab-1                        # optional
///     source_isocentre_distance_mm: 720     # optional with a C-arm file; a view may have its own
///     views:
///       - name: "im1"                       # of the case
///         primary_deg: 31.3                 # DICOM (0018,1510): + is LAO
///         secondary_deg: 0.1                # DICOM (0018,1511): + is CRA
///         table_mm: [0, 0, 0]               # optional
///         run: "1"                          # optional: views of one run share the isocentre
///
/// Throws InputError that names file, line, key, value and rule.
AnatomyAngleSet readAnatomyAngles(const std::string& path);

/// The same of a DICOM run's frame. Throws InputError when its attributes do not tell.
AnatomyAngles dicomAngles(const std::string& name, const std::string& path, int frame = 0);

}  // namespace angio::calibration
