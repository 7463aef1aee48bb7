// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/calibration_records/carm_calibration.hpp"

namespace angio::calibration_records {

/// What programs take in place of a T_dsa_cb, and what they then say that they assume.
constexpr const char* kCentered = "centre";
constexpr const char* kCenteredAssumption =
    "the tree's x, y, z are taken as the patient's L, P, S (head first, supine), and its centroid at the isocentre";

/// T_dsa_cb of a tree whose axes are the patient's L, P, S and whose centroid [m] lies at the isocentre.
Pose centeredInPatient(const Eigen::Vector3d& centroid_model);

/// Reads a C-arm file for a simulation of a tree that nobody has calibrated: T_dsa_cb is centeredInPatient() and
/// R_lps_model the identity, whatever the file says of them. Throws InputError as readCArmFile does.
CArmCalibration readCenteredCArm(const std::string& path, const Eigen::Vector3d& centroid_model);

}  // namespace angio::calibration_records
