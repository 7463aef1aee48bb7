// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>

#include "angio/geometry/se3.hpp"

namespace angio::geometry {

/// One smooth bend of the arm over its angles: a twist of the camera, camera axes [m, rad], that grows as
/// sin(frequency_primary * primary + frequency_secondary * secondary + phase) - sin(phase).
struct CArmFlexTerm {
  Twist twist = Twist::Zero();
  double frequency_primary = 0;    ///< Waves in a turn of the primary angle.
  double frequency_secondary = 0;  ///< Waves in a turn of the secondary angle.
  double phase_rad = 0;

  /// How much of the twist there is at these angles [rad].
  double wave(double primary_rad, double secondary_rad) const;
};

/// How the arm bends under its own weight: a sum of terms, none at both angles zero.
struct CArmFlex {
  static constexpr int kMaxTerms = 12;

  std::array<CArmFlexTerm, kMaxTerms> terms;
  int count = 0;  ///< Terms that are used.

  /// Twist of the camera [m, rad] at these angles [rad], and its derivatives by them.
  Twist at(double primary_rad, double secondary_rad) const;
  Eigen::Matrix<double, 6, 2> derivatives(double primary_rad, double secondary_rad) const;

  /// The terms that a calibration estimates: sine and cosine of a, b, a + b, a - b, 2a and 2b, for primary a and
  /// secondary b. Their twists are zero.
  static CArmFlex lowOrder();
};

/// How a real C-arm differs from the ideal one. All zero (and `table` the identity): the ideal one.
///
/// The chain from the patient frame to the camera, with encoder angles a and b and encoder table position t:
///
///     T_patient-on-table   Trans(table * t)
///     primary axis         z of the frame iso, through its origin, turned by a + primary_offset
///     gap, skew            along y and about y of the turned frame: how the secondary axis lies against the primary
///     secondary axis       -x of that frame, turned by b + secondary_offset
///     mount                the camera on the arm: source_right, source_down and the distance from source to isocentre;
///                          turns about the image's down axis (detector_turn) and then about the beam (detector_roll)
///     flex                 exp(twist(a, b)), camera axes
///
/// No two of these numbers do the same, for the frame is tied to the machine: its z is the primary axis, its origin the
/// point of that axis that is nearest to the secondary one, and its x lies in the plane of z and the table's first
/// column, so that table(1, 0) is zero. Without a moving table primary_offset has no meaning and stays zero.
struct CArmDeviations {
  double primary_offset_rad = 0;    ///< Of the encoder: true angle less the encoder's.
  double secondary_offset_rad = 0;  ///< The same.
  double axis_skew_rad = 0;         ///< How far the axes are from perpendicular.
  double axis_gap_m = 0;      ///< Between the axes, along their common perpendicular; + is posterior at angle zero.
  double source_right_m = 0;  ///< Of the source from where the ideal arm has it, camera axes.
  double source_down_m = 0;
  double detector_turn_rad = 0;
  double detector_roll_rad = 0;
  Eigen::Matrix3d table = Eigen::Matrix3d::Identity();  ///< Columns: how the patient moves per metre of each encoder.

  double source_detector_offset_m = 0;                                       ///< True distance less the encoder's.
  double pixel_aspect = 0;                                                   ///< fy / fx - 1.
  Eigen::Vector2d principal_point_px = Eigen::Vector2d::Zero();              ///< From the detector's centre.
  Eigen::Vector2d principal_point_slope_px_per_m = Eigen::Vector2d::Zero();  ///< By the source-detector distance.
  CArmFlex flex;

  /// Whether anything here moves the camera. What only concerns its image does not count.
  bool movesCamera() const;
};

/// Of the numbers above that place the camera, one: what it is called in files and how large a unit of the file is.
struct CArmParameter {
  const char* name;  ///< "secondary_offset_deg".
  double unit;       ///< Of the file, in radians, metres or nothing.
};

/// In this order: primary and secondary offset, skew, gap, source right and down, source-isocentre distance, detector
/// turn and roll, and the table's entries but (1, 0), column by column.
constexpr int kCArmPoseParameters = 17;
constexpr int kPrimaryOffsetParameter = 0, kSourceIsocenterParameter = 6, kFirstTableParameter = 9;
extern const std::array<CArmParameter, kCArmPoseParameters> kCArmPoseParameterNames;

}  // namespace angio::geometry
