// SPDX-License-Identifier: GPL-2.0-or-later
#include "xa_geometry.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "xa_tags.hpp"

namespace angio::io {
namespace {

using Lines = std::vector<std::string>;

// "(0018,1164) Imager Pixel Spacing is missing: " and what was done instead.
std::string missing(const DicomTag& tag, const std::string& instead) { return tag.label() + " is missing: " + instead; }

// Metres; from a tenth of a C-arm to ten of them.
std::optional<double> distance(const DicomFile& file, const DicomTag& tag, int frame) {
  const auto distance_mm = file.number(tag, frame);
  if (!distance_mm || *distance_mm == 0) return std::nullopt;  // Zero is how machines say that they do not know.
  return 1e-3 * requireBetween(file.path(), tag.label(), *distance_mm, 100, 10000);
}

std::optional<double> magnificationOf(const DicomFile& file, int frame) {
  const auto factor = file.number(tag::kMagnification, frame);
  if (!factor || *factor == 0) return std::nullopt;
  return requireBetween(file.path(), tag::kMagnification.label(), *factor, 1, 10);
}

struct Distances {
  double detector_m = 0;
  std::optional<double> isocenter_m;
};

Distances readDistances(const DicomFile& file, int frame, Lines& assumed) {
  auto detector_m = distance(file, tag::kSourceDetector, frame);
  auto isocenter_m = distance(file, tag::kSourcePatient, frame);
  if (!isocenter_m) {
    isocenter_m = distance(file, tag::kSourceIsocenter, frame);
    if (isocenter_m) assumed.push_back(missing(tag::kSourcePatient, tag::kSourceIsocenter.label() + " stands for it"));
  }
  const auto factor = magnificationOf(file, frame);
  if (!detector_m) {
    if (!factor || !isocenter_m) {
      throw file.refusal(tag::kSourceDetector, "",
                         "is missing, and with it the camera: " + tag::kMagnification.label() + " and " +
                             tag::kSourcePatient.label() + " do not replace it");
    }
    detector_m = *isocenter_m * *factor;
    assumed.push_back(
        missing(tag::kSourceDetector,
                formatValue(*detector_m * 1e3) + " mm by the magnification factor and " + tag::kSourcePatient.label()));
  } else if (!isocenter_m && factor) {
    isocenter_m = *detector_m / *factor;
    assumed.push_back(
        missing(tag::kSourcePatient, formatValue(*isocenter_m * 1e3) + " mm by " + tag::kMagnification.label()));
  } else if (!isocenter_m) {
    assumed.push_back(missing(tag::kSourcePatient, "no pose by the angles, no magnification"));
  } else if (factor && std::abs(*factor * *isocenter_m / *detector_m - 1) > 0.01) {
    assumed.push_back(tag::kMagnification.label() + " = " + formatValue(*factor) + " is not used: the distances say " +
                      formatValue(*detector_m / *isocenter_m));
  }
  if (isocenter_m && *isocenter_m > *detector_m) {
    throw file.refusal(tag::kSourcePatient, formatValue(*isocenter_m * 1e3),
                       "must not exceed " + tag::kSourceDetector.label() + " = " + formatValue(*detector_m * 1e3));
  }
  return {*detector_m, isocenter_m};
}

// At the detector, between rows and between columns.
struct Spacing {
  Eigen::Vector2d mm;
  DicomTag from;
};

// Two positive numbers, the first again for the second when there is one only; nothing when missing or zero.
std::optional<Eigen::Vector2d> pairOf(const DicomFile& file, const DicomTag& tag, int frame, double largest) {
  const auto values = file.numbers(tag, frame);
  if (values.empty() || values.front() == 0) return std::nullopt;
  const Eigen::Vector2d pair(values[0], values.size() > 1 ? values[1] : values[0]);
  for (const double value : pair) requireBetween(file.path(), tag.label(), value, 1e-3, largest);
  return pair;
}

Spacing readSpacing(const DicomFile& file, const DicomPixelLayout& layout, const Distances& distances, int frame,
                    Lines& assumed) {
  constexpr double kWidestPixel_mm = 10, kWidestField_mm = 2000;
  const auto assume = [&](const Eigen::Vector2d& mm, const std::string& how) {
    assumed.push_back(missing(tag::kImagerSpacing, formatValue(mm[0]) + " x " + formatValue(mm[1]) + " mm by " + how));
  };
  if (const auto mm = pairOf(file, tag::kImagerSpacing, frame, kWidestPixel_mm)) return {*mm, tag::kImagerSpacing};
  const auto in_patient = pairOf(file, tag::kPixelSpacing, frame, kWidestPixel_mm);
  if (in_patient && distances.isocenter_m) {
    const Eigen::Vector2d mm = *in_patient * distances.detector_m / *distances.isocenter_m;
    assume(mm, tag::kPixelSpacing.label() + ", calibrated by " +
                   file.text(tag::kCalibrationType, frame).value_or("an unknown way") + ", taken at the isocentre");
    return {mm, tag::kPixelSpacing};
  }
  const Eigen::Vector2d size_px(layout.height_px, layout.width_px);
  if (const auto field_mm = pairOf(file, tag::kFieldDimensions, frame, kWidestField_mm)) {
    const Eigen::Vector2d mm = field_mm->cwiseQuotient(size_px);
    assume(mm, tag::kFieldDimensions.label() + " on the whole image");
    return {mm, tag::kFieldDimensions};
  }
  if (const auto size_mm = pairOf(file, tag::kIntensifierSize, frame, kWidestField_mm)) {
    const Eigen::Vector2d mm = Eigen::Vector2d::Constant((*size_mm)[0] / size_px.maxCoeff());
    assume(mm, tag::kIntensifierSize.label() + " on the whole image");
    return {mm, tag::kIntensifierSize};
  }
  throw file.refusal(tag::kImagerSpacing, "",
                     "is missing, and with it the camera: no " + tag::kFieldDimensions.label() + ", " +
                         tag::kIntensifierSize.label() + ", or " + tag::kPixelSpacing.label() + " with " +
                         tag::kSourcePatient.label() + " replaces it");
}

// The camera of a frame with its distances; the rest of the result is left alone.
XaGeometry readXaCamera(const DicomFile& file, const DicomPixelLayout& layout, int frame) {
  Lines assumed;
  const Distances distances = readDistances(file, frame, assumed);
  const Spacing spacing = readSpacing(file, layout, distances, frame, assumed);
  assumed.push_back("the principal point is taken at the image's centre: no attribute says it");
  XrayCamera::Parameters p;
  p.width_px = layout.width_px;
  p.height_px = layout.height_px;
  const double rows_m = spacing.mm[0] * 1e-3, columns_m = spacing.mm[1] * 1e-3;
  p.fx_px = distances.detector_m / columns_m;
  p.fy_px = distances.detector_m / rows_m;
  p.cx_px = 0.5 * (layout.width_px - 1);
  p.cy_px = 0.5 * (layout.height_px - 1);
  if (columns_m == rows_m) p.pixel_spacing_m = rows_m;
  p.source_detector_distance_m = distances.detector_m;
  XaGeometry geometry{XrayCamera(p)};
  geometry.source_detector_distance_m = distances.detector_m;
  geometry.source_isocenter_distance_m = distances.isocenter_m;
  geometry.spacing_from = spacing.from.label();
  geometry.assumed = std::move(assumed);
  return geometry;
}

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
                                            Lines& assumed) {
  const auto primary = angle(file, tag::kPrimary, frame, 360), secondary = angle(file, tag::kSecondary, frame, 360);
  if (!primary && !secondary) return std::nullopt;
  if (!primary) assumed.push_back(missing(tag::kPrimary, "0 deg"));
  if (!secondary) assumed.push_back(missing(tag::kSecondary, "0 deg"));
  return ViewAngles{primary.value_or(0) + degToRad(incrementAt(increments.primary_deg, frame)),
                    secondary.value_or(0) + degToRad(incrementAt(increments.secondary_deg, frame))};
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

// Clockwise, of what is stored against the detector [rad].
double fieldRotation(const DicomFile& file, int frame) {
  const double rotation_deg = file.number(tag::kFieldRotation, frame).value_or(0);
  if (rotation_deg != 0 && rotation_deg != 90 && rotation_deg != 180 && rotation_deg != 270) {
    throw file.refusal(tag::kFieldRotation, formatValue(rotation_deg), "must be 0, 90, 180 or 270");
  }
  return degToRad(rotation_deg);
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
                          int frame) {
  XaGeometry g = readXaCamera(file, layout, frame);
  g.patient_angles = readPatientAngles(file, increments, frame, g.assumed);
  g.isocenter_angles = readIsocenterAngles(file, frame, g.assumed);
  g.table_angles = readTableAngles(file, frame);
  g.stored_mirrored = readMirroring(file, g.patient_angles, frame, g.assumed);
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
