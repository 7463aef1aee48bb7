// SPDX-License-Identifier: GPL-2.0-or-later
#include "xa_geometry.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "xa_camera.hpp"
#include "xa_tags.hpp"

namespace angio::io {
namespace {

// Angles of the two conventions that differ by more are no rounding [rad].
const double kAgreement_rad = degToRad(2);

std::vector<double> readIncrement(const DicomFile& file, const DicomTag& tag, int frames) {
  auto values = file.numbers(tag);
  if (values.size() > 1 && values.size() != static_cast<std::size_t>(frames)) {
    throw file.refusal(tag, std::to_string(values.size()) + " values",
                       "must be one value, or one for each of " + std::to_string(frames) + " frames");
  }
  return values;
}

// PS3.3 C.8.7.5.1.3: one value is the change from frame to frame, many are offsets from the first frame.
double incrementAt(const std::vector<double>& increments, int frame) {
  if (increments.empty()) return 0;
  return increments.size() == 1 ? frame * increments.front() : increments[frame];
}

std::optional<double> angle(const DicomFile& file, const DicomTag& tag, int frame, double max_deg) {
  const auto angle_deg = file.number(tag, frame);
  if (!angle_deg) return std::nullopt;
  return degToRad(requireBetween(file.path(), tag.label(), *angle_deg, -max_deg, max_deg));
}

std::optional<PatientPosition> patientPosition(const DicomFile& file, int frame, Lines& assumed) {
  constexpr std::array<const char*, 8> kNames = {"HFS", "HFP", "HFDL", "HFDR", "FFS", "FFP", "FFDL", "FFDR"};
  const auto name = file.text(tag::kPatientPosition, frame);
  if (!name) {
    assumed.push_back(missing(tag::kPatientPosition, "HFS, head first and supine"));
    return PatientPosition::kHeadFirstSupine;
  }
  const auto found = std::find(kNames.begin(), kNames.end(), *name);
  if (found != kNames.end()) return static_cast<PatientPosition>(found - kNames.begin());
  assumed.push_back(tag::kPatientPosition.label() + " = " + *name +
                    " is not one of HFS, HFP, HFDL, HFDR, FFS, FFP, FFDL, FFDR: angles stay in the file's convention");
  return std::nullopt;
}

TableAngles readTableAngles(const DicomFile& file, int frame) {
  TableAngles table;
  table.horizontal_rotation_rad = angle(file, tag::kTableRotation, frame, 360).value_or(0);
  const auto tilt = angle(file, tag::kTableHeadTilt, frame, 90);
  table.head_tilt_rad = tilt ? *tilt : angle(file, tag::kTableAngle, frame, 90).value_or(0);
  table.cradle_tilt_rad = angle(file, tag::kTableCradleTilt, frame, 90).value_or(0);
  return table;
}

std::optional<ViewAngles> readPatientAngles(const DicomFile& file, const XaIncrements& increments, int frame,
                                            XaAngleSigns signs, Lines& assumed) {
  const auto primary = angle(file, tag::kPrimary, frame, 360), secondary = angle(file, tag::kSecondary, frame, 360);
  if (!primary && !secondary) return std::nullopt;
  if (!primary) assumed.push_back(missing(tag::kPrimary, "0 deg"));
  if (!secondary) assumed.push_back(missing(tag::kSecondary, "0 deg"));
  const bool rao = signs == XaAngleSigns::kRaoCra || signs == XaAngleSigns::kRaoCau;
  const bool cau = signs == XaAngleSigns::kLaoCau || signs == XaAngleSigns::kRaoCau;
  if (rao || cau) {
    assumed.push_back(tag::kPrimary.label() + " and " + tag::kSecondary.label() + ": + is taken as " +
                      (rao ? "RAO and " : "LAO and ") + (cau ? "CAU" : "CRA") + ", as is asked for");
  }
  const double primary_rad = primary.value_or(0) + degToRad(incrementAt(increments.primary_deg, frame));
  const double secondary_rad = secondary.value_or(0) + degToRad(incrementAt(increments.secondary_deg, frame));
  return ViewAngles{rao ? -primary_rad : primary_rad, cau ? -secondary_rad : secondary_rad};
}

std::optional<IsocenterAngles> readIsocenterAngles(const DicomFile& file, int frame, Lines& assumed) {
  const auto primary = angle(file, tag::kIsocenterPrimary, frame, 360);
  const auto secondary = angle(file, tag::kIsocenterSecondary, frame, 360);
  const auto detector = angle(file, tag::kDetectorRotation, frame, 360);
  if (!primary || !secondary) return std::nullopt;
  if (!detector) assumed.push_back(missing(tag::kDetectorRotation, "0 deg"));
  return IsocenterAngles{*primary, *secondary, detector.value_or(0)};
}

// Where the table's reference point is, in the equipment's axes [m]; nothing when the file does not say.
std::optional<Eigen::Vector3d> tablePosition(const DicomFile& file, int frame) {
  const auto x = file.number(tag::kTableX, frame), y = file.number(tag::kTableY, frame),
             z = file.number(tag::kTableZ, frame);
  if (!x || !y || !z) return std::nullopt;
  return 1e-3 * Eigen::Vector3d(*x, *y, *z);
}

// The table's motion since the first frame, in the patient's axes.
Eigen::Vector3d tableShift(const DicomFile& file, const XaIncrements& increments, int frame,
                           const Eigen::Matrix3d& R_isocenter_patient, Lines& assumed) {
  if (const auto now = tablePosition(file, frame)) {
    return R_isocenter_patient.transpose() * (*now - tablePosition(file, 0).value_or(*now));
  }
  if (increments.longitudinal_mm.empty() && increments.lateral_mm.empty() && increments.vertical_mm.empty()) {
    return Eigen::Vector3d::Zero();
  }
  // PS3.3 C.8.7.4.1: in words that are the wrong way round for a table's length, but these are the standard's.
  assumed.push_back(
      "the table's increments are taken as the standard has them: longitudinal towards LAO, lateral "
      "towards CRA, vertical downwards");
  return 1e-3 * (Eigen::Vector3d(incrementAt(increments.longitudinal_mm, frame), 0,
                                 incrementAt(increments.lateral_mm, frame)) +
                 incrementAt(increments.vertical_mm, frame) * R_isocenter_patient.row(1).transpose());
}

// The direction in the patient that letters like "LA" stand for: the axes' signs added up.
std::optional<Eigen::Vector3d> directionOf(const std::string& letters) {
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  for (const char letter : letters) {
    const auto at = std::string_view("LRPAHF").find(letter);
    if (at == std::string_view::npos) return std::nullopt;
    direction[at / 2] += at % 2 == 0 ? 1 : -1;
  }
  return direction;
}

// Whether stored frames are to be mirrored for the camera at the source.
bool readMirroring(const DicomFile& file, const std::optional<ViewAngles>& angles, int frame, Lines& assumed) {
  const auto flip = file.text(tag::kFieldFlip, frame);
  if (flip && *flip != "YES" && *flip != "NO") throw file.refusal(tag::kFieldFlip, *flip, "must be YES or NO");
  bool mirrored = !flip || *flip == "NO";
  std::string seen = flip ? "" : missing(tag::kFieldFlip, "frames are taken as seen from the detector");
  const auto orientation = file.texts(tag::kPatientOrientation, frame);
  const auto row = orientation.size() == 2 ? directionOf(orientation[0]) : std::nullopt;
  const auto column = orientation.size() == 2 ? directionOf(orientation[1]) : std::nullopt;
  if (angles && row && column) {
    const Eigen::Matrix3d R = viewRotation(*angles);
    const bool row_agrees = (mirrored ? -1 : 1) * R.row(0).dot(*row) > 0, column_agrees = R.row(1).dot(*column) > 0;
    const std::string label = tag::kPatientOrientation.label() + " = " + orientation[0] + "\\" + orientation[1];
    if (!flip && !row_agrees && column_agrees) {
      mirrored = false;
      seen = missing(tag::kFieldFlip, "frames are taken as seen from the source, as " + label + " says");
    } else if (!row_agrees || !column_agrees) {
      assumed.push_back(label + " contradicts the angles and is not used");
    }
  }
  if (!seen.empty()) assumed.push_back(seen);
  return mirrored;
}

// The camera's axes by whichever angles the file has; the detector's tell more, and its picture need not be upright.
Eigen::Matrix3d cameraRotation(const XaGeometry& geometry, bool by_isocenter, double field_rotation_rad,
                               const Eigen::Matrix3d& R_isocenter_patient, Lines& assumed) {
  if (by_isocenter) {
    return Eigen::AngleAxisd(-field_rotation_rad, Eigen::Vector3d::UnitZ()) *
           detectorRotation(*geometry.isocenter_angles) * R_isocenter_patient;
  }
  if (field_rotation_rad != 0) {
    assumed.push_back(tag::kFieldRotation.label() + " is not used: with patient-based angles the head is up");
  }
  return viewRotation(*geometry.patient_angles);
}

// Each convention by the other one when the file has one only.
void completeAngles(XaGeometry& g, const Eigen::Matrix3d& R_isocenter_patient) {
  const std::string by_position = " by Patient Position and the table's angles";
  if (g.patient_angles && !g.isocenter_angles) {
    g.isocenter_angles = isocenterAnglesOf(*g.patient_angles, R_isocenter_patient);
    g.assumed.push_back(missing(tag::kIsocenterPrimary, "isocentre-based angles from the patient-based" + by_position));
  } else if (!g.patient_angles && g.isocenter_angles) {
    g.patient_angles = viewAnglesOf(*g.isocenter_angles, R_isocenter_patient);
    g.assumed.push_back(missing(tag::kPrimary, "patient-based angles from the isocentre-based" + by_position));
  } else if (g.patient_angles) {
    const Eigen::Vector3d beam = beamDirection(viewAnglesOf(*g.isocenter_angles, R_isocenter_patient));
    if (beamDirection(*g.patient_angles).dot(beam) < std::cos(kAgreement_rad)) {
      g.assumed.push_back("the patient-based and the isocentre-based angles differ: the pose is by the latter");
    }
  }
}

std::optional<double> timeAt(const XaIncrements& increments, int frame) {
  const auto& times_ms = increments.frame_times_ms;
  if (times_ms.empty()) return std::nullopt;
  if (times_ms.size() == 1) return 1e-3 * frame * times_ms.front();
  return 1e-3 * std::accumulate(times_ms.begin() + 1, times_ms.begin() + 1 + frame, 0.0);
}

}  // namespace

XaIncrements readXaIncrements(const DicomFile& file, int frames) {
  XaIncrements increments;
  increments.primary_deg = readIncrement(file, tag::kPrimaryIncrement, frames);
  increments.secondary_deg = readIncrement(file, tag::kSecondaryIncrement, frames);
  increments.vertical_mm = readIncrement(file, tag::kTableVertical, frames);
  increments.lateral_mm = readIncrement(file, tag::kTableLateral, frames);
  increments.longitudinal_mm = readIncrement(file, tag::kTableLongitudinal, frames);
  for (const DicomTag& times : {tag::kFrameTimes, tag::kFrameTime}) {
    if (!increments.frame_times_ms.empty()) break;
    increments.frame_times_ms = readIncrement(file, times, frames);
    for (const double time_ms : increments.frame_times_ms) requireBetween(file.path(), times.label(), time_ms, 0, 1e7);
  }
  for (const DicomTag& rate : {tag::kCineRate, tag::kDisplayRate}) {
    const auto rate_hz = increments.frame_times_ms.empty() ? file.number(rate) : std::nullopt;
    if (!rate_hz || *rate_hz == 0) continue;
    increments.frame_times_ms = {1e3 / requireBetween(file.path(), rate.label(), *rate_hz, 1e-3, 1e4)};
  }
  return increments;
}

XaGeometry readXaGeometry(const DicomFile& file, const DicomPixelLayout& layout, const XaIncrements& increments,
                          int frame, XaAngleSigns signs) {
  XaGeometry g = readXaCamera(file, layout, frame);
  g.patient_angles = readPatientAngles(file, increments, frame, signs, g.assumed);
  g.isocenter_angles = readIsocenterAngles(file, frame, g.assumed);
  g.table_angles = readTableAngles(file, frame);
  g.stored_mirrored = readMirroring(file, g.patient_angles, frame, g.assumed);
  placePrincipalPoint(file, frame, g);
  g.time_s = timeAt(increments, frame);
  const bool by_isocenter = g.isocenter_angles.has_value();
  const auto position = patientPosition(file, frame, g.assumed);
  const Eigen::Matrix3d R_isocenter_patient =
      position ? patientRotation(*position, g.table_angles) : Eigen::Matrix3d::Identity();
  if (position) {
    completeAngles(g, R_isocenter_patient);
    g.table_shift_m = tableShift(file, increments, frame, R_isocenter_patient, g.assumed);
  }
  if (!g.patient_angles && !g.isocenter_angles) g.assumed.push_back(missing(tag::kPrimary, "no pose by the angles"));
  if (!g.source_isocenter_distance_m || !(by_isocenter ? position.has_value() : g.patient_angles.has_value())) return g;
  Pose T_camera_patient = Pose::Identity();
  T_camera_patient.linear() =
      cameraRotation(g, by_isocenter, fieldRotation(file, frame), R_isocenter_patient, g.assumed);
  T_camera_patient.translation() =
      Eigen::Vector3d(0, 0, *g.source_isocenter_distance_m) + T_camera_patient.linear() * g.table_shift_m;
  g.T_camera_patient = T_camera_patient;
  return g;
}

}  // namespace angio::io
